"""From a recording set to the files of its verdict, and the verdict as an object of a notebook.

Of the files `ledger.json` has every rule that decided something, on what, with its numbers and its sentence: for
whoever wants to know why an effect is not in the model, or why its status is no higher.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TypeVar

import pandas as pd

from rotorid.io.text.files import parse_yaml
from rotorid.io.text.writing import all_or_none, rounded, write_texts
from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.rules import RULES
from rotorid.mismatch.deliver.files import (
    CONDITIONS,
    INSTRUMENTS,
    Conditions,
    Instruments,
    conditions_of,
    empty,
    improved_vehicle,
    instruments_of,
    read_conditions,
    read_instruments,
    text_of,
)
from rotorid.mismatch.deliver.flown import model_of
from rotorid.mismatch.flight.fitted import Watch, unwatched
from rotorid.mismatch.tell.forward import forward_channels, prove
from rotorid.mismatch.tell.locate import locate
from rotorid.mismatch.tell.steps import steps_sentence, tiles
from rotorid.mismatch.tell.verdict import Verdict, main_channel, make_verdict, with_doubts
from rotorid.recordings import RecordingSet, Vehicle, read_vehicle, vehicle_of, write_vehicle
from rotorid.recordings.sufficient import sufficient
from rotorid.report.page import make_page, pretty
from rotorid.steps import one_thread, step

_Content = TypeVar("_Content", Conditions, Instruments)
FILES = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
"""Files that every verdict has."""
OTHERS = (CONDITIONS, INSTRUMENTS)
"""Files that it has where there is something to write."""


def deliver(recordings: RecordingSet, folder: Path, off: Collection[str] = ()) -> Verdict:
    """Analyse a set and write the files of its verdict into a folder; rules named in `off` are left out."""
    return write_files(analysis_of(recordings, off), folder)


@one_thread()
def analysis_of(recordings: RecordingSet, off: Collection[str] = (), watch: Watch = unwatched) -> Analysis:
    """The analysis for the kind of the set, without the rules named in `off`.

    `watch` is called with what the fitted runs of a flight decide, before the report runs are opened.

    InputError in one sentence where the set does not suffice, or no rule has such a name.
    """
    usable = sufficient(recordings)
    with rules.asking(off) as asked, step(f"analysing the {usable.vehicle.kind}"):
        if usable.vehicle.kind == "flight":
            analysis = analyse(usable, watch=watch)
        else:
            from rotorid.mismatch.instrument.analyse import analyse_instrument

            analysis = analyse_instrument(usable)
    without = tuple(f"Judged without the rule {name}: {RULES[name].decides}" for name in sorted(asked.off))
    recordings = replace(analysis.recordings, left_out=usable.left_out)  # sets with corrected mistakes are made anew
    notes = (*usable.left_out, *without, *analysis.notes)
    analysis = replace(analysis, recordings=recordings, fired=dict(asked.fired), notes=notes)
    analysis = with_doubts(analysis, usable)
    # The improved vehicle is stated, and simulated, to as many digits as the verdict states. More digits are chance:
    # the last ones of a sum depend on how many threads added it up.
    stated = Vehicle.model_validate(rounded(analysis.improved.model_dump()))
    findings = tuple(replace(f, values=tuple(rounded(list(map(float, f.values))))) for f in analysis.findings)
    return replace(analysis, improved=stated, findings=findings)


def judge(recordings: RecordingSet) -> Verdict:
    """The verdict alone, without page and improved vehicle: what `verdict.json` would say."""
    return verdict_of(analysis_of(recordings))


@one_thread()
def verdict_of(analysis: Analysis) -> Verdict:
    """The verdict that an analysis amounts to."""
    forward = forward_channels(analysis)[0] if analysis.instrument is None else {}
    return _with_first_details(make_verdict(analysis, locate(analysis), forward), analysis)


def _with_first_details(verdict: Verdict, analysis: Analysis) -> Verdict:
    """The verdict, whose details first say what each step takes off the error, and which runs were of no use."""
    first = [text for text in (steps_sentence(verdict),) if text]
    return verdict.model_copy(update={"details": (*first, *analysis.recordings.left_out, *verdict.details)})


def _written(content: _Content, path: Path, read: Callable[[Path], _Content]) -> _Content:
    """Content as it is read back from its file, which is written where there is something to write."""
    if empty(content):
        return content
    path.write_text(text_of(content), encoding="utf-8")
    return read(path)


@one_thread()
def write_files(analysis: Analysis, folder: Path) -> Verdict:
    """Write what an analysis amounts to, FILES and OTHERS; what is taken home is read back and simulated as proof."""
    locations = locate(analysis)
    improved = improved_vehicle(analysis)
    files, others = ([folder / name for name in names] for names in (FILES, OTHERS))
    with all_or_none(*files, *others, optional=others) as parts:
        verdict_part, page_part, improved_part, ledger_part, conditions_part, instruments_part = parts
        write_vehicle(improved, improved_part)
        conditions = _written(conditions_of(analysis), conditions_part, read_conditions)
        instruments = _written(instruments_of(analysis), instruments_part, read_instruments)
        reloaded = read_vehicle(improved_part)
        if analysis.instrument is None:
            forward, notes = forward_channels(analysis)
            prove(analysis, model_of(reloaded, conditions, instruments), forward, notes)
        else:
            from rotorid.mismatch.instrument.remainder import prove as prove_reading

            forward, notes = {}, ()
            prove_reading(analysis, improved, reloaded, instruments)
        verdict = _with_first_details(make_verdict(analysis, locations, forward), analysis)
        verdict_part.write_text(verdict.text(), encoding="utf-8")
        decided = ledger(analysis, verdict)
        ledger_part.write_text(json.dumps(decided, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        page_part.write_text(make_page(analysis, verdict, notes, decided), encoding="utf-8")
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
    return out + [
        _entry(name, "search", {"fired": n}, RULES[name].decides) for name, n in sorted(analysis.fired.items())
    ]


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
        rule, sentence = finding.rule or "search", finding.sentence
    elif finding.status == "absorbed":
        rule, sentence = "absorbed_by_values", finding.sentence
    elif finding.status == "suggested":
        rule, sentence = "suggested", finding.objection
    elif finding.id not in analysis.without:
        rule, sentence = "mistakes_first", finding.sentence
    elif finding.status == "ambiguous":
        rule, sentence = "class", f"these data cannot distinguish {', '.join(finding.alternatives)}"
    else:
        rule, sentence = "established", "it passed every rule"
    return _entry(rule, finding.id, numbers, sentence)


def _entry(rule: str, on: str, numbers: dict | None = None, sentence: str = "") -> dict:
    """One line of the ledger."""
    known = {name: value for name, value in (numbers or {}).items() if math.isfinite(value)}
    return {"rule": rule, "on": on, "numbers": rounded(known), "sentence": str(sentence)}


@dataclass(frozen=True, repr=False)
class Result:
    """What `rotorid.verdict` found.

    Attributes
    ----------
    verdict
        The whole of `verdict.json` as a typed model; its fields are those of the recording contract.
    files
        To each file's name its text: the same bytes that the command and the workflow write.
    analysis
        What the verdict was made from: residuals, findings, split. For those who know the library.
    """

    verdict: Verdict
    files: Mapping[str, str]
    analysis: Analysis

    @property
    def word(self) -> str:
        """`no_mismatch`, `explained`, `partly_explained`, `unexplained` or `not_judged`."""
        return self.verdict.verdict

    @property
    def sentence(self) -> str:
        """One plain sentence."""
        return self.verdict.sentence

    @property
    def page(self) -> str:
        """`report.html` as text: one page that needs no other file."""
        return self.files["report.html"]

    @property
    def ledger(self) -> list[dict]:
        """Every rule that decided something, on what, with its numbers and its sentence."""
        return json.loads(self.files["ledger.json"])

    @cached_property
    def improved(self) -> Vehicle:
        """The believed vehicle with values corrected and the established effects; `rotorid.simulate` flies it."""
        name = "improved_vehicle.yaml"
        return vehicle_of(parse_yaml(self.files[name], name), name)

    @cached_property
    def effects(self) -> pd.DataFrame:
        """A row a parameter of each effect that is said something of: id, status, share, value, interval, unit."""
        columns = ["effect", "status", "share", "parameter", "value", "low_95", "high_95", "unit", "p_value"]
        rows = []
        for effect in self.verdict.effects:
            own = [(p.symbol, p.value, *p.interval_95, p.unit) for p in effect.parameters]
            for symbol, *numbers, unit in own or [("", None, None, None, "")]:
                rows.append((effect.id, effect.status, effect.share, symbol, *numbers, unit, effect.p_value))
        return pd.DataFrame(rows, columns=columns)

    @cached_property
    def values(self) -> pd.DataFrame:
        """A row a believed value that the data contradict: believed, refitted, interval."""
        rows = {n: (v.believed, v.refitted, *v.interval_95) for n, v in self.verdict.parameters.items()}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["believed", "refitted", "low_95", "high_95"])

    @cached_property
    def errors(self) -> pd.DataFrame:
        """A row a channel: unit, noise, root mean square error before, with refitted values and after, held out."""
        rows = {
            name: (c.unit, c.noise_floor, c.rmse.held_out.before, c.rmse.held_out.refitted, c.rmse.held_out.after)
            for name, c in self.verdict.channels.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=["unit", "noise", "before", "refitted", "after"])

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """Recorded minus simulated: `run`, `time_s`, and each channel `_before`, `_refitted`, `_after`, in its unit.

        Channels of one run stand side by side on common instants; a channel that has no value there is NaN.
        """
        return residuals_of(self.analysis)

    def save(self, folder: str | Path) -> Path:
        """Write `verdict.json`, `report.html`, the vehicle and whatever else there is; returns the page's path."""
        write_texts({Path(folder) / name: text for name, text in self.files.items()})
        return Path(folder) / "report.html"

    def __repr__(self) -> str:
        return f"<rotorid verdict on {self.verdict.set}: {self.word}. {self.sentence}>"

    def _repr_html_(self) -> str:
        main = main_channel(self.analysis, self.verdict.locations, self.verdict.channels)
        shown = "".join(
            f'<td style="text-align:left;vertical-align:top;padding:.4em 1.2em .4em 0"><small>{escape(t.heading)}'
            f"</small><br><b>{pretty(t.large)}</b><br><small>{pretty(t.small)}</small></td>"
            for t in tiles(self.verdict, main)
        )
        doubts = (*(d.sentence for d in self.verdict.doubts), *self.verdict.warnings)
        parts = [
            f'<p style="font-size:1.15em"><b>{pretty(self.verdict.sentence)}</b></p>',
            *(f"<p>{pretty(text)}</p>" for text in doubts),
            f"<table><tr>{shown}</tr></table>",
        ]
        said = self.effects[self.effects["status"].isin(["established", "ambiguous", "suggested"])]
        for title, table in (("Effects", said), ("Wrong values", self.values)):
            if len(table):
                plain = table.fillna("").to_html(index=table is self.values, border=0, float_format="{:.4g}".format)
                parts.append(f"<p><b>{title}</b></p>{plain}")
        parts.append(self.errors.to_html(border=0, float_format="{:.3g}".format, na_rep="–"))
        return "".join(parts)


def residuals_of(analysis: Analysis) -> pd.DataFrame:
    """The residuals of an analysis as one table; see `Result.residuals`."""
    tables = []
    for run in dict.fromkeys(t.run for t in analysis.traces):
        own: dict[str, list[pd.DataFrame]] = {}
        for trace in (t for t in analysis.traces if t.run == run):
            columns = {f"{trace.channel}_{s}": getattr(trace, s) for s in ("before", "refitted", "after")}
            # Channels share a clock but for the last digits of a sum.
            own.setdefault(trace.channel, []).append(
                pd.DataFrame(columns, index=pd.Index(trace.time_s.round(6), name="time_s"))
            )
        channels = [pd.concat(parts) for parts in own.values()]
        channels = [part[~part.index.duplicated()] for part in channels]
        table = pd.concat(channels, axis=1).sort_index().reset_index()
        table.insert(0, "run", run)
        tables.append(table)
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["run", "time_s"])
