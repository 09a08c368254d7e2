"""Residuals of a verdict as files of other viewers: MCAP with layouts for Foxglove and PlotJuggler, and rerun's `.rrd`.

A topic `/RUN/CHANNEL` holds JSON messages with the residual before, refitted and after, `model` (what the improved
model explains of the residual: before less after) and what each effect found contributes, one by one.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Analysis, by_channel
from rotorid.mismatch.decide.sizes import segments_of, shares

_COLOURS = ("#d55e00", "#e69f00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#000000", "#f0e442")
_NO_MCAP = "MCAP files need mcap, which is not installed: pip install 'rotorid[mcap]'"


@dataclass(frozen=True)
class _Series:
    """One stretch of a channel of a run."""

    topic: str
    unit: str
    time_s: np.ndarray
    fields: dict[str, np.ndarray]
    """`before`, `refitted`, `after`, `model`, and each effect by its id; (n,) each, in the unit."""


def series_of(analysis: Analysis) -> list[_Series]:
    """Every channel of every run, in the order of time."""
    added = shares(analysis, segments_of(analysis), by_channel(analysis.traces))
    seen: dict[str, int] = {}
    out = []
    for trace in analysis.traces:
        place = seen.get(trace.channel, 0)
        seen[trace.channel] = place + 1
        fields = {name: getattr(trace, name) for name in ("before", "refitted", "after")}
        fields["model"] = trace.before - trace.after
        for number, channels in added.items():
            parts = channels.get(trace.channel, [])
            if place < len(parts):
                name = analysis.findings[number].id
                fields[name] = fields.get(name, 0.0) + parts[place]
        out.append(_Series(f"/{plain(trace.run)}/{plain(trace.channel)}", trace.unit, trace.time_s, fields))
    return sorted(out, key=lambda s: (s.topic, s.time_s[0] if len(s.time_s) else 0.0))


def plain(name: str) -> str:
    """A name that viewers take as part of a topic."""
    return re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "run"


def write_mcap(series: Sequence[_Series], path: Path) -> None:
    """Write the series as MCAP with JSON messages, in the order of time; InputError without the package `mcap`."""
    if find_spec("mcap") is None:
        raise InputError(f"{path}: {_NO_MCAP}")
    from mcap.writer import Writer

    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="rotorid")
        channels, messages = {}, []
        for one in series:
            if one.topic not in channels:
                fields = {name: {"type": "number", "description": f"{name}, {one.unit}"} for name in one.fields}
                schema = json.dumps({"type": "object", "title": one.topic, "properties": fields}).encode()
                name = f"rotorid.residual ({one.unit})"
                kind = writer.register_schema(name=name, encoding="jsonschema", data=schema)
                channels[one.topic] = writer.register_channel(topic=one.topic, message_encoding="json", schema_id=kind)
            for k, now in enumerate(one.time_s):
                values = {name: float(v[k]) for name, v in one.fields.items() if np.isfinite(v[k])}
                messages.append((round(now * 1e9), channels[one.topic], json.dumps(values)))
        first = min((m[0] for m in messages), default=0)
        for stamp, channel, text in sorted(messages, key=lambda m: m[:2]):
            when = stamp - min(first, 0)  # MCAP counts from 0 up
            writer.add_message(channel_id=channel, log_time=when, publish_time=when, data=text.encode())
        writer.finish()


def topics_of(series: Sequence[_Series]) -> dict[str, list[str]]:
    """To each topic its fields."""
    out: dict[str, list[str]] = {}
    for one in series:
        own = out.setdefault(one.topic, [])
        own += [name for name in one.fields if name not in own]
    return out


def foxglove_layout(series: Sequence[_Series]) -> str:
    """A layout of Foxglove: a tab a run, in it a plot a channel with its fields."""
    panels: dict[str, dict] = {}
    tabs: dict[str, list[str]] = {}
    for number, (topic, fields) in enumerate(topics_of(series).items()):
        name = f"Plot!{number:07d}"
        paths = [
            {"value": f"{topic}.{field}", "enabled": True, "timestampMethod": "receiveTime", "label": field,
             "color": _COLOURS[k % len(_COLOURS)]}
            for k, field in enumerate(fields)
        ]  # fmt: skip
        panels[name] = {
            "title": topic, "paths": paths, "showXAxisLabels": True, "showYAxisLabels": True, "showLegend": True,
            "legendDisplay": "floating", "isSynced": True, "xAxisVal": "timestamp",
        }  # fmt: skip
        tabs.setdefault(topic.split("/")[1], []).append(name)
    pages = [{"title": run, "layout": _stacked(names)} for run, names in tabs.items()]
    panels["Tab!0000000"] = {"activeTabIdx": 0, "tabs": pages}
    content = {"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": "Tab!0000000"}
    return json.dumps(content, indent=1) + "\n"


def _stacked(names: Sequence[str]):
    """Panels one above the other, as Foxglove nests them: halves of halves."""
    if len(names) == 1:
        return names[0]
    half = len(names) // 2
    return {"direction": "column", "first": _stacked(names[:half]), "second": _stacked(names[half:])}


def plotjuggler_layout(series: Sequence[_Series]) -> str:
    """A layout of PlotJuggler for the MCAP: tabs of a few plots, a plot a channel."""
    plots_a_tab = 3
    topics = list(topics_of(series).items())
    tabs = []
    for run in dict.fromkeys(topic.split("/")[1] for topic, _ in topics):
        own = [pair for pair in topics if pair[0].split("/")[1] == run]
        for start in range(0, len(own), plots_a_tab):
            part = own[start : start + plots_a_tab]
            sizes = ";".join(f"{1 / len(part):.6f}" for _ in part)
            areas = "".join(_plot(topic, fields) for topic, fields in part)
            name = quoteattr(f"{run} {start // plots_a_tab + 1}")
            tabs.append(
                f"""  <Tab containers="1" tab_name={name}>
   <Container>
    <DockSplitter orientation="-" count="{len(part)}" sizes="{sizes}">
{areas}    </DockSplitter>
   </Container>
  </Tab>
"""
            )
    return f"""<?xml version='1.0' encoding='UTF-8'?>
<root>
 <tabbed_widget name="Main Window" parent="main_window">
{"".join(tabs)}  <currentTabIndex index="0"/>
 </tabbed_widget>
 <use_relative_time_offset enabled="1"/>
</root>
"""


def _plot(topic: str, fields: Sequence[str]) -> str:
    curves = "".join(
        f"       <curve name={quoteattr(f'{topic}/{field}')} color={quoteattr(_COLOURS[k % len(_COLOURS)])}/>\n"
        for k, field in enumerate(fields)
    )
    return f"""     <DockArea name={quoteattr(topic)}>
      <plot style="Lines" mode="TimeSeries" flip_x="false" flip_y="false">
       <limitY/>
{curves}      </plot>
     </DockArea>
"""


def write_rrd(series: Sequence[_Series], path: Path) -> None:
    """Write the series for rerun, an entity a field; needs the package `rerun`."""
    import rerun

    recording = rerun.RecordingStream("rotorid")
    recording.save(str(path))
    for one in series:
        when = rerun.TimeColumn("time", duration=one.time_s)
        for name, values in one.fields.items():
            recording.send_columns(
                f"{one.topic}/{name}", indexes=[when], columns=rerun.Scalars.columns(scalars=np.asarray(values, float))
            )
    recording.flush()


def write_viewers(analysis: Analysis, folder: Path) -> list[Path]:
    """Write `series.mcap` with its two layouts, and `series.rrd`, as far as their packages are installed."""
    from rotorid.io.text.writing import all_or_none

    series, written = series_of(analysis), []
    if find_spec("mcap") is not None:
        texts = {"series.foxglove.json": foxglove_layout(series), "series.plotjuggler.xml": plotjuggler_layout(series)}
        paths = [folder / "series.mcap", *(folder / name for name in texts)]
        with all_or_none(*paths) as (data, *parts):
            write_mcap(series, data)
            for part, text in zip(parts, texts.values(), strict=True):
                part.write_text(text, encoding="utf-8")
        written += paths
    if find_spec("rerun") is not None:
        with all_or_none(folder / "series.rrd") as (part,):
            write_rrd(series, part)
        written.append(folder / "series.rrd")
    return written
