"""What the importers share: values laid on one clock, and the part in the air found and cut out.

Each message has its own clock; a run is laid out on the times of the inertial sensor and each other value stands in the
row nearest in time, so that nothing is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.faults import ImportFault, true_stretches
from rotorid.recordings.run import stretches

_SHORTEST_FLIGHT_S = 4.0
_AFTER_TAKE_OFF_S = 1.0
_BEFORE_LANDING_S = 0.5
_LONGEST_PAUSE_S = 1.0
"""A dip of the throttle shorter than this does not end a flight."""
_DRIVEN = 0.05
"""Mean throttle below which nothing flies."""
_NEAR_WEIGHT = 0.85
"""Share of the throttle of flight below which the rotors do not carry the weight."""
_LIFTS = 0.95
"""Share of the throttle of flight that a stretch begins and ends with: less is spool-up or a vehicle that settles."""
_FALLING = 0.9
"""Share of the usual specific force below which a vehicle falls: on the ground it stays at 1 g."""
_NEAR_WEIGHT_ALONE = 0.7
"""The same where no accelerometer distinguishes a fall from the ground."""
_TURNS_RAD_S = 1.0
"""Root mean square of slow body rates above which a vehicle whose rotors turn is in the air. A public log has one that
rocks on the ground at 0.3 to 0.8 with rotors at two thirds of what flight takes."""
_GROUND_M, _CLEAR_M = 0.05, 0.5
"""Heights below which a vehicle is on the ground, and above which it is in the air."""
_SMOOTHED_S = 1.0
_SPEEDS = ("rotor_speed", "rotor_command")


def on_grid(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, k) put into the row of the grid nearest in time; NaN elsewhere (the last one wins a shared row).

    Both times in one unit, as floats or whole numbers.
    """
    values = np.asarray(values, float).reshape(len(time), -1)
    out = np.full((len(grid), values.shape[1]), np.nan)
    inside = (time >= grid[0]) & (time <= grid[-1])
    out[np.searchsorted((grid[1:] + grid[:-1]) / 2, time[inside])] = values[inside]
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


def airborne(table: pd.DataFrame, stated: np.ndarray | None = None) -> tuple[np.ndarray, list[ImportFault]]:
    """Rows of a table in contract columns in which the vehicle flies, (n,), and what of a stated flight is ground.

    `stated` is what the log itself calls flight, (n,); None where it says nothing. It holds where no rotors are
    recorded, or no accelerometer.
    """
    time_s = table[c.TIME].to_numpy(float)
    flying = np.ones(len(table), bool) if stated is None else stated

    def of(names) -> np.ndarray | None:
        return table[list(names)].to_numpy(float) if set(names) <= set(table) else None

    # What drives the rotors (n, k): throttles, else measured, else commanded speeds.
    kinds = ([n for n in table if c.rotor_number(n) and n.startswith(k)] for k in ("throttle", *_SPEEDS))
    drive = next((table[n].to_numpy(float) for n in kinds if n and table[n].notna().any().all()), None)
    force = of(c.SPECIFIC_FORCE)
    if drive is None or len(table) < 2 or not flying.any() or (force is None and stated is not None):
        return flying, []
    height = of([c.HEIGHT])
    found = off_the_ground(
        flying, drive, force, time_s, of(c.ANGULAR_VELOCITY), None if height is None else height[:, 0]
    )
    lost = int((flying & ~found).sum())
    if stated is None or not lost:
        return found, []
    lasts = np.minimum(np.diff(time_s, append=time_s[-1]), _LONGEST_PAUSE_S)  # the clock stops between flights
    seen = (
        f"{lasts[flying & ~found].sum():.0f} s of {lasts[flying].sum():.0f} s that the log calls flight are on the "
        f"ground (rotors below {_NEAR_WEIGHT:g} of those of flight, specific force of 1 g, no turning)"
    )
    return found, [ImportFault("on_ground", c.TIME, seen, "left out", lost)]


def off_the_ground(
    flying: np.ndarray,
    drive: np.ndarray,
    force: np.ndarray | None,
    time_s: np.ndarray,
    rates: np.ndarray | None = None,
    height: np.ndarray | None = None,
) -> np.ndarray:
    """Rows of a mask (n,) of possible flight in which thrust carries the vehicle, or it falls, turns, or is up.

    On the ground the rotors turn below what flight takes while the specific force stays at 1 g and nothing turns. What
    flight takes is the median of the rows above half of what is mostly given. A log of the ground alone shows no flight
    and is not recognised. A stretch begins and ends with rotors that lift, unless the log begins or ends in it.

    `drive` holds throttles or speeds of the rotors (n, k), NaN where there is no value; `force`, m/s², and `rates`,
    rad/s, specific force and body rates (n, 3), None where they are not recorded; `time_s` the clock (n,); `height`
    what a range finder or a motion capture says of the height above ground (n,), m.
    """
    step_s = max(float(np.median(np.diff(time_s))), 1e-4)
    rows = max(int(_SMOOTHED_S / step_s), 1)

    def smooth(values: np.ndarray) -> np.ndarray:
        known = pd.Series(values).interpolate(limit_direction="both")
        return known.rolling(rows, center=True, min_periods=1).median().to_numpy()

    throttle = smooth(pd.DataFrame(drive).mean(axis=1).to_numpy())
    given = throttle[flying & np.isfinite(throttle)]
    full = float(np.quantile(given, 0.9)) if len(given) else 0.0
    if full <= _DRIVEN:
        return flying
    of_flight = np.median(given[given > 0.5 * full])
    turning = np.zeros(len(throttle), bool) if rates is None else _turning(rates, step_s) > _TURNS_RAD_S
    up = np.zeros(len(throttle), bool)
    if force is not None and np.isfinite(force).any():
        pull = smooth(np.linalg.norm(force, axis=1))
        flown = (throttle >= _NEAR_WEIGHT * of_flight) | (pull < _FALLING * np.nanmedian(pull[flying]))
    else:
        flown = throttle >= _NEAR_WEIGHT_ALONE * of_flight
    if height is not None and np.isfinite(height).any():
        above = smooth(height)
        up = above > _CLEAR_M
        flown &= ~(above < _GROUND_M)
    flown |= (turning | up) & (throttle >= 0.5 * of_flight)
    flown = flying & without_pauses(flown, time_s)
    lifts, out = (throttle >= _LIFTS * of_flight) | turning | up, np.zeros(len(flying), bool)
    for start, stop in stretches(flown):
        lifting = np.flatnonzero(lifts[start:stop])
        if len(lifting):
            first = start if start == 0 else start + lifting[0]
            last = stop if stop == len(flown) else start + lifting[-1] + 1
            out[first:last] = True
    return out


def _turning(rates: np.ndarray, step_s: float) -> np.ndarray:
    """Root mean square over `_SMOOTHED_S` of body rates (n, 3) that are averaged over a tenth of it, rad/s, (n,)."""
    known = pd.DataFrame(rates).interpolate(limit_direction="both")
    few, many = max(int(0.1 * _SMOOTHED_S / step_s), 1), max(int(_SMOOTHED_S / step_s), 1)
    slow = known.rolling(few, center=True, min_periods=1).mean()
    return np.sqrt((slow**2).sum(axis=1).rolling(many, center=True, min_periods=1).mean()).to_numpy()


def without_pauses(up: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """The mask with pauses inside it that are shorter than `_LONGEST_PAUSE_S` filled."""
    up = up.copy()
    for (_, stop), (start, _) in pairwise(stretches(up)):
        if time_s[start] - time_s[stop - 1] < _LONGEST_PAUSE_S:
            up[stop:start] = True
    return up


def flights(
    table: pd.DataFrame, flying: np.ndarray, name: str, where: object, jumps: np.ndarray | None = None
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Every flight of a table by name, take-off and landing left out, its clock at zero; InputError where none is.

    Where the table begins or ends in the air nothing is left out there. No run holds a row of `jumps` (n,), however
    few these are.
    """
    time_s = table[c.TIME].to_numpy(float)
    flying = without_pauses(flying, time_s)
    if jumps is not None:
        flying &= ~jumps
    found = _long_enough(flying, time_s)
    if not found:
        longest = max((b - a for a, b in true_stretches(flying, time_s, 0.0)), default=0.0)
        throttles = [n for n in table if n.startswith("throttle_") and c.rotor_number(n)]
        why = f"the vehicle never flies in this log of {time_s[-1]:.0f} s"
        if longest > 0:
            why = (
                f"the longest stretch in the air is {longest:.1f} s, at least {_SHORTEST_FLIGHT_S:g} s beyond take-off "
                "and landing are needed"
            )
        elif throttles and not (table[throttles] > _DRIVEN).any().any():
            why += ": no motor is ever driven"
        raise InputError(f"{where}: {why}")
    runs, cuts = {}, []
    for number, (start, stop) in enumerate(found, 1):
        run = name if len(found) == 1 else f"{name}_{number}"
        first, last = _inside(start, stop, time_s)
        inside = (time_s >= first) & (time_s <= last)
        if inside.sum() < 2:
            continue
        cut = table[inside].reset_index(drop=True)
        cut[c.TIME] -= cut[c.TIME].iloc[0]
        runs[run] = cut.dropna(axis=1, how="all")
        seen = f"in the air from {start:.2f} to {stop:.2f} s of {time_s[-1]:.0f} s"
        cuts.append(ImportFault("cut", c.TIME, seen, f"{first:.2f} to {last:.2f} s kept", int((~inside).sum()), run))
    if not runs:
        raise InputError(f"{where}: next to no samples of its {len(found)} flights are there")
    return runs, cuts


def stretches_of(time_s: np.ndarray, flying: np.ndarray) -> list[tuple[float, float]]:
    """Start and stop, s, of every flight of a mask (n,) that is long enough, without take-off and landing."""
    return [_inside(start, stop, time_s) for start, stop in _long_enough(without_pauses(flying, time_s), time_s)]


def _long_enough(flying: np.ndarray, time_s: np.ndarray) -> list[tuple[float, float]]:
    every = true_stretches(flying, time_s, _SHORTEST_FLIGHT_S)
    return [s for s in every if np.diff(_inside(*s, time_s))[0] >= _SHORTEST_FLIGHT_S]


def _inside(start_s: float, stop_s: float, time_s: np.ndarray) -> tuple[float, float]:
    """A stretch in the air without take-off and landing, as far as these are in the table."""
    first = start_s if start_s <= time_s[0] else start_s + _AFTER_TAKE_OFF_S
    return first, stop_s if stop_s >= time_s[-1] else stop_s - _BEFORE_LANDING_S
