"""Dynamic tests: a small quadrotor flown on three platforms, three sets (thesis 2.8.2, fig. 2.47).

The pilot flies the same plan on each platform with timing of his own, so the platforms are compared by what
they agree in whatever the timing: levels held, the largest force, noise at rest, the return to zero.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.io.tables import by_recording
from rotorid.recordings.signal.filters import mean_and_error

_REST_S = 1.0
"""Length of the stretches at the beginning and the end that are taken as rest."""
_HELD_S = 0.8
"""A thrust counts as held when it stays within ± `_HELD_N` for that long."""
_HELD_N = 0.02
_MARGIN_S = 0.25
"""Left off both ends of a held stretch before platforms are compared: the pilot's timing differs by that much."""


def sets_of(sessions: pd.DataFrame) -> dict[str, int]:
    """To the id of each recording, of all platforms, the number of its set: one plan, flown once on each platform.

    A set is numbered by its recordings' `repeat`. Where a platform has flown that number already, the recordings of
    the later group are a set of their own, with the next number that is free: two flights are never taken for one.

    Raises InputError for a group that holds a platform twice.
    """
    platforms: dict[int, set[str]] = {}
    numbers: dict[str, int] = {}
    for group, flown in sorted(sessions.groupby("group"), key=lambda part: (part[1]["started"].min(), part[0])):
        for number, part in flown.groupby(flown["repeat"].astype(int)):
            twice = part[part["platform"].duplicated(keep=False)]
            if len(twice):
                ids = ", ".join(twice["id"])
                raise InputError(f"{ids}: group {group} holds the same platform and repeat twice; give each its own")
            here = set(part["platform"])
            if here & platforms.get(number, set()):
                number = max(platforms) + 1
            platforms.setdefault(number, set()).update(here)
            numbers |= dict.fromkeys(part["id"], number)
    return numbers


def flights(
    force_z_n: dict[str, np.ndarray], prepared: pd.DataFrame, sessions: pd.DataFrame, sets: dict[str, int]
) -> pd.DataFrame:
    """Thrust (−F_z) over time since `read_start`, columns `platform set time_s thrust_n low_pass_n zero_phase_n`.

    `force_z_n` gives F_z of each prepared recording for the three kinds of signal, keyed by id and kind
    (`<id>`, `<id>_low_pass`, `<id>_zero_phase`); `sets` is of `sets_of`.
    """
    parts = by_recording(prepared)
    out = []
    for session in sessions.itertuples():
        table = parts[session.id]
        kept = table["index"].between(session.mark_read_start, session.mark_read_stop).to_numpy()
        if not kept.any():
            raise InputError(f"{session.id}: nothing between its marks read_start and read_stop")
        time_s = table["time_s"].to_numpy()[kept]
        flight = {"platform": session.platform, "set": sets[session.id], "time_s": time_s - time_s[0]}
        for column, kind in (("thrust_n", ""), ("low_pass_n", "_low_pass"), ("zero_phase_n", "_zero_phase")):
            flight[column] = -force_z_n[f"{session.id}{kind}"][kept]
        out.append(pd.DataFrame(flight))
    return pd.concat(out, ignore_index=True)


def _held(time_s: np.ndarray, thrust_n: np.ndarray) -> list[tuple[float, float]]:
    """Stretches (start and stop, s) in which a smooth thrust above rest is held.

    Over every `_HELD_S` within a stretch the thrust spans less than twice `_HELD_N`; stretches whose levels do not
    differ by more than that are one.
    """
    step_s = float(np.median(np.diff(time_s)))
    window = max(2, round(_HELD_S / step_s))
    series = pd.Series(thrust_n)
    flat = (series.rolling(window).max() - series.rolling(window).min() < 2 * _HELD_N).to_numpy()
    found: list[tuple[float, float]] = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [0]])))
    for first, beyond in edges.reshape(-1, 2):
        start = first - window + 1
        if np.mean(thrust_n[start:beyond]) > 5 * _HELD_N:
            found.append((float(time_s[start]), float(time_s[beyond - 1])))
    return found


def agreement(flown: pd.DataFrame, base: str = "al") -> pd.DataFrame:
    """Mean thrust of every platform in the stretches that `base` holds, one row a stretch and platform.

    The plan of a set is the same on all platforms; a margin at both ends allows for the pilot's timing. Columns
    `set stretch start_s stop_s platform thrust_n error_n` (standard error of the mean from the samples' scatter,
    neighbours' correlation included). A set that `base` did not fly compares nothing.
    """
    rows = []
    for number, flights_of_set in flown.groupby("set"):
        steady = flights_of_set[flights_of_set["platform"] == base]
        if steady.empty:
            continue
        stretches = _held(steady["time_s"].to_numpy(), steady["zero_phase_n"].to_numpy())
        for place, (start, stop) in enumerate(stretches, start=1):
            if stop - start <= 2 * _MARGIN_S:
                continue
            for platform, flight in flights_of_set.groupby("platform"):
                inside = flight["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S)
                mean, error = mean_and_error(flight.loc[inside, "thrust_n"].to_numpy())
                rows.append(
                    {
                        "set": number,
                        "stretch": place,
                        "start_s": start,
                        "stop_s": stop,
                        "platform": platform,
                        "thrust_n": mean,
                        "error_n": error,
                    }
                )
    return pd.DataFrame(rows, columns=["set", "stretch", "start_s", "stop_s", "platform", "thrust_n", "error_n"])


def ratios(levels: pd.DataFrame, base: str = "al") -> list[dict]:
    """Each other platform against `base`: slope over all stretches, one zero per set, with 95 % intervals.

    A flight's tare is shared by all its stretches (25 samples of a noisy sensor leave an error), so each set has a
    zero of its own: thrust = zero_set + slope · thrust_base, least squares; the pilot's scatter is in the residuals.
    """
    wide = levels.pivot_table(index=["set", "stretch"], columns="platform", values="thrust_n")
    out = []
    for platform in (name for name in wide.columns if name != base):
        both = wide[[base, platform]].dropna()
        means = both.groupby("set").mean()
        centred = both - both.groupby("set").transform("mean")
        x, y = centred[base].to_numpy(), centred[platform].to_numpy()
        slope = float(x @ y / (x @ x))
        freedom = len(x) - len(means) - 1
        error = np.sqrt(np.sum((y - slope * x) ** 2) / freedom / (x @ x))
        half = float(student_quantile(freedom, 0.975) * error)
        out.append(
            {
                "platform": platform,
                "ratio": slope,
                "interval_95": (slope - half, slope + half),
                "zeros_n": (means[platform] - slope * means[base]).tolist(),
                "stretches": len(both),
            }
        )
    return out


def figures(flown: pd.DataFrame) -> pd.DataFrame:
    """One row a flight: largest smoothed thrust, mean thrust, noise at rest, return to zero."""
    rows = []
    for (number, platform), flight in flown.groupby(["set", "platform"]):
        time_s = flight["time_s"].to_numpy()
        before, after = time_s < _REST_S, time_s > time_s[-1] - _REST_S
        rest = flight.loc[before, "thrust_n"]
        rows.append(
            {
                "set": number,
                "platform": platform,
                "largest_n": float(flight["zero_phase_n"].max()),
                "largest_low_pass_n": float(flight["low_pass_n"].max()),
                "mean_n": float(flight["thrust_n"].mean()),
                "noise_n": float(rest.std(ddof=1)),
                "return_to_zero_n": float(flight.loc[after, "thrust_n"].mean() - rest.mean()),
            }
        )
    return pd.DataFrame(rows)
