"""The clock of a table, battery and temperature."""

from __future__ import annotations

import numpy as np

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.draft import (
    RATES_HZ,
    Draft,
)
from rotorid.recordings.importers.mapping import OPEN
from rotorid.recordings.importers.units import UNITS


def guess_time(draft: Draft) -> None:
    name = named.scalar(draft.table.columns, "time")
    if name is None:
        draft.put(
            "time", [OPEN], "", "no column is named as a time, and without one nothing can be imported", unit=OPEN
        )
        return
    values = draft.table[name].to_numpy(float)
    steps = np.diff(values[np.isfinite(values)])
    steps = steps[steps > 0]
    usual = float(np.median(steps)) if len(steps) else np.nan
    fits = [u for u, f in UNITS["time"].items() if RATES_HZ[0] <= 1 / (usual * f) <= RATES_HZ[1]] if usual > 0 else []
    stated = named.time_unit(name)
    seen = f"its usual step is {usual:.6g}"
    if stated and (stated in fits or not fits):
        unit, evidence, question = stated, f"by its name; {seen}", ""
    elif not stated and len(fits) == 1:
        unit, evidence, question = fits[0], f"by its name; {seen}, which in {fits[0]} is a rate of recording", ""
    else:
        unit, evidence = OPEN, f"by its name; {seen}"
        question = f"its name says {stated}, its step {' or '.join(fits)}" if stated else "its unit is not clear"
    draft.put("time", [name], evidence, question, unit=unit)
    if unit != OPEN and len(steps):
        _set_clock(draft, values * UNITS["time"][unit])


def _set_clock(draft: Draft, time_s: np.ndarray) -> None:
    """Keep the rows in which the clock moves on; no comparison is made without enough of them."""
    latest = np.maximum.accumulate(np.where(np.isfinite(time_s), time_s, -np.inf))
    on = np.isfinite(time_s) & (np.concatenate([[-np.inf], latest[:-1]]) < time_s)
    if on.sum() < 20:
        return
    draft.table, draft.time_s = draft.table[on].reset_index(drop=True), time_s[on]
    span, usual = draft.time_s[-1] - draft.time_s[0], float(np.median(np.diff(draft.time_s)))
    if span > 1e4 * max(by.STEP_S, usual):  # hours, or a clock that jumps
        draft.time_s = None
        return
    draft.instants = by.steps_of(draft.time_s)


def guess_scalar(draft: Draft, quantity: str) -> None:
    name = named.scalar(draft.free(), quantity)
    if name is None:
        return
    values = draft.table[name].to_numpy(float)
    if not np.isfinite(values).any():
        return
    middle = float(np.nanmedian(np.abs(values)))
    if quantity == "battery_voltage":
        unit = "V" if middle < 60 else "dV" if middle < 600 else "cV" if middle < 3000 else "mV"
    elif quantity == "battery_current":
        unit = "A" if middle < 200 else "cA" if middle < 2e4 else "mA"
    else:
        unit = "degC"
    draft.put(quantity, [name], f"by its name; its median is {middle:.4g}", unit=unit)
