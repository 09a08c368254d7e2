"""What every importer of an autopilot's log shares: values laid on one clock, and the part in the air cut out.

Each message has its own clock; a run is laid out on the times of the inertial sensor and each other value stands in the
row nearest in time, so that nothing is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.importers.clean import true_stretches
from rotorid.importers.report import Fault
from rotorid.recordings import columns as c

SHORTEST_FLIGHT_S = 4.0
AFTER_TAKE_OFF_S = 1.0
BEFORE_LANDING_S = 0.5
LONGEST_PAUSE_S = 1.0
"""A dip of the throttle shorter than this does not end a flight."""
DRIVEN = 0.05
"""Mean throttle below which nothing flies."""
NEAR_WEIGHT = 0.85
"""Share of the throttle of flight below which the rotors do not carry the weight."""
LIFTS = 0.95
"""Share of the throttle of flight that a stretch begins and ends with: less is spool-up or a vehicle that settles."""
FALLING = 0.9
"""Share of the usual specific force below which a vehicle falls: on the ground it stays at 1 g."""
SMOOTHED_S = 1.0


def on_grid(grid_s: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, k) put into the row of the grid nearest in time; NaN elsewhere (the last one wins a shared row)."""
    values = np.asarray(values, float).reshape(len(time_s), -1)
    out = np.full((len(grid_s), values.shape[1]), np.nan)
    inside = (time_s >= grid_s[0]) & (time_s <= grid_s[-1])
    out[np.searchsorted((grid_s[1:] + grid_s[:-1]) / 2, time_s[inside])] = values[inside]
    return out


def increasing(time_s: np.ndarray) -> np.ndarray:
    """Mask of the instants later than every one before, (n,)."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate([[True], time_s[1:] > latest[:-1]])


def table_on(grid_s: np.ndarray, parts: Sequence[tuple[Sequence[str], np.ndarray, np.ndarray]]) -> pd.DataFrame:
    """A table on a grid (n,), s, of parts: names, times (m,), s, and values (m, k); empty columns are left out."""
    columns = {c.TIME: grid_s - grid_s[0]}
    for names, time_s, values in parts:
        columns.update(zip(names, on_grid(grid_s, time_s, values).T, strict=True))
    return pd.DataFrame({k: v for k, v in columns.items() if k == c.TIME or np.isfinite(v).any()})


def driven(drive: np.ndarray) -> np.ndarray:
    """Rows in which rotors (n, k; throttles or speeds, NaN where there is no value) carry the vehicle.

    More than half of what they mostly do in flight: nothing else in a log tells it.
    """
    mean = pd.Series(np.nanmean(np.where(np.isfinite(drive), drive, np.nan), axis=1) if len(drive) else [])
    mean = mean.interpolate(limit_direction="both").to_numpy()
    full = float(np.nanquantile(mean, 0.9)) if np.isfinite(mean).any() else 0.0
    return mean > 0.5 * full if full > DRIVEN else np.zeros(len(drive), bool)


def off_the_ground(flying: np.ndarray, drive: np.ndarray, force: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Rows of a mask (n,) of flight, as a log states it, in which thrust carries the vehicle or it falls.

    On the ground the rotors turn below the throttle of flight while the specific force stays at 1 g. The throttle of
    flight is the median of the rows above half of what is mostly given. A log of the ground alone shows no throttle of
    flight and is not recognised.

    Parameters
    ----------
    flying
        What the log calls flight, (n,).
    drive
        Throttles (n, k), share of the range; NaN where there is no value.
    force
        Specific force (n, 3), m/s².
    time_s
        Clock of the rows (n,), s.
    """
    rows = max(int(SMOOTHED_S / max(float(np.median(np.diff(time_s))), 1e-4)), 1)

    def smooth(values: np.ndarray) -> np.ndarray:
        known = pd.Series(values).interpolate(limit_direction="both")
        return known.rolling(rows, center=True, min_periods=1).median().to_numpy()

    throttle = smooth(pd.DataFrame(drive).mean(axis=1).to_numpy())
    pull = smooth(np.linalg.norm(force, axis=1))
    given = throttle[flying & np.isfinite(throttle)]
    full = float(np.quantile(given, 0.9)) if len(given) else 0.0
    if full <= DRIVEN or not np.isfinite(pull).any():
        return flying
    of_flight = np.median(given[given > 0.5 * full])
    flown = (throttle >= NEAR_WEIGHT * of_flight) | (pull < FALLING * np.nanmedian(pull[flying]))
    flown = flying & without_pauses(flown, time_s)
    lifts, out = throttle >= LIFTS * of_flight, np.zeros(len(flying), bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flown.astype(int), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        up = np.flatnonzero(lifts[start:stop])
        if len(up):
            out[start + up[0] : start + up[-1] + 1] = True
    return out


def without_pauses(up: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """The mask with pauses inside it that are shorter than `LONGEST_PAUSE_S` filled."""
    up = up.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], up.astype(int), [0]])))
    for stop, start in zip(edges[1:-1:2], edges[2::2], strict=True):
        if time_s[start] - time_s[stop - 1] < LONGEST_PAUSE_S:
            up[stop:start] = True
    return up


def flights(
    table: pd.DataFrame, flying: np.ndarray, name: str, where: object
) -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    """Every flight of a table by name, take-off and landing left out, its clock at zero; InputError where none is."""
    time_s = table[c.TIME].to_numpy(float)
    flying = without_pauses(flying, time_s)
    margin = AFTER_TAKE_OFF_S + BEFORE_LANDING_S
    found = true_stretches(flying, time_s, SHORTEST_FLIGHT_S + margin)
    if not found:
        longest = max((b - a for a, b in true_stretches(flying, time_s, 0.0)), default=0.0)
        why = (
            f"the longest stretch in the air is {longest:.1f} s, at least {SHORTEST_FLIGHT_S:g} s beyond take-off and "
            "landing are needed"
            if longest > 0
            else f"the vehicle never flies in this log of {time_s[-1]:.0f} s"
        )
        raise InputError(f"{where}: {why}")
    runs, cuts = {}, []
    for number, (start, stop) in enumerate(found, 1):
        run = name if len(found) == 1 else f"{name}_{number}"
        first, last = start + AFTER_TAKE_OFF_S, stop - BEFORE_LANDING_S
        inside = (time_s >= first) & (time_s <= last)
        if inside.sum() < 2:
            continue
        cut = table[inside].reset_index(drop=True)
        cut[c.TIME] -= cut[c.TIME].iloc[0]
        runs[run] = cut.dropna(axis=1, how="all")
        seen = f"in the air from {start:.2f} to {stop:.2f} s of {time_s[-1]:.0f} s"
        cuts.append(Fault("cut", c.TIME, seen, f"{first:.2f} to {last:.2f} s kept", int((~inside).sum()), run))
    if not runs:
        raise InputError(f"{where}: next to no samples of its {len(found)} flights are there")
    return runs, cuts
