"""What each rule of the decision is worth: concealed sets judged with it and without it.

A rule is left out of those sets in which it fired; elsewhere nothing could change. A set is righted by a rule if its
verdict is right with it and wrong without it, and wronged if it is the other way round.
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from scipy.stats import beta

from rotorid.mismatch.deliver import analysis_of, verdict_of
from rotorid.mismatch.rules import RULES
from rotorid.proof.score import score_case
from rotorid.recordings import read_set

COLUMNS = (
    "rule", "fired", "judged", "righted", "wronged", "words_righted", "words_wronged", "pays_low_95", "pays_high_95",
    "seconds_saved",
)  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """A verdict on a concealed set, how it scores, and which rules fired."""

    name: str
    right: bool
    word_right: bool
    fired: Mapping[str, int]
    seconds: float
    """Processor time."""


def judged(folder: Path, answers: Path, off: Collection[str] = ()) -> Judged:
    """The verdict on the set in a folder, without some rules, scored by its answer."""
    start = time.process_time()
    try:
        analysis = analysis_of(read_set(folder), off)
        verdict, fired = json.loads(verdict_of(analysis).text()), analysis.fired
        averaged = analysis.samples_per_row
    except Exception as error:  # any fault of the stage is a result here
        verdict, fired, averaged = {"failed": f"{type(error).__name__}: {error}"}, {}, 1
    answer = json.loads((answers / f"{folder.name}.json").read_text(encoding="utf-8"))
    score = score_case(verdict, answer, averaged)
    return Judged(folder.name, score["right"], score["word_right"], fired, time.process_time() - start)


def fires_in(base: Iterable[Judged], rule: str, most: int) -> list[Judged]:
    """At most `most` of the sets in which a rule fired, spread evenly over all of them."""
    own = [j for j in base if j.fired.get(rule)]
    step = max(1.0, len(own) / most)
    return [own[int(k * step)] for k in range(min(most, len(own)))]


def row(rule: str, with_it: list[Judged], without: list[Judged], fired: int) -> dict:
    """One line of the table: what leaving a rule out changed."""
    pairs = list(zip(with_it, without, strict=True))
    righted, wronged = (sum(a.right and not b.right for a, b in p) for p in (pairs, [(b, a) for a, b in pairs]))
    words = [sum(a.word_right and not b.word_right for a, b in p) for p in (pairs, [(b, a) for a, b in pairs])]
    low, high = share_interval(righted, wronged)
    saved = sum(b.seconds - a.seconds for a, b in pairs) / len(pairs) if pairs else 0.0
    values = (rule, fired, len(pairs), righted, wronged, *words, low, high, round(saved, 2))
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


def stored(items: Iterable[Judged]) -> str:
    """Verdicts as JSON lines."""
    return "".join(json.dumps(vars(j) | {"fired": dict(j.fired)}) + "\n" for j in items)


def read_stored(path: Path) -> list[Judged]:
    """What `stored` wrote."""
    return [Judged(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]
