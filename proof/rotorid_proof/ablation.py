"""What each rule of the decision is worth: verdicts with it and without it, scored by the answers.

A rule is left out of those sets in which it fired; elsewhere nothing could change. A set is righted by a rule if its
verdict is right with it and wrong without it, and wronged if it is the other way round.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd
from scipy.stats import beta

from rotorid.mismatch.decide.rules import RULES
from rotorid_proof.score import score_case
from rotorid_proof.without_rules import Judged

COLUMNS = (
    "rule", "fired", "judged", "righted", "wronged", "words_righted", "words_wronged", "pays_low_95", "pays_high_95",
    "seconds_saved",
)  # fmt: skip


def scores(judged: Judged, answers: Path) -> tuple[bool, bool]:
    """Whether a verdict names the whole set right, and whether its word is."""
    answer = json.loads((answers / f"{judged.name}.json").read_text(encoding="utf-8"))
    score = score_case(judged.verdict, answer, judged.samples_per_row)
    return score["right"], score["word_right"]


def row(rule: str, every: Iterable[Judged], without: list[Judged], answers: Path) -> dict:
    """One line of the table: what leaving a rule out of the verdicts `without` changed."""
    known = {j.name: j for j in every}
    pairs = [(scores(known[j.name], answers), scores(j, answers)) for j in without]
    back = [(other, one) for one, other in pairs]
    changed = [sum(a[k] and not b[k] for a, b in way) for k in (0, 1) for way in (pairs, back)]
    fired = sum(bool(j.fired.get(rule)) for j in known.values())
    low, high = share_interval(*changed[:2])
    saved = sum(j.seconds - known[j.name].seconds for j in without) / len(without) if without else 0.0
    values = (rule, fired, len(pairs), *changed, low, high, round(saved, 2))
    return dict(zip(COLUMNS, values, strict=True))


def share_interval(righted: int, wronged: int) -> tuple[float, float]:
    """95 % interval of the share of the sets decided by a rule that it rights (Clopper and Pearson, 1934)."""
    total = righted + wronged
    low = float(beta.ppf(0.025, righted, wronged + 1)) if righted else 0.0
    high = float(beta.ppf(0.975, righted + 1, wronged)) if wronged else 1.0
    return (round(low, 3), round(high, 3)) if total else (0.0, 1.0)


def table(rows: Iterable[Mapping]) -> pd.DataFrame:
    """All rules: those that right most first, those that never fired last."""
    out = pd.DataFrame(list(rows), columns=list(COLUMNS))
    out["net"] = out.righted - out.wronged
    out = out.sort_values(["net", "fired", "rule"], ascending=[False, False, True]).drop(columns="net")
    out.insert(1, "decides", [RULES[name].decides for name in out.rule])
    return out.reset_index(drop=True)
