"""Lines in the accelerometer or gyroscope that follow the rotors' speed, seen through whatever aliasing there is.

The phase of each rotor is the integral of its recorded speed. Multiplying a reading by e^(-iψ) at the instants of
its samples turns a line locked to the rotor, or its alias, into a constant, whatever the sampling rate; a
structural resonance stays at its own frequency and passes by. In short windows the power at the rotor's order is
compared with the power at orders next to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter
from scipy.stats import gamma

from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.evidence.motion import full_speed
from rotorid.mismatch.mistakes.signals import P_LIMIT, Corrected, ReadSet, Signals, established
from rotorid.recordings import columns as c

_SIDE_BINS = (-6, -5, -4, -3, 3, 4, 5, 6)
"""Offsets from the order, in widths of the window, that give the level next to the line."""
_ORDERS = (1, 2)
_SCALES = np.arange(0.85, 1.151, 0.015)
"""Factors on a commanded speed that are tried: the window distinguishes speeds of 18 rad/s."""


@dataclass(frozen=True)
class _Turns:
    """How the rotors turn in windows of a run, at an order."""

    windows: np.ndarray
    """(w,) numbers of the windows, of `length` samples each."""
    length: int
    follow: np.ndarray
    """(w, length, k) e^(-iψ) of each rotor."""
    clear: np.ndarray
    """(w, k) whether the line lies above flight motion: where its alias comes near zero that would be taken for it."""
    crowd: np.ndarray
    """(w, k) number of rotors that share the line."""


def find(recordings: ReadSet) -> Corrected:
    """A vibration that follows the rotors, if there is a clear one; the set stays as it is."""
    most_measured = 1000  # Windows of a run, spread over it, that a line is measured from.
    signals = _turning(recordings)
    turns = {order: [_turns(s, order, most_measured) for s in signals] for order in _ORDERS}
    lines: list[tuple[float, Estimate, str, int]] = []  # p-value, amplitude, column and order of each
    for sensor, columns, unit in (
        ("accelerometer", c.SPECIFIC_FORCE, "m/s2"),
        ("gyroscope", c.ANGULAR_VELOCITY, "rad/s"),
    ):
        have = [k for k, s in enumerate(signals) if sensor in s.values and s.own_rate_hz[sensor] > 0.9 * s.rate_hz]
        for axis, column in enumerate(columns):
            for order in _ORDERS:
                seen = [(signals[k].values[sensor][:, axis], turns[order][k]) for k in have]
                if measured := _measure(seen, column, unit):
                    lines.append((*measured, column, order))
    if not lines:
        return Corrected(recordings)
    lines.sort(key=lambda line: line[0])
    _, strongest, _, order = max(lines, key=lambda line: (line[2].startswith("specific"), line[1].value))
    columns = dict.fromkeys(column for _, _, column, _ in lines)
    sentence = (
        f"A vibration of {strongest.value:.2g} {strongest.unit} a rotor turns with the rotors (order {order}) in "
        f"{', '.join(columns)}; it may add a constant that grows with the thrust, which looks like a wrong thrust "
        "coefficient."
    )
    amplitudes = tuple(amplitude for _, amplitude, _, _ in lines)
    return Corrected(recordings, (established("vibration", sentence, lines[0][0], columns, parameters=amplitudes),))


def _turning(recordings: ReadSet) -> list[Signals]:
    """Signals of the runs with their rotors' speed: as read, or as commanded, at the scale at which a line stands out.

    A command is followed late, and its full speed is only believed: half a window's turn too much hides a line.
    """
    everything = recordings.signals
    read = [s for s in everything if "rotors" in s.values]
    if read:
        return read
    full = full_speed(recordings.runs, recordings.vehicle)
    commanded = [(s, speed) for s in everything if (speed := _as_commanded(s, full)) is not None]
    if not any("accelerometer" in s.values for s, _ in commanded):
        return []
    trials = ([replace(s, values={**s.values, "rotors": x * speed}) for s, speed in commanded] for x in _SCALES)
    return max(trials, key=_strongest_line)


def _as_commanded(s: Signals, full_rad_s: float | None) -> np.ndarray | None:
    """Speeds (n, k) of rotors that turn as commanded, COMMAND_LAG_S late; None without commands."""
    command_lag_s = 0.03  # How late rotors follow their commands, roughly.
    if "commands" in s.values:
        speed = s.values["commands"]
    elif "throttle" in s.values and full_rad_s is not None:
        speed = full_rad_s * s.values["throttle"]
    else:
        return None
    keep = np.exp(-1.0 / (s.rate_hz * command_lag_s))
    start = np.nan_to_num(speed[:1]) * keep
    return lfilter([1.0 - keep], [1.0, -keep], np.nan_to_num(speed), axis=0, zi=start)[0]


def _strongest_line(signals: list[Signals]) -> float:
    """Power at the order over that next to it, in half of the windows, of the accelerometer's clearest line."""
    most_windows = 30  # Windows of a run that the factor is found from.
    best = 0.0
    for order in _ORDERS:
        seen = [(s, _turns(s, order, most_windows)) for s in signals if "accelerometer" in s.values]
        for axis in range(3):
            powers = [_powers(s.values["accelerometer"][:, axis], own) for s, own in seen if own is not None]
            found = np.concatenate([(line / beside).ravel() for line, beside, _ in powers] or [np.zeros(0)])
            found = found[np.isfinite(found)]
            best = max(best, float(np.median(found)) if len(found) else 0.0)
    return best


def _measure(all_seen: list[tuple[np.ndarray, _Turns | None]], column: str, unit: str) -> tuple[float, Estimate] | None:
    """p-value and amplitude of a line of readings (n,) at the rotors' order; None where none is clear.

    By its power over that next to it, summed over windows and rotors.
    """
    least_amplitude = 0.5  # Line over the reading's own scatter next to it (one sigma a sample), at least, to matter.
    ratios, powers, levels, lengths = [], [], [], []
    for reading, turns in all_seen:
        if turns is None:
            continue
        line, beside, floor = _powers(reading, turns)
        seen = np.isfinite(line) & np.isfinite(beside) & (beside > 0)
        good = seen.any(axis=1)
        if not good.any():
            continue
        line, beside, crowd, floor = (np.where(seen, values, np.nan) for values in (line, beside, turns.crowd, floor))
        # Rotors at nearly one speed see the same line: count each window once, by their mean.
        ratios.append(np.nanmean(line[good] / beside[good], axis=1))
        powers.append(np.nanmean((line - beside)[good] / crowd[good], axis=1))
        levels.append(np.nanmean(floor[good], axis=1))
        lengths.append(np.full(good.sum(), turns.length))
    if not ratios or sum(map(len, ratios)) < 20:
        return None
    ratio, power, level, length = (np.concatenate(x) for x in (ratios, powers, levels, lengths))
    n = len(ratio)
    least_median = 3.0  # Power at the order over that next to it in half of the windows, at least.
    if np.median(ratio) < least_median:
        return None  # a line is there as long as the rotors turn; single fierce moments are motion
    # Each ratio is about exponential, a little heavier because the level nearby is estimated from eight bins.
    p = float(gamma.sf(float(ratio.sum()) * (1 - 1 / len(_SIDE_BINS)), n))
    mean = float(power.mean())
    sd = float(power.std(ddof=1) / np.sqrt(n))
    amplitude, low, high = (np.sqrt(max(v, 0.0)) for v in (mean, mean - 1.96 * sd, mean + 1.96 * sd))
    # White noise of one sigma s a sample shows as 4 s² · 1.5 / length behind a Hann taper.
    noise = float(np.sqrt(level.mean() * np.median(length) / 6))
    if not (p < P_LIMIT and float(amplitude) / max(noise, 1e-12) > least_amplitude):
        return None
    return p, Estimate(f"amplitude ({column})", float(amplitude), unit, float(low), float(high))


def _tapered(length: int) -> np.ndarray:
    """Weights (length,) of a window, their mean one."""
    taper = np.hanning(length + 2)[1:-1]
    return taper / taper.mean()


def _turns(s: Signals, order: int, most: int) -> _Turns | None:
    """The rotors of a run at an order, in no more than `most` windows spread over it; None of too few samples."""
    lowest_hz = 8.0  # Aliases below this fall among the flight's own motion and are left out.
    window_s = 0.35
    length, speed, dt = int(window_s * s.rate_hz), s.values["rotors"], 1.0 / s.rate_hz
    if length < 24:
        return None
    count = len(s.time_s) // length
    windows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
    middle = np.zeros_like(speed)
    middle[1:] = (speed[1:] + speed[:-1]) * dt / 2
    speed, middle = (x[: count * length].reshape(count, length, -1)[windows] for x in (speed, middle))
    steps = order * middle
    steps[:, 0] = 0.0
    follow = np.exp(-1j * np.cumsum(steps, axis=1))
    turned = np.abs((order * speed.mean(axis=1) * dt + np.pi) % (2 * np.pi) - np.pi)
    clear = turned / (2 * np.pi * dt) > lowest_hz + 6 / window_s
    # Rotors of nearly one speed add to each other's line, with phases that wander: their powers add.
    together = np.matmul((_tapered(length)[:, None] * follow.conj()).transpose(0, 2, 1), follow) / length
    return _Turns(windows, length, follow, clear, np.sum(np.abs(together) ** 2, axis=2))


def _powers(reading: np.ndarray, turns: _Turns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared amplitude of a reading (n,) at the order, next to it, and noise: (windows, rotors) each.

    NaN where it is not identifiable.
    """
    length = turns.length
    x = reading[: len(reading) // length * length].reshape(-1, length)[turns.windows]
    k = np.arange(length)
    # The flight's own slow motion is taken out with a straight line and a taper.
    ramp = (k - k.mean()) / max(np.abs(k - k.mean()).max(), 1)
    x = x - x.mean(axis=1, keepdims=True)
    x = (x - ramp * (x @ ramp / (ramp @ ramp))[:, None]) * _tapered(length)
    line = np.full(turns.clear.shape, np.nan)
    beside, floor = np.full_like(line, np.nan), np.full_like(line, np.nan)
    for i, clear in enumerate(turns.clear.T):
        spectrum = np.abs(np.fft.fft(x[clear] * turns.follow[clear, :, i], axis=1) / length) ** 2 * 4
        line[clear, i] = spectrum[:, 0]
        floor[clear, i] = np.median(spectrum, axis=1) / np.log(2)
        beside[clear, i] = np.mean(spectrum[:, list(_SIDE_BINS)], axis=1)
    return line, beside, floor
