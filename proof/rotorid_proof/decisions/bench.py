"""Decisions scored on everything that is kept, in minutes."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from rotorid_proof.decisions import truths
from rotorid_proof.decisions.decisions import DECISIONS, Said, ideal_observer
from rotorid_proof.decisions.score import Scored, score_drawn, score_planted, score_real
from rotorid_proof.decisions.store import Kept, newest, read_all, read_evidence, read_truth
from rotorid_proof.decisions.table import Row, markdown, sets, table

LOG = logging.getLogger(__name__)
ENGINE = "engine"
"""The one decision that stands and benches have."""
IDEAL = "ideal observer"
"""Knows the truth, and says what these data could tell of it."""


def decided(folder: Path, kept: Kept) -> dict[str, Said]:
    """What each decision says of a flight, and the ideal observer; of a stand or bench the engine alone."""
    whole = read_evidence(folder, kept)
    if kept.label.plant != "flight":
        return {ENGINE: DECISIONS[ENGINE](whole)}
    answer = read_truth(folder, kept).get("answer")
    with threadpool_limits(1):
        out = {name: decision(whole) for name, decision in DECISIONS.items()}
        return out if answer is None else {**out, IDEAL: ideal_observer(whole, answer)}


def scored(folder: Path, kept: Kept, said: Said, untouched: Said | None) -> Scored | None:
    """A decision's score on a set; None where its flight untouched is not kept."""
    truth = read_truth(folder, kept)
    if "answer" in truth:
        return score_drawn(said, truth["answer"])
    if "truths" in truth:
        planted = [truths.from_json(t) for t in truth["truths"]]
        return None if untouched is None else score_planted(said, untouched, planted)
    return score_real(said, truth.get("expected", ()))


def rows_of(folder: Path, engine: str, cores: int) -> list[Row]:
    """Every decision on every set kept in a folder, of several codes' evidence that of `engine` first."""
    known = sorted(newest(read_all(folder), engine, folder), key=lambda k: k.label.name)
    with ProcessPoolExecutor(cores) as pool:
        said = list(pool.map(partial(decided, folder), known, chunksize=4))
    untouched = {k.label.laboratory: own for k, own in zip(known, said, strict=True) if k.label.origin == "untouched"}
    rows = []
    for kept, own in zip(known, said, strict=True):
        for decision, words in own.items():
            before: Mapping[str, Said] = untouched.get(kept.label.laboratory, {})
            score = scored(folder, kept, words, before.get(decision))
            if score is not None:
                rows.append(Row(decision, kept.label, kept.engine != engine, words, score))
    return rows


def write_tables(folder: Path, engine: str, out: Path, cores: int) -> Sequence[Row]:
    """Score all decisions on what `folder` keeps: decisions.csv, decisions.md and, set by set, sets.csv in `out`."""
    start = time.perf_counter()
    rows = rows_of(folder, engine, cores)
    out.mkdir(parents=True, exist_ok=True)
    found = table(rows)
    found.to_csv(out / "decisions.csv", index=False)
    sets(rows).to_csv(out / "sets.csv", index=False)
    (out / "decisions.md").write_text(markdown(found), encoding="utf-8")
    LOG.info("%d sets scored in %.0f s", len({row.label.name for row in rows}), time.perf_counter() - start)
    return rows
