"""From a recording set to the files of its verdict: verdict, page, vehicle, conditions, instruments and ledger."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from rotorid.io.text.writing import all_or_none, rounded
from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.delivery.doubts import with_doubts
from rotorid.mismatch.delivery.files import (
    CONDITIONS,
    INSTRUMENTS,
    conditions_of,
    empty,
    instruments_of,
    read_conditions,
    read_instruments,
)
from rotorid.mismatch.delivery.files import text_of as file_text
from rotorid.mismatch.delivery.model import model_of
from rotorid.mismatch.delivery.parts import improved_vehicle
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.predict import prove as prove_reading
from rotorid.mismatch.model.decided import Watch, unwatched
from rotorid.mismatch.tell.forward import Forward, forward_channels, prove
from rotorid.mismatch.tell.ledger import ledger, text_of
from rotorid.mismatch.tell.locate import locate
from rotorid.mismatch.tell.steps import steps_sentence
from rotorid.mismatch.tell.verdict import Verdict, make_verdict
from rotorid.recordings import RecordingSet, Vehicle, read_vehicle, write_vehicle
from rotorid.recordings.sufficient import sufficient
from rotorid.report.page.make import make_page
from rotorid.steps import step

ONE_THREAD = threadpool_limits.wrap(limits=1)
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


@ONE_THREAD
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
    return with_rounded_model(with_doubts(analysis, usable))


def with_rounded_model(analysis: Analysis) -> Analysis:
    """The analysis whose improved vehicle is stated, and simulated, to as many digits as the verdict states.

    More digits are chance: the last ones of a sum depend on how many threads added it up.
    """
    stated = Vehicle.model_validate(rounded(analysis.improved.model_dump()))
    findings = tuple(replace(f, values=tuple(rounded(list(map(float, f.values))))) for f in analysis.findings)
    return replace(analysis, improved=stated, findings=findings)


def judge(recordings: RecordingSet) -> Verdict:
    """The verdict alone, without page and improved vehicle: what `verdict.json` would say."""
    return verdict_of(analysis_of(recordings))


@ONE_THREAD
def verdict_of(analysis: Analysis) -> Verdict:
    """The verdict that an analysis amounts to."""
    forward = forward_channels(analysis).channels if analysis.instrument is None else {}
    return with_first_details(make_verdict(analysis, locate(analysis), forward), analysis)


def with_first_details(verdict: Verdict, analysis: Analysis) -> Verdict:
    """The verdict, whose details first say what each step takes off the error, and which runs were of no use."""
    first = [text for text in (steps_sentence(verdict),) if text]
    return verdict.model_copy(update={"details": (*first, *analysis.recordings.left_out, *verdict.details)})


@ONE_THREAD
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
        verdict = with_first_details(make_verdict(analysis, locations, forward.channels), analysis)
        verdict_part.write_text(verdict.text(), encoding="utf-8")
        decided = ledger(analysis, verdict)
        ledger_part.write_text(text_of(decided), encoding="utf-8")
        page_part.write_text(make_page(analysis, verdict, forward.notes, decided), encoding="utf-8")
    return verdict
