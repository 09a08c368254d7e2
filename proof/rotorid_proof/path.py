"""The path from command to thrust: what a verdict states of it, beside what is true.

    python -m rotorid_proof.path [--quick] [--cases 'imrc-brushless/*'] [--kept FOLDER] [--out TABLE.csv]
    python -m rotorid_proof.path --feedback development [--each 5] [--quick]

*Concealed speeds* are real flights whose rotor speeds were recorded and are taken out of the set before it is judged.
The truth is what the recorded speeds say, by a fit of its own (`recorded_path`): speed ∝ uⁿ Vᵖ, late by a first-order
lag and a delay. Prepared sets and their truths are kept in a folder. `--quick` stops where the fitted runs have
decided: three quarters of the time, before words are weighed once more and anything is delivered, so that a number may
differ.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.signal import lfilter

from rotorid.api import recording_set
from rotorid.recordings import RecordingSet, Run, read_set
from rotorid.recordings import columns as c
from rotorid.recordings.files import write_set
from rotorid.report.deliver import analysis_of, verdict_of
from rotorid_proof.concealed import cases, drawn
from rotorid_proof.concealed.write import write_set as write_drawn
from rotorid_proof.decisions.collect import selection_of
from rotorid_proof.intervals import wilson
from rotorid_proof.row_by_row import as_read
from rotorid_proof.score import claims_of, equivalents

FINEST = {"elasticity": 0.0, "late_s": 0.005, "voltage": 0.0}
"""And what is never too far off: a sample."""
QUANTITIES = {"elasticity": (0.2, True), "late_s": (0.35, True), "voltage": (0.2, False)}
"""What is asked: n of speed ∝ uⁿ about the hover command, lag with delay (s), p of speed ∝ Vᵖ. Each with how far off a
right number may be, and whether that is a share of the truth."""
SURE = 0.5
"""Two halves of the recorded speeds must agree within this share of what is allowed; else they are no truth."""


@dataclass(frozen=True)
class Number:
    """A number with its 95 % interval, as far as it has one."""

    value: float
    low: float | None = None
    high: float | None = None

    def holds(self, true: float) -> bool | None:
        """Whether the interval holds what is true; None without an interval."""
        return None if self.low is None or self.high is None else self.low <= true <= self.high


# What a verdict states --------------------------------------------------------------------------------------------


def stated_path(verdict: Mapping[str, Any]) -> dict[str, Number | None]:
    """What `command_path` of a verdict states of each of QUANTITIES, of the speed; None where it states nothing."""
    known = {p["symbol"]: (p["value"], *p["interval_95"]) for p in verdict.get("command_path", ())}
    halves = {"elasticity": ("e_u", 0.5), "late_s": ("tau", 1.0), "voltage": ("e_V", 0.5)}
    return {q: Number(*(share * x for x in known[s])) if s in known else None for q, (s, share) in halves.items()}


# What the recorded speeds say -------------------------------------------------------------------------------------


def recorded_path(runs: Sequence[Run], count: int) -> dict[str, Number | None]:
    """The truth: a fit to recorded rotor speeds, with halves of the recording as its interval.

    ω_i = g_i uⁿ (V/V_0)ᵖ, late by a first-order lag and a delay; g of each rotor (and run, where one has no voltage).
    Without voltage p stands for nothing. None where the halves disagree by more than SURE of what is allowed, or where
    samples are too far apart for a lag.
    """
    parts = [runs[::2], runs[1::2]] if len(runs) > 1 else [[_cut(runs[0], *half)] for half in ((0, 0.5), (0.5, 1))]
    whole, *halves = (_recorded_fit(own, count) for own in (list(runs), *parts))
    out: dict[str, Number | None] = {}
    for k, (name, (allowed, relative)) in enumerate(QUANTITIES.items()):
        value, two = whole[k], [h[k] for h in halves]
        reach = SURE * allowed * (abs(value) if relative else 1.0)
        sure = np.all(np.isfinite([value, *two])) and max(value, *two) - min(value, *two) <= reach
        out[name] = Number(float(value), float(min(value, *two)), float(max(value, *two))) if sure else None
    return out


def _recorded_fit(runs: Sequence[Run], count: int) -> tuple[float, float, float]:
    """n, lag + delay (s) and p of recorded speeds; NaN for what they cannot say."""
    own = [_signals(run, count) for run in runs]
    u0 = np.nanmean(np.concatenate([s["u"].ravel() for s in own]))
    known = [s["v"] is not None for s in own]
    v0 = np.mean(np.concatenate([s["v"] for s in own if s["v"] is not None])) if any(known) else 1.0
    w0 = np.mean(np.concatenate([speed for s in own for _, speed in s["w"]]))
    groups = np.arange(len(own)) if not all(known) else np.zeros(len(own), int)
    gains = count * (groups.max() + 1)

    def left(q: np.ndarray) -> np.ndarray:
        n, lag, delay, p = q[0], 0.01 * q[1], 0.01 * q[2], q[3]
        out = []
        for s, group in zip(own, groups, strict=True):
            steady = (np.maximum(s["u"], 1e-4) / u0) ** n
            if s["v"] is not None:
                steady = steady * ((s["v"] / v0) ** p)[:, None]
            late = _late(steady, s["dt"], lag, delay)
            for i, (rows, speed) in enumerate(s["w"]):
                out.append(np.clip(q[4 + count * group + i] * late[rows, i] - speed / w0, -0.3, 0.3))
        return np.concatenate(out)

    start = np.array([0.8, 4.0, 0.4, 0.5, *np.ones(gains)])
    low, high = [0.0, 0.1, 0.0, -1.0, *0.5 * np.ones(gains)], [4.0, 40.0, 6.0, 3.0, *2 * np.ones(gains)]
    x = least_squares(left, start, bounds=(low, high), loss="soft_l1", f_scale=0.02).x
    late = 0.01 * (x[1] + x[2])
    slowest = max(max(s["dt"], *(np.median(np.diff(rows)) * s["dt"] for rows, _ in s["w"])) for s in own)
    slowest = max(slowest, *(s["every_s"] for s in own))
    inside = low[3] + 1e-3 < x[3] < high[3] - 1e-3
    return float(x[0]), float(late) if slowest < late else np.nan, float(x[3]) if any(known) and inside else np.nan


def _signals(run: Run, count: int) -> dict[str, Any]:
    """Commands (n, k) and voltage on an even grid, and each rotor's speeds at the rows where one was read."""
    dt = float(np.median(np.diff(run.time_s)))
    every = max(1, round(0.002 / dt))
    grid = np.arange(run.time_s[0], run.time_s[-1], dt)[::every]

    def on(values: np.ndarray) -> np.ndarray:
        there = np.isfinite(values)
        return np.interp(grid, run.time_s[there], values[there])

    names = next(n for n in _commands(count) if run.has(*n))
    voltage = run.column(c.BATTERY_VOLTAGE) if run.has(c.BATTERY_VOLTAGE) else np.array([np.nan])
    given = run.time_s[np.isfinite(run.column(names[0]))]
    speeds = []
    for name in c.rotor_columns("rotor_speed", count):
        speed = run.column(name)
        # A reading of a third of the usual is one that was lost, not a rotor.
        rows = np.isfinite(speed) & (speed > 0.3 * np.nanmax(np.abs(speed)))
        at = np.searchsorted(grid, run.time_s[rows][:: 1 if rows.mean() < 0.5 else every])
        value = speed[rows][:: 1 if rows.mean() < 0.5 else every]
        inside = (at > _SETTLED_S / (dt * every)) & (at < len(grid))
        speeds.append((at[inside], value[inside]))
    return {
        "u": np.column_stack([on(run.column(n)) for n in names]),
        "v": on(voltage) if np.isfinite(voltage).sum() > 1 else None,
        "w": speeds,
        "dt": dt * every,
        "every_s": float(np.median(np.diff(given))),
    }


_SETTLED_S = 0.2
"""After which the state of a lag at a run's start no longer matters."""


def _commands(count: int) -> tuple[tuple[str, ...], ...]:
    return c.rotor_columns("throttle", count), c.rotor_columns("rotor_command", count)


def _late(steady: np.ndarray, dt: float, lag: float, delay: float) -> np.ndarray:
    """Columns late by a delay and a first-order lag; a command holds until the next."""
    t = np.arange(len(steady)) * dt
    late = np.column_stack([np.interp(t - delay, t, x) for x in steady.T])
    a = np.exp(-dt / lag)
    return lfilter([0, 1 - a], [1, -a], late, axis=0, zi=late[:1])[0]


def _cut(run: Run, start: float, stop: float) -> Run:
    """The part of a run between two shares of its time."""
    t = run.time_s
    share = (t - t[0]) / (t[-1] - t[0])
    return Run(run.name, run.table[(share >= start) & (share <= stop)].reset_index(drop=True))


# Concealed speeds -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """Flights of one set with commands and recorded speeds."""

    name: str
    """Set, command (`throttle` or `speed`) and part: `imrc-brushless/throttle/whole`."""
    recordings: RecordingSet


def cases_of(recordings: RecordingSet) -> list[Case]:
    """A set with each kind of command that it holds, whole and in parts; none without commands and recorded speeds."""
    count = recordings.vehicle.rotor_count
    out = []
    for kind, own in _by_command(recordings, count).items():
        runs = [r for r in own if r.has(*c.rotor_columns("rotor_speed", count))]
        for part, chosen in _parts(runs).items() if runs else ():
            name = f"{recordings.name}/{kind}/{part}"
            out.append(Case(name, replace(recordings, name=name.replace("/", "-"), runs=tuple(chosen), held_out=None)))
    return out


def _by_command(recordings: RecordingSet, count: int) -> dict[str, list[Run]]:
    """Runs with throttles alone and with commanded speeds alone; a PWM that rides along is a throttle."""
    throttles, commands = _commands(count)
    out: dict[str, list[Run]] = {}
    for run in recordings.runs:
        table = run.table.rename(columns={f"pwm_fraction_{i + 1}": t for i, t in enumerate(throttles)})
        for kind, names, others in (("throttle", throttles, commands), ("speed", commands, throttles)):
            if set(names) <= set(table):
                kept = [n for n in table if n not in others]
                out.setdefault(kind, []).append(Run(run.name, table[kept]))
    return out


def _parts(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Halves and the liveliest two thirds of a set's runs, single runs of a pair, halves of a long single run."""
    parts = {"whole": list(runs)}
    if len(runs) >= 6:
        lively = sorted(runs, key=lambda r: -float(np.nanstd(r.column("specific_force_z_m_s2"))))[: 2 * len(runs) // 3]
        half = len(runs) // 2
        parts |= {"first": runs[:half], "last": runs[half:], "even": runs[1::2], "odd": runs[::2]}
        parts["lively"] = sorted(lively, key=lambda r: r.name)
    elif len(runs) > 1:
        parts |= {r.name: [r] for r in runs}
    for run in runs:
        if run.time_s[-1] - run.time_s[0] > 40.0:
            parts |= {f"{run.name}-{name}": [_cut(run, *ends)] for name, ends in (("a", (0, 0.5)), ("b", (0.5, 1)))}
    return parts


def without_speeds(case: Case) -> RecordingSet:
    """The set as it is judged: no recorded speeds, no column but the contract's."""
    count = case.recordings.vehicle.rotor_count
    gone = c.rotor_columns("rotor_speed", count)

    def kept(run: Run) -> Run:
        return Run(run.name, run.table[[n for n in run.table if n not in gone and c.is_known(n)]])

    return replace(case.recordings, runs=tuple(kept(r) for r in case.recordings.runs))


@dataclass(frozen=True)
class Row:
    """One quantity of one set."""

    set: str
    quantity: str
    true: float | None
    """None: the recorded speeds do not say it, and nothing is asked."""
    true_low: float | None
    true_high: float | None
    """Of halves of the recording."""
    stated: float | None
    low_95: float | None
    high_95: float | None
    status: str
    """`right`, `wrong` or `silent`; `unknown` without a truth."""
    held: bool | None
    """Whether the interval holds the truth."""
    word: str
    seconds: float
    judged_by: str = ""


def status_of(quantity: str, true: Number | None, stated: Number | None) -> str:
    """`right`, `wrong` or `silent`, or `unknown` without a truth."""
    if true is None:
        return "unknown"
    if stated is None:
        return "silent"
    allowed, relative = QUANTITIES[quantity]
    reach = max(FINEST[quantity], allowed * (abs(true.value) if relative else 1.0))
    return "right" if abs(stated.value - true.value) <= reach else "wrong"


def rows_of_case(
    name: str,
    truth: Mapping[str, Number | None],
    stated: Mapping[str, Number | None],
    word: str,
    seconds: float,
) -> list[Row]:
    """A row each quantity."""
    out = []
    for quantity in QUANTITIES:
        true, said = truth[quantity], stated[quantity]
        out.append(
            Row(
                name,
                quantity,
                *((None,) * 3 if true is None else (true.value, true.low, true.high)),
                *((None,) * 3 if said is None else (said.value, said.low, said.high)),
                status_of(quantity, true, said),
                said.holds(true.value) if true and said else None,
                word,
                round(seconds, 1),
            )
        )
    return out


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """A row each quantity and one of all: of the sets `asked` those `claimed`, `right`, whose interval `held`."""
    out = []
    for quantity in (*QUANTITIES, "all"):
        own = rows[(rows["status"] != "unknown") & ((rows["quantity"] == quantity) | (quantity == "all"))]
        claimed = own[own["status"] != "silent"]
        right, held = int((claimed["status"] == "right").sum()), claimed["held"].map(str).tolist()
        low, high = wilson(right, len(claimed))
        out.append(
            {
                "quantity": quantity,
                "asked": len(own),
                "claimed": len(claimed),
                "right": right,
                "right_low_95": round(low, 3),
                "right_high_95": round(high, 3),
                "held": held.count("True"),
                "with_interval": held.count("True") + held.count("False"),
                "silent": len(own) - len(claimed),
            }
        )
    return pd.DataFrame(out)


def page_table(rows: pd.DataFrame) -> str:
    """For the proof's page: a line a set, what recorded speeds say and what is stated without; a line of counts."""
    heads = "flights | n | stated | lag + delay, ms | stated | p | stated"
    lines = [f"| {heads} |", "| --- |" + " ---: |" * 6]

    def number(x: float, unit: float, form: str) -> str:
        return "" if pd.isna(x) else form.format(unit * x)

    def stated(row: Any, unit: float, form: str) -> str:
        low, high = number(row.low_95, unit, form), number(row.high_95, unit, form)
        reach = f" ({low} to {high})" if low and high else ""
        mark = {"right": "", "wrong": " ✗"}.get(row.status, "")
        return number(row.stated, unit, form) + reach + mark if number(row.stated, unit, form) else "–"

    forms = {"elasticity": (1.0, "{:.2f}"), "late_s": (1e3, "{:.0f}"), "voltage": (1.0, "{:.2f}")}
    for name, own in rows.groupby("set", sort=False):
        cells = [name.replace("/", ", ")]
        for quantity, (unit, form) in forms.items():
            row = next(own[own["quantity"] == quantity].itertuples())
            known = row.status != "unknown"
            cells += [number(row.true, unit, form) if known else "", stated(row, unit, form) if known else ""]
        lines.append(f"| {' | '.join(cells)} |")
    counts = summary(rows).set_index("quantity")
    cells = ["right of claimed of asked"]
    for quantity in forms:
        count = counts.loc[quantity, ["right", "claimed", "asked"]].astype(int)
        cells += ["", f"{count['right']} of {count['claimed']} of {count['asked']}"]
    return "\n".join([*lines, f"| {' | '.join(cells)} |"]) + "\n"


# Drawn flights in gusts -------------------------------------------------------------------------------------------


def feedback_names(date: str, each: int) -> list[str]:
    """Names of drawn flights, `each` of a family, for development or for a commit's hash."""
    return [f"feedback/{family}/{date}/{k:03d}" for k in range(each) for family in drawn.SIMULATORS["feedback"]]


def feedback_rows(item: tuple[str], quick: bool = False) -> list[dict[str, Any]]:
    """The row of a drawn flight, in a list."""
    return [feedback_row(item[0], quick)]


def feedback_row(name: str, quick: bool = False) -> dict[str, Any]:
    """A drawn flight: names and values that are wrong, and each quantity, true and stated.

    Where there is no curve, no lag or no sag, a claim of it is a wrong name, whatever its number.
    """
    case = cases.named(name)
    recording, truth, _ = drawn.make(name, case.seed)
    verdict, seconds = judged(as_read(recording, write_drawn, case.set_name), quick)
    speeds = any("rotor_command_1_rad_s" in t for t in recording.runs.values())
    stated = stated_path(verdict)
    near = equivalents(truth).values()
    fair = frozenset(truth["fair"]).union(*near)
    claims = claims_of({"effects": [{"p_value": None, **e} for e in verdict["effects"]]})
    row = {
        "set": name,
        "recorded": f"{'speed' if speeds else 'throttle'} {truth['grade']}",
        "claims": len(claims),
        "wrong_names": "; ".join(c.id for c in claims if not c.members & fair),
        "wrong_values": "; ".join(verdict.get("parameters", {})),
    }
    for quantity, true in truth["path"].items():
        if quantity in QUANTITIES:
            known, said = None if true is None else Number(true), stated[quantity]
            status = status_of(quantity, known, said)
            row |= {f"{quantity}_true": true, f"{quantity}_stated": said and said.value, f"{quantity}_status": status}
            row[f"{quantity}_held"] = said.holds(true) if said and known else None
    row |= {
        "word": "; ".join(filter(None, [verdict["verdict"], verdict.get("failed", "")])),
        "seconds": round(seconds, 1),
    }
    numbers = (f"{q} {row[f'{q}_true']} {row[f'{q}_stated']} {row[f'{q}_status']}" for q in QUANTITIES)
    wrong = " ".join(filter(None, (row["wrong_names"], row["wrong_values"])))
    said = "; ".join(numbers) + (f"; WRONG {wrong}" if wrong else "")
    print(f"{name} ({row['recorded']}): {said} | {row['word']} {seconds:.0f} s", flush=True)
    return row


def feedback_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Drawn flights with a wrong name or value, and of each quantity how many are claimed, right and held."""
    # Rows that were kept are read back with nothing in place of no name.
    wrong = [int(rows[key].astype(object).fillna("").astype(bool).sum()) for key in ("wrong_names", "wrong_values")]
    out = [
        {"what": what, "count": count, "of": len(rows), **_interval(count, len(rows))}
        for what, count in zip(("sets with a wrong name", "sets with a wrong value"), wrong, strict=True)
    ]
    for quantity in QUANTITIES:
        for there in (True, False):
            neutral = 1.0 if quantity == "elasticity" else 0.0
            own = rows[(rows[f"{quantity}_true"].fillna(neutral) != neutral) == there]
            said = own[own[f"{quantity}_stated"].notna()]
            right, what = (
                int((said[f"{quantity}_status"] == "right").sum()),
                quantity + ("" if there else ", none there"),
            )
            out.append(
                {"what": f"{what}: claimed", "count": len(said), "of": len(own), **_interval(len(said), len(own))}
            )
            if there:
                held = int((said[f"{quantity}_held"].map(str) == "True").sum())
                out.append({"what": f"{what}: right", "count": right, "of": len(said), **_interval(right, len(said))})
                out.append({"what": f"{what}: held", "count": held, "of": len(said), **_interval(held, len(said))})
    return pd.DataFrame(out)


def _interval(count: int, of: int) -> dict[str, float]:
    low, high = wilson(count, of)
    return {"low_95": round(low, 3), "high_95": round(high, 3)}


# Judging ----------------------------------------------------------------------------------------------------------


class _Decided(Exception):
    """The fitted runs have decided, and nobody asks for more."""


def judged(recordings: RecordingSet, quick: bool = False) -> tuple[dict[str, Any], float]:
    """Verdict of a set, and the processor's seconds; `failed` in place of a verdict that is none.

    `quick`: what the fitted runs decide, before anything is delivered.
    """
    start = time.process_time()
    seen: list[dict[str, Any]] = []

    def stop(decided: Any) -> None:
        path = decided.found.chain.result.about_hover if decided.found.chain else {}
        numbers = ((k, v, [v - 1.96 * sd, v + 1.96 * sd]) for k, (v, sd, _) in path.items())
        stated = [{"symbol": k, "value": v, "interval_95": reach} for k, v, reach in numbers]
        seen.append({**selection_of(decided), "command_path": stated})
        raise _Decided

    try:
        if quick:
            analysis_of(recordings, watch=stop)
        analysis = analysis_of(recordings)
        verdict = json.loads(verdict_of(analysis).text())
    except _Decided:
        verdict = {"verdict": "", **seen[0]}
    except Exception as error:  # any fault of the stage is a result here
        verdict = {"verdict": "stopped", "failed": f"{type(error).__name__}: {error}", "effects": []}
    return verdict, time.process_time() - start


def prepared(
    folder: Path, sources: Callable[[], Sequence[RecordingSet]], code: str = ""
) -> list[tuple[str, Path, dict]]:
    """Cases below `folder`: name, folder of the set and truth.

    They are made where there are none yet, or where those were made by another `code` than the one given.
    """
    index = folder / "truths.json"
    known = json.loads(index.read_text(encoding="utf-8")) if index.is_file() else None
    if known is None or code not in ("", known["code"]):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        found = []
        for recordings in sources():
            for case in cases_of(recordings):
                truth = recorded_path(case.recordings.runs, case.recordings.vehicle.rotor_count)
                if any(truth.values()):
                    place = write_set(without_speeds(case), folder)
                    said = {q: None if t is None else asdict(t) for q, t in truth.items()}
                    found.append([case.name, place.name, said])
        known = {"code": code, "cases": found}
        index.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    return [
        (name, folder / place, {q: None if t is None else Number(**t) for q, t in truth.items()})
        for name, place, truth in known["cases"]
    ]


def concealed_rows(item: tuple[str, Path, dict], quick: bool = False) -> list[dict[str, Any]]:
    """Rows of a prepared set, one a quantity."""
    name, folder, truth = item
    verdict, seconds = judged(read_set(folder), quick)
    word = "; ".join(filter(None, [verdict["verdict"], verdict.get("failed", "")]))
    own = rows_of_case(name, truth, stated_path(verdict), word, seconds)
    print(line_of(own), flush=True)
    return [asdict(row) for row in own]


def kept_rows(items: Sequence[tuple], rows_of: Callable, kept: Path, code: str) -> pd.DataFrame:
    """Rows of every item (its first part is its name), each written to the CSV `kept` as it comes.

    What was judged by the same `code` is not judged again.
    """
    kept.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_csv(kept, keep_default_na=False, na_values=[""]).to_dict("records") if kept.is_file() else []
    rows = [r for r in rows if str(r["judged_by"]) == code]
    for item in items:
        if item[0] not in {r["set"] for r in rows}:
            rows += [{**row, "judged_by": code} for row in rows_of(item)]
            pd.DataFrame(rows).to_csv(kept, index=False)
    return pd.DataFrame([r for item in items for r in rows if r["set"] == item[0]])


def line_of(rows: Sequence[Row]) -> str:
    """One line on the screen: true and stated."""
    words = {"elasticity": ("n", 1.0, "{:.2f}"), "late_s": ("late", 1e3, "{:.0f} ms"), "voltage": ("p", 1.0, "{:.2f}")}
    said = []
    for row in rows:
        name, unit, form = words[row.quantity]
        true, stated, low, high = (
            "–" if x is None else form.format(unit * x) for x in (row.true, row.stated, row.low_95, row.high_95)
        )
        said.append(f"{name} true {true} stated {stated} ({low} to {high}) {row.status}")
    return f"{rows[0].set}: {'; '.join(said)} | {rows[0].word} {rows[0].seconds:.0f} s"


LOGS = (
    ("shortLog", "logs/betaflight/shortLog.BFL", "five-inch"),
    ("ekf_failure", "px4-flight-review/ekf_failure.ulg", "x500"),
)
"""Logs with throttles and rotor speeds that may lie next to the public sets: name, path, template. Their masses are not
known; an elasticity does not hang on it."""


def public_sets(recordings: Path, files: Path | None) -> list[RecordingSet]:
    """Imported public sets below `recordings`, and sets of the LOGS that are in the folder `files`."""
    found = [read_set(p) for p in sorted(recordings.iterdir()) if (p / "vehicle.yaml").is_file()]
    found = [f for f in found if f.vehicle.kind == "flight"]
    for name, path, like in LOGS:
        if files is not None and (files / path).is_file():
            found.append(recording_set(files / path, name=name, mass_kg=1.0, like=like))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=Path, default=Path("results/recordings"), help="imported public sets")
    parser.add_argument("--kept", type=Path, default=Path(tempfile.gettempdir()) / "rotorid-concealed-speeds")
    parser.add_argument("--cases", default="*", help="shell patterns on names, comma-separated")
    parser.add_argument("--quick", action="store_true", help="stop where the fitted runs have decided")
    parser.add_argument("--feedback", metavar="DATE", help="drawn flights in gusts instead: development, or a hash")
    parser.add_argument("--each", type=int, default=5, help="of each family of drawn flights")
    parser.add_argument("--out", type=Path, help="the table as CSV; what is in it by the same --code is kept")
    parser.add_argument("--code", default=str(time.time()), help="of what judges")
    args = parser.parse_args(argv)
    files = os.environ.get("ROTORID_PUBLIC_DATA")
    with tempfile.TemporaryDirectory() as place:
        if args.feedback:
            items, rows_of, summed = (
                [(n,) for n in feedback_names(args.feedback, args.each)],
                feedback_rows,
                feedback_summary,
            )
        else:
            items = prepared(args.kept, lambda: public_sets(args.recordings, files and Path(files)))
            rows_of, summed = concealed_rows, summary
        chosen = [item for item in items if any(fnmatch(item[0], pattern) for pattern in args.cases.split(","))]
        if not chosen:
            parser.error(f"no set fits {args.cases!r}; there are {', '.join(item[0] for item in items) or 'none'}")
        found = kept_rows(chosen, partial(rows_of, quick=args.quick), args.out or Path(place) / "rows.csv", args.code)
    print(summed(found).to_string(index=False))
    if not args.feedback and len(found):
        print(page_table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
