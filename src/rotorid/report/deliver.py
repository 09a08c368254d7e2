"""From a recording set to the files of its verdict: verdict, page, vehicle, conditions, instruments and ledger.

The ledger of a verdict: every rule that decided something, on what, with its numbers and its sentence.

It lies next to the verdict (`ledger.json`), for whoever wants to know why an effect is not in the model, or why its
status is no higher.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from rotorid.io.text.writing import all_or_none, rounded
from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.findings import Analysis, Finding
from rotorid.mismatch.decision.rules import RULES
from rotorid.mismatch.delivery.files import (
    CONDITIONS,
    INSTRUMENTS,
    conditions_of,
    empty,
    improved_vehicle,
    instruments_of,
    read_conditions,
    read_instruments,
)
from rotorid.mismatch.delivery.files import text_of as file_text
from rotorid.mismatch.delivery.flown import model_of
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.remainder import prove as prove_reading
from rotorid.mismatch.model.decided import Watch, unwatched
from rotorid.mismatch.tell.forward import Forward, forward_channels, prove
from rotorid.mismatch.tell.locate import locate
from rotorid.mismatch.tell.steps import steps_sentence
from rotorid.mismatch.tell.verdict import Verdict, make_verdict, with_doubts
from rotorid.recordings import RecordingSet, Vehicle, read_vehicle, write_vehicle
from rotorid.recordings.sufficient import sufficient
from rotorid.report.page.make import make_page
from rotorid.steps import step

_ONE_THREAD = threadpool_limits.wrap(limits=1)
"""The matrices are small: a second thread of the linear algebra costs half as much again and saves no time."""


def deliver(
    recordings: RecordingSet,
    verdict_path: Path,
    page_path: Path,
    improved_path: Path,
    off: Collection[str] = (),
) -> Verdict:
    """Analyse a set and write its verdict, its page and the improved vehicle; rules named in `off` are left out."""
    return write_files(analysis_of(recordings, off), verdict_path, page_path, improved_path)


@_ONE_THREAD
def analysis_of(recordings: RecordingSet, off: Collection[str] = (), watch: Watch = unwatched) -> Analysis:
    """The analysis for the kind of the set, without the rules named in `off`.

    `watch` is called with what the fitted runs of a flight decide, before the report runs are opened.

    InputError in one sentence where the set does not suffice, or no rule has such a name.
    """
    usable = sufficient(recordings)
    with rules.asking(off) as asked, step(f"analysing the {usable.vehicle.kind}"):
        flight = usable.vehicle.kind == "flight"
        analysis = analyse(usable, watch=watch) if flight else analyse_instrument(usable)
    without = tuple(f"Judged without the rule {name}: {rules.RULES[name].decides}" for name in sorted(asked.off))
    analysis = replace(analysis, fired=dict(asked.fired), notes=(*without, *analysis.notes))
    recordings = replace(analysis.recordings, left_out=usable.left_out)  # sets with corrected mistakes are made anew
    analysis = replace(analysis, recordings=recordings, notes=(*usable.left_out, *analysis.notes))
    return _with_rounded_model(with_doubts(analysis, usable))


def _with_rounded_model(analysis: Analysis) -> Analysis:
    """The analysis whose improved vehicle is stated, and simulated, to as many digits as the verdict states.

    More digits are chance: the last ones of a sum depend on how many threads added it up.
    """
    stated = Vehicle.model_validate(rounded(analysis.improved.model_dump()))
    findings = tuple(replace(f, values=tuple(rounded(list(map(float, f.values))))) for f in analysis.findings)
    return replace(analysis, improved=stated, findings=findings)


def judge(recordings: RecordingSet) -> Verdict:
    """The verdict alone, without page and improved vehicle: what `verdict.json` would say."""
    return verdict_of(analysis_of(recordings))


@_ONE_THREAD
def verdict_of(analysis: Analysis) -> Verdict:
    """The verdict that an analysis amounts to."""
    forward = forward_channels(analysis).channels if analysis.instrument is None else {}
    return _with_first_details(make_verdict(analysis, locate(analysis), forward), analysis)


def _with_first_details(verdict: Verdict, analysis: Analysis) -> Verdict:
    """The verdict, whose details first say what each step takes off the error, and which runs were of no use."""
    first = [text for text in (steps_sentence(verdict),) if text]
    return verdict.model_copy(update={"details": (*first, *analysis.recordings.left_out, *verdict.details)})


@_ONE_THREAD
def write_files(
    analysis: Analysis,
    verdict_path: Path,
    page_path: Path,
    improved_path: Path,
) -> Verdict:
    """Write what an analysis amounts to; what is taken home is read back and simulated as proof.

    `conditions.yaml` and `instruments.yaml` are written next to the improved vehicle where there is something to write.
    """
    locations = locate(analysis)
    improved = improved_vehicle(analysis)
    others = [improved_path.with_name(name) for name in (CONDITIONS, INSTRUMENTS)]
    paths = (verdict_path, page_path, improved_path, verdict_path.with_name("ledger.json"), *others)
    with all_or_none(*paths, optional=others) as parts:
        verdict_part, page_part, improved_part, ledger_part, *other_parts = parts
        write_vehicle(improved, improved_part)
        contents = conditions_of(analysis), instruments_of(analysis)
        for content, part in zip(contents, other_parts, strict=True):
            if not empty(content):
                part.write_text(file_text(content), encoding="utf-8")
        conditions, instruments = (
            read(part) if part.exists() else content
            for read, part, content in zip((read_conditions, read_instruments), other_parts, contents, strict=True)
        )
        reloaded = read_vehicle(improved_part)
        if analysis.instrument is None:
            forward = forward_channels(analysis)
            prove(analysis, model_of(reloaded, conditions, instruments), forward)
        else:
            forward = Forward({})
            prove_reading(analysis, improved, reloaded, instruments)
        verdict = _with_first_details(make_verdict(analysis, locations, forward.channels), analysis)
        verdict_part.write_text(verdict.text(), encoding="utf-8")
        decided = ledger(analysis, verdict)
        ledger_part.write_text(text_of(decided), encoding="utf-8")
        page_part.write_text(make_page(analysis, verdict, forward.notes, decided), encoding="utf-8")
    return verdict


def ledger(analysis: Analysis, verdict: Verdict) -> list[dict]:
    """Entries of `rule`, `on`, `numbers` and `sentence`, in the order of the decisions."""
    out = [_entry("enough_to_compare", "runs", sentence=text) for text in analysis.recordings.left_out]
    out += [_of_finding(f, analysis) for f in analysis.findings]
    for name, (believed, refitted, low, high) in analysis.wrong_values.items():
        numbers = {"believed": believed, "refitted": refitted, "low_95": low, "high_95": high}
        out.append(_entry("wrong_value", name, numbers, "the fitted runs contradict what is believed"))
    out += [_entry("within_trust", "values", sentence=text) for text in analysis.corrected]
    left = {"share_left": verdict.unexplained.share}
    out.append(_entry("word_from_numbers", verdict.verdict, left, verdict.unexplained.description))
    out += [_entry(name, "search", {"fired": n}, RULES[name].decides) for name, n in sorted(analysis.fired.items())]
    return [e for e in out if e]


def _of_finding(finding: Finding, analysis: Analysis) -> dict:
    """What decided on one id."""
    numbers: dict = {"p_value": finding.p_value} if finding.p_value < 1.0 else {}
    if finding.probability is not None:
        numbers["probability"] = finding.probability
    if finding.id in analysis.shares:
        numbers["share"] = analysis.shares[finding.id]
    if finding.gain is not None:
        numbers |= dict(zip(("rmse_ratio", "low_95", "high_95"), finding.gain, strict=True))
    if finding.status == "not_established":
        return _entry(finding.rule or "search", finding.id, numbers, finding.sentence)
    if finding.status == "absorbed":
        return _entry("absorbed_by_values", finding.id, numbers, finding.sentence)
    if finding.status == "suggested":
        return _entry("suggested", finding.id, numbers, finding.objection)
    if finding.id not in analysis.without:
        return _entry("mistakes_first", finding.id, numbers, finding.sentence)
    if finding.status == "ambiguous":
        return _entry("class", finding.id, numbers, f"these data cannot distinguish {', '.join(finding.alternatives)}")
    return _entry("established", finding.id, numbers, "it passed every rule")


def _entry(rule: str, on: str, numbers: dict | None = None, sentence: str = "") -> dict:
    """One line of the ledger."""
    known = {name: value for name, value in (numbers or {}).items() if math.isfinite(value)}
    return {"rule": rule, "on": on, "numbers": rounded(known), "sentence": str(sentence)}


def text_of(entries: list[dict]) -> str:
    """The ledger as it is written."""
    return json.dumps(entries, indent=1, allow_nan=False) + "\n"
