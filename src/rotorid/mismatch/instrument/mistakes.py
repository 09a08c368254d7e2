"""Mistakes in a set of kind `stand` or `bench`, recognised before any physics: signs, units, spins, order of rotors.

Each is a plain comparison of reading and predicted load, run by run: the slope of one on the other with a constant
left free. A sign is called flipped, or a unit another, where the slope says so beyond any believable error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from rotorid.effects.loading import CHANNELS
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.instrument.sampling import without_repeats
from rotorid.mismatch.instrument.setup import PreparedInstrument, loaded_by, set_up, with_speed
from rotorid.mismatch.mistakes import dropout
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c

_CERTAIN = 0.9
"""Correlation of reading and load, in size, from which a slope means something."""
_FORCE_UNITS = {"kgf": 0.101972, "gf": 101.972, "mN": 1000.0, "lbf": 0.224809, "ozf": 3.59694}
_MOMENT_UNITS = {"N cm": 100.0, "N mm": 1000.0, "kgf cm": 10.1972, "mN m": 1000.0}
_SPEED_UNITS = {"rpm": 1.0 / 9.549297**2, "Hz": 6.283185**2, "krpm": (1000.0 / 9.549297) ** 2}
NAMES = c.FORCE + c.MOMENT


@dataclass(frozen=True)
class _Slope:
    """Slope of a channel's reading on its load in one run, and their correlation."""

    run: str
    channel: int
    slope: float
    correlation: float


def _slopes(setup: PreparedInstrument) -> list[_Slope]:
    """Slopes of every channel that is loaded, by run.

    Of a moment what goes with the forces across it is taken off first: a lever arm that nobody stated makes any sign.
    """
    out = []
    for run in dict.fromkeys(x.run for x in setup.loadings):
        parts = [x for x in setup.loadings if x.run == run]
        loads, reads = (np.concatenate([getattr(x, name) for x in parts]) for name in ("load", "reading"))
        for k in setup.instrument.channels:
            across = [] if k < 3 else [axis for axis in range(3) if axis != k - 3]
            beside = np.column_stack([np.ones(len(loads)), loads[:, across]])
            load, read = (_rest_beside(beside, x[:, k]) for x in (loads, reads))
            largest = max(float(x.load[:, k].std()) for x in setup.loadings) + 1e-12
            if load.std() < 0.2 * largest or read.std() == 0:
                continue
            r = float(load @ read / np.sqrt((load @ load) * (read @ read)))
            out.append(_Slope(run, k, float(load @ read / (load @ load)), r))
    return out


def _rest_beside(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What a regression of values (n,) on columns (n, m) leaves."""
    return values - columns @ np.linalg.lstsq(columns, values, rcond=1e-9)[0]


def find_mistakes(recordings: RecordingSet) -> tuple[RecordingSet, list[Finding], list[str]]:
    """The set with overwhelming mistakes corrected and held readings left out, their findings, and notes."""
    recordings, findings, notes = _degrees(recordings)
    recordings, lost = dropout.find(recordings)
    findings += [lost] if lost else []
    setup = set_up(recordings)
    for find in (_flipped, _other_unit, _wrong_rotors):
        found = find(recordings, setup)
        if found is not None:
            recordings, finding, note = found
            findings.append(finding)
            notes.append(note)
            setup = set_up(recordings)
    return without_repeats(recordings), findings, notes


def _scaled(run: Run, factors: dict[str, float]) -> Run:
    """A run with columns multiplied."""
    table = run.table.copy()
    for name, factor in factors.items():
        if name in table:
            table[name] = table[name] * factor
    return replace(run, table=table) if factors else run


def _with_runs(recordings: RecordingSet, runs) -> RecordingSet:
    return RecordingSet(recordings.name, recordings.vehicle, tuple(runs), recordings.held_out)


def _degrees(recordings: RecordingSet) -> tuple[RecordingSet, list[Finding], list[str]]:
    """Attitude of the mount in degrees: no mount is tilted by more than a right angle."""
    largest_angle_rad = 1.6
    off = [
        n
        for n in c.MOUNT
        if any(r.has(n) and np.nanmax(np.abs(r.column(n))) > largest_angle_rad for r in recordings.runs)
    ]
    if not off:
        return recordings, [], []
    names = [n for n in c.MOUNT if any(r.has(n) for r in recordings.runs)]
    runs = [_scaled(r, dict.fromkeys(names, np.pi / 180)) for r in recordings.runs]
    text = f"{' and '.join(names)} are in degrees, not in rad; they were converted"
    return (
        _with_runs(recordings, runs),
        [_finding("unit_error", text, ("force_x", "force_y"), np.pi / 180)],
        [text + "."],
    )


def _finding(key: str, sentence: str, channels, factor: float | None = None, others=(), windows=()) -> Finding:
    parameters = () if factor is None else (Estimate("factor", factor, "1", factor, factor),)
    return Finding(
        id=key,
        status="ambiguous" if others else "established",
        sentence=sentence,
        equation="y = factor × column" if factor is not None else "",
        parameters=parameters,
        p_value=1e-12,
        channels=tuple(channels),
        alternatives=tuple(sorted({key, *others})) if others else (),
        windows=tuple(windows),
    )


def _flipped(recordings: RecordingSet, setup: PreparedInstrument):
    """Channels whose reading falls as the load rises, in all runs or in some."""
    flipped = -0.4
    bad = [s for s in _slopes(setup) if s.correlation < -_CERTAIN and s.slope < flipped]
    if not bad:
        return None
    runs = []
    for run in recordings.runs:
        own = {NAMES[s.channel]: -1.0 for s in bad if s.run == run.name}
        runs.append(_scaled(run, own))
    channels = list(dict.fromkeys(CHANNELS[s.channel] for s in bad))
    named = list(dict.fromkeys(s.run for s in bad))
    everywhere = len(named) == len(recordings.runs)
    where = "in every run" if everywhere else f"in {', '.join(named)}"
    verb = "falls" if len(channels) == 1 else "fall"
    text = f"{' and '.join(channels)} {verb} where the load rises, {where}: the sign is flipped; it was turned round"
    others = ()
    if channels == ["moment_z"] and recordings.vehicle.kind == "stand" and everywhere:
        others = ("spin_direction",)
    windows = []
    if not everywhere:
        windows = [(r.name, float(r.time_s[0]), float(r.time_s[-1])) for r in recordings.runs if r.name in named]
    return _with_runs(recordings, runs), _finding("axis_sign", text, channels, -1.0, others, windows), text + "."


def _nearest(slope: float, units: dict[str, float]) -> str | None:
    """The unit whose factor a slope is near; None if it is near to none."""
    near_unit = 0.12  # Relative distance of a slope to a unit's factor within which it is that unit.
    return next((name for name, factor in units.items() if abs(slope / factor - 1) < near_unit), None)


def _other_unit(recordings: RecordingSet, setup: PreparedInstrument):
    """Forces, moments or rotor speeds in another unit, in every run."""
    found = [s for s in _slopes(setup) if s.correlation > _CERTAIN]
    forces = [s.slope for s in found if s.channel < 3]
    moments = [s.slope for s in found if s.channel >= 3]
    speed_known = bool(setup.loadings) and setup.loadings[0].measured and recordings.vehicle.kind == "stand"
    both = forces + moments
    if speed_known and both and (unit := _nearest(np.median(both), _SPEED_UNITS)):
        names = c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count)
        factor = float(np.sqrt(_SPEED_UNITS[unit]))
        return _converted(recordings, names, unit, factor, "rad/s", ("force_z",))
    for slope, units, names, wanted in (
        (forces, _FORCE_UNITS, c.FORCE, "N"),
        (moments, _MOMENT_UNITS, c.MOMENT, "N m"),
    ):
        if slope and (unit := _nearest(np.median(slope), units)):
            channels = [n for n, label in zip(CHANNELS, NAMES, strict=True) if label in names]
            return _converted(recordings, names, unit, 1.0 / units[unit], wanted, channels)
    return None


def _converted(recordings, names, unit, factor, wanted, channels):
    runs = [_scaled(r, dict.fromkeys(names, factor)) for r in recordings.runs]
    present = [n for n in names if any(r.has(n) for r in recordings.runs)]
    text = f"{', '.join(present)} are in {unit}, not in {wanted}; they were converted"
    return _with_runs(recordings, runs), _finding("unit_error", text, channels, factor), text + "."


def _wrong_rotors(recordings: RecordingSet, setup: PreparedInstrument):
    """Rotor columns in another order, or rotors that turn the other way."""
    vehicle = recordings.vehicle
    if vehicle.kind != "stand" or vehicle.rotor_count not in (3, 4) or not setup.loadings[0].measured:
        return None
    moments = [k for k in (3, 4) if k in setup.instrument.channels]
    if not moments:
        return None
    stated = tuple(range(vehicle.rotor_count))

    def energy_of(order) -> float:
        """Energy of the moments that another order of the rotors' speeds leaves, a constant free in each run."""
        total = 0.0
        for x in setup.loadings:
            motion = with_speed(x.motion, x.motion.rotor_speed[:, list(order)])
            left = (x.reading - loaded_by(replace(x, motion=motion), setup.vehicle).load)[:, moments]
            total += float(((left - left.mean(axis=0)) ** 2).sum())
        return total

    energy = {order: energy_of(order) for order in permutations(stated)}
    best = min(energy, key=energy.get)
    better = 4.0  # Residual energy over the stated order's, below which another order of rotors is the true one.
    if best != stated and energy[best] * better < energy[stated]:
        moved = [i + 1 for i in stated if best[i] != i]
        text = f"the columns of rotors {', '.join(map(str, moved))} are exchanged; they were put in order"
        names = c.rotor_columns("rotor_speed", vehicle.rotor_count)
        runs = []
        for run in recordings.runs:
            table = run.table.copy()
            for i in stated:
                table[names[i]] = run.table[names[best[i]]]
            runs.append(replace(run, table=table))
        return _with_runs(recordings, runs), _finding("rotor_order", text, ("moment_x", "moment_y")), text + "."
    return None
