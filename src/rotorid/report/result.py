"""A verdict as an object: its sentence, tables, the improved vehicle, its files, and how a notebook shows it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path

import pandas as pd

from rotorid.io.text.files import parse_yaml
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.tell.tiles import tiles
from rotorid.mismatch.tell.verdict import Verdict, main_channel
from rotorid.recordings import Vehicle, vehicle_of
from rotorid.report.page.make import pretty

FILES = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
"""Files that every verdict has."""
OTHERS = ("conditions.yaml", "instruments.yaml")
"""Files that it has where there is something to write."""


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
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        return folder / "report.html"

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
