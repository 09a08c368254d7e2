"""Prove the next flight on concealed sets: plan, record, judge both together.

- Records sets in which pairs look alike, by code that shares nothing with the library. The listed ones were looked at
  while the planner was made, and so were their first new draws: what is proven are further draws of the same list.
- Plans a flight for what each leaves open; the plan never sees an answer.
- Has the same simulator record the planned flight, and a standard one of the same length, and judges each with the set.
- Writes the row of every set as it comes, so that an interrupted proof goes on where it stopped.
"""

import warnings
from dataclasses import replace
from pathlib import Path

from rotorid.plan.candidates import Limits, read_limits
from rotorid.plan.plan import plan
from rotorid.plan.questions import FittedSet, known, known_from
from rotorid.plan.write import sampled
from rotorid.recordings import RecordingSet
from rotorid.report.deliver import judge
from rotorid_lab import log
from rotorid_proof import next_flight as proof
from rotorid_proof.row_by_row import as_read, rows_of


def by_hand(case, answer: dict, found: FittedSet, made, question, true: str, simulator) -> dict:
    """What the best step by hand is predicted to separate, and does as recorded; empty where none is predicted."""
    ids = None if question is None else question.ids
    separated = [
        (h, s) for h in made.by_hand for own, every in h.questions if own == ids for s in every if s.true == true
    ]
    if not separated:
        return {}
    hand, expected = max(separated, key=lambda pair: pair[1].sigma)
    change = hand.change
    step = {"swapped": change.pairs, "mass_kg": change.mass_kg, "place_m": change.place_m}
    flown = simulator.record_by_hand(case, answer, hand.hover_s, **step)
    recorded = as_read(flown, simulator.write_set, "by hand")
    measured = proof.measured_after(found, question, change, recorded, true)
    return {"by_hand": change.words, "by_hand_sigma": expected.sigma, "by_hand_measured": measured}


def row_of(case, answer: dict, first: RecordingSet, simulator, limits: Limits) -> proof.Row:
    """What becomes of one set."""
    truth = {answer["effects"][0]["id"]}
    named = next(iter(truth))
    # As the command does: the plan asks what the verdict leaves open, and nothing that it does not claim.
    found: FittedSet = known_from(first, judge(first).model_dump(mode="json"))
    classes = proof.classes_in(found)
    if not classes:
        return proof.Row(case=case.name, truth=named, open="", said="nothing was left open")
    ids = classes[0]
    made = plan(found, limits)
    if not made.pieces:
        said = made.unanswerable[0][1] if made.unanswerable else "no manoeuvre separates them"
        return proof.Row(case=case.name, truth=named, open=" ".join(ids), outcome="no plan", said=said)
    expected = proof.predicted(made, ids, truth)
    question = next((q for q in found.questions if q.ids and set(q.ids) == set(ids)), None)
    references = {
        "planned": simulator.reference_of(sampled(made), *simulator.grid(case)),
        "standard": simulator.standard(case, made.duration_s),
    }
    outcome, measured, said = {}, {}, {}
    for name, reference in references.items():
        second = as_read(simulator.record(case, answer, {name: reference}), simulator.write_set, "second")
        outcome[name], said[name], whole = proof.judged(first, second, ids, truth)
        if question is not None:
            measured[name] = proof.measured(found, known(whole), question, named)
    row = proof.Row(
        case=case.name,
        truth=named,
        open=" ".join(ids),
        planned_s=made.duration_s,
        measured_sigma=measured.get("planned", float("nan")),
        standard_sigma=measured.get("standard", float("nan")),
        promised=made.settles,
        outcome=outcome["planned"],
        standard_outcome=outcome["standard"],
        said=said["planned"],
    )
    row = replace(row, **by_hand(case, answer, found, made, question, named, simulator))
    if expected is None:
        return row
    low, high = expected.interval_95
    return replace(row, predicted_sigma=expected.sigma, predicted_low=low, predicted_high=high)


def main(
    table: str,
    summary: str,
    so_far: str,
    limits: str,
    code: str = "",
    most: int | None = None,
    draws: tuple[int, ...] = (7, 8),
) -> None:
    """Write `table` (a row a set) and `summary`; rows are kept in `so_far` as they come.

    A row of another `code` stays until the case is judged anew; `most` cases are taken at most; `draws` are the
    numbers of the draws of each listed one.
    """
    warnings.simplefilter("ignore")
    from rotorid_proof.concealed import planned as simulator
    from rotorid_proof.concealed.richsim import scene

    allowed = read_limits(Path(limits))
    # Where speeds are commands alone a set takes minutes: those come last of a draw.
    listed = [*simulator.look_alikes(), *simulator.ambiguous()]
    listed = sorted(listed, key=lambda case: "speed" not in case.settings.groups)
    cases = [simulator.drawn_anew(case, number) for number in draws for case in listed][:most]

    def row(case) -> proof.Row:
        recording, answer, _ = scene.make(case.settings, case.seed)
        return row_of(case, answer, as_read(recording, simulator.write_set, "first"), simulator, allowed)

    found = rows_of(cases, row, proof.table, Path(so_far), code)
    found.to_csv(table, index=False)
    proof.summary(found).to_csv(summary, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            table=snakemake.output.table,
            summary=snakemake.output.summary,
            so_far=snakemake.params.so_far,
            limits=snakemake.input.limits,
            code=str(snakemake.params.code),
        )
