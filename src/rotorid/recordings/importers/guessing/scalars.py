"""The clock of a table, battery and temperature."""

from __future__ import annotations

import numpy as np

from rotorid.recordings.importers.clean import join_rows
from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.draft import (
    RATES_HZ,
    Draft,
)
from rotorid.recordings.importers.mapping import CHANNELS, OPEN
from rotorid.recordings.importers.units import UNITS, converted, stated

USUAL = {"voltage": (60.0, 2.5, 60.0), "current": (60.0, 0.0, 150.0), "temperature": (60.0, -30.0, 130.0)}
"""To a kind the largest median that is plainly in the contract's unit, and between what limits it lies, V, A, °C."""


def guess_time(draft: Draft) -> None:
    name = named.scalar(draft.table.columns, "time")
    if name is None:
        draft.put(
            "time", [OPEN], "", "no column is named as a time, and without one nothing can be imported", unit=OPEN
        )
        return
    draft.table = join_rows(draft.table, name)
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
    middle = float(np.nanmedian(values if quantity == "temperature" else np.abs(values)))
    kind = CHANNELS[quantity][0]
    said, fits = stated(name, kind), _fitting(kind, middle)
    evidence, question = f"by its name; its median is {middle:.4g}", ""
    if said and (said in fits or not fits):
        unit = said
    elif said:
        unit, question = OPEN, f"its name says {said}, its median of {middle:.4g} {' or '.join(fits)}"
    elif len(fits) == 1:
        unit = fits[0]
    else:
        unit = OPEN
        question = f"its unit is not clear: a median of {middle:.4g} can be {' or '.join(fits or UNITS[kind])}"
    draft.put(quantity, [name], evidence, question, unit=unit)


def _fitting(kind: str, middle: float) -> list[str]:
    """Units in which a median is what batteries and vehicles have; the contract's own where it is plainly that."""
    plain, low, high = USUAL[kind]
    if low <= middle <= plain:
        return [next(iter(UNITS[kind]))]
    return [u for u in UNITS[kind] if low <= float(converted(np.array(middle), kind, u)) <= high]
