"""Prove the next session on concealed stands and benches: plan, record, judge both together.

- Records sets in which pairs look alike, drawn for a release: nobody has seen them before.
- Plans a session for what each leaves open; the plan never sees an answer.
- Has the same simulator record the planned session, and the standard steps for as long, and judges each with the set.
- Writes the row of every set as it comes, so that an interrupted proof goes on where it stopped.
"""

import warnings
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.plan.candidates import SessionLimits
from rotorid.plan.plan import Plan
from rotorid.plan.session import (
    SessionStep,
    known_instrument,
    known_instrument_from,
    plan_session,
    table_of,
)
from rotorid.recordings import RecordingSet
from rotorid.report.deliver import judge
from rotorid_lab import log
from rotorid_proof import next_flight as proof
from rotorid_proof.row_by_row import as_read, rows_of


def standard_as_long(made: Plan) -> list[SessionStep]:
    """The standard steps in turn, each place as often as the others, about as long as the planned session."""
    usual = next((s for s in (made, *made.others) if s.name == "standard"), None)
    once = list({s.name: s for s in usual.pieces}.values()) if usual else []
    out: list[SessionStep] = []
    for step in cycle(once):
        longer = sum(s.duration_s for s in out) + step.duration_s
        if out and longer > made.duration_s + step.duration_s / 2:
            break
        out.append(step)
    return out


def as_table(found, steps: list[SessionStep]) -> pd.DataFrame:
    """The columns of a session of these steps."""
    return pd.concat([table_of(found, s).assign(run=f"step{i + 1:02d}") for i, s in enumerate(steps)])


def row_of(case, answer: dict, first: RecordingSet, simulator, limits: SessionLimits) -> proof.Row:
    """What becomes of one set."""
    truth = {e["id"] for e in answer["effects"]}
    named, kind = answer["effects"][0]["id"], first.vehicle.kind
    # As the command does: the plan asks what the verdict leaves open, and nothing that it does not claim.
    found = known_instrument_from(first, judge(first).model_dump(mode="json"))
    classes = proof.classes_in(found)
    if not classes:
        return proof.Row(case=case.name, truth=named, open="", said="nothing was left open", kind=kind)
    ids = classes[0]
    made = plan_session(found, limits)
    if not made.pieces:
        said = made.unanswerable[0][1] if made.unanswerable else "no load separates them"
        return proof.Row(case=case.name, truth=named, open=" ".join(ids), outcome="no plan", said=said, kind=kind)
    expected = proof.predicted(made, ids, truth)
    question = next((q for q in found.questions if set(q.ids) == set(ids)), None)
    outcome, measured, said = {}, {}, {}
    for name, steps in {"planned": list(made.pieces), "standard": standard_as_long(made)}.items():
        if not steps:
            continue
        second = as_read(simulator.record(case, answer, as_table(found, steps)), simulator.write_set, "second")
        outcome[name], said[name], whole = proof.judged(first, second, ids, truth)
        measured[name] = proof.measured(found, known_instrument(whole), question, named)
    row = proof.Row(
        case=case.name,
        truth=named,
        open=" ".join(ids),
        planned_s=made.duration_s,
        measured_sigma=measured.get("planned", np.nan),
        standard_sigma=measured.get("standard", np.nan),
        promised=made.settles,
        outcome=outcome["planned"],
        standard_outcome=outcome.get("standard", ""),
        said=said["planned"],
        kind=kind,
    )
    if expected is None:
        return row
    low, high = expected.interval_95
    return replace(row, predicted_sigma=expected.sigma, predicted_low=low, predicted_high=high)


def main(table: str, summary: str, so_far: str, release: str, code: str = "", draws: int = 5) -> None:
    """Write `table` (a row a set) and `summary`; rows are kept in `so_far` as they come.

    Every listed pair is drawn `draws` times for the `release` (the hash of a commit).
    """
    warnings.simplefilter("ignore")
    from rotorid_proof.concealed import loaded as simulator

    def row(case) -> proof.Row:
        recording, answer, _ = simulator.make(case.settings, case.seed)
        first = as_read(recording, simulator.write_set, "first")
        return row_of(case, answer, first, simulator, SessionLimits())

    cases = [case for number in range(draws) for case in simulator.look_alikes(release, number)]
    found = rows_of(cases, row, proof.table, Path(so_far), code)
    found.to_csv(table, index=False)
    proof.summary(found, "session").to_csv(summary, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            table=snakemake.output.table,
            summary=snakemake.output.summary,
            so_far=snakemake.params.so_far,
            release=snakemake.params.release,
            code=str(snakemake.params.code),
        )
