"""From a recording set to what the analysis works on: split, segments, sensor noise, terms and rows.

What is made of a stretch of flight, made once and again only where something changed that it is made of.

Between two assemblies only a wind, the hang of a payload, the rotors' speeds, the accelerations that a model predicts
or a term's own values change. What was read of the motion while a column was made says whether any of it matters.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import numpy as np
from scipy.signal import welch

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, Motion, not_testable_reason, rotor_thrusts
from rotorid.errors import InputError
from rotorid.mismatch.decide import rules
from rotorid.mismatch.evidence.motion import (
    HIGHEST_CUTOFF_HZ,
    SHORTEST_SEGMENT_S,
    Segment,
    SensorNoise,
    analysis_rate_hz,
    build_segments,
    full_speed,
    made_from_accelerometer,
    without_noise,
)
from rotorid.mismatch.evidence.regression import noise_factors
from rotorid.mismatch.evidence.rows import (
    OFFSETS,
    PARAMETER_NAMES,
    Block,
    Rows,
    Term,
    Thinner,
    assemble,
    baseline_wrench,
    form_columns,
    form_terms,
    high_passed,
    offset_columns,
    project,
    residual,
    slope_column,
    state_column,
    value_columns,
)
from rotorid.mismatch.evidence.rows import measured_moment as moment_of
from rotorid.mismatch.evidence.split import split_runs
from rotorid.mismatch.evidence.unknowns import UNKNOWNS, empirical_effects
from rotorid.recordings import RecordingSet, Run, Split, Vehicle
from rotorid.recordings import columns as c
from rotorid.steps import step

_FIELDS = frozenset(f.name for f in fields(Motion))
MOST_BYTES = 256e6
"""Of all that is kept; what was made first is forgotten first."""
DEFAULT_TRUST = {"thrust": 0.1, "torque": 0.2, "mass": 0.05, "lifted": 0.05, "arm": 0.03, "inertia": 0.15}
"""Relative one-sigma belief where `trust` states none."""
MOST_S, MOST_SAMPLES, _PIECE_S = 600.0, 100_000, 20.0
"""Longer recordings are represented by pieces: neither memory nor time must grow with an hour's flight."""
_OF_THE_BODY = frozenset({"specific_force", "angular_acceleration"})
"""Fields of a motion that effects on the body read, and none on the rotors."""


class Watched(Motion):
    """A motion that notes which of its fields are read."""

    def __getattribute__(self, name: str) -> Any:
        own = object.__getattribute__(self, "__dict__")
        if name == "__dict__":
            own.get("read", set()).update(_FIELDS)
        elif name in _FIELDS:
            own.get("read", set()).add(name)
        return object.__getattribute__(self, name)


def watched(motion: Motion) -> tuple[Watched, set[str]]:
    """A motion whose reader is watched, and the names of the fields read so far."""
    out, read = object.__new__(Watched), {"time_s"}
    object.__getattribute__(out, "__dict__").update(motion.__dict__, read=read)
    return out, read


@dataclass(frozen=True)
class _Made:
    """Something made of a motion."""

    given: tuple
    """What else it was made of."""
    read: dict[str, Any]
    """Fields of the motion that were read."""
    made: Any
    size: int
    """Bytes."""

    def holds(self, given: tuple, motion: Motion) -> bool:
        """Whether the same would be made again."""
        return self.given == given and all(getattr(motion, name) is value for name, value in self.read.items())


@dataclass
class LastMade:
    """What was made last of each stretch of flight, under keys of those who made it."""

    kept: dict[tuple, _Made] = field(default_factory=dict)
    size: int = 0

    def made(self, key: tuple, given: tuple, motion: Motion, make: Callable[[Motion], Any]) -> Any:
        """What `make` makes of a motion and of what is `given`: remembered under a key, or made."""
        place = id(motion.time_s), *key
        if place in self.kept:
            known = self.kept.pop(place)
            if known.holds(given, motion):
                self.kept[place] = known
                return known.made
            self.size -= known.size
        seen, read = watched(motion)
        made = make(seen)
        new = _Made(given, {name: getattr(motion, name) for name in read}, made, _bytes_of(made))
        self.kept[place], self.size = new, self.size + new.size
        while self.size > MOST_BYTES:
            self.size -= self.kept.pop(next(iter(self.kept))).size
        return made


def _bytes_of(made: Any) -> int:
    """Bytes of the arrays in lists and mappings."""
    if isinstance(made, np.ndarray):
        return made.nbytes
    return sum(map(_bytes_of, made.values() if isinstance(made, dict) else made))


def white_level(values: np.ndarray, rate_hz: float, highest_hz: float = np.inf) -> float:
    """One-sigma of the white part of an evenly sampled signal: the lowest level of its spectrum, as if flat.

    Above `highest_hz` nobody looks: a gyroscope that smooths its own reading has next to no noise there, and all the
    same noise below.
    """
    finest_hz = 1.0
    # Samples of the pieces that spectra are averaged over (more where a bin would be wider than `finest_hz`), and bins
    # that are averaged.
    piece_samples, smoothed = 256, 9
    pieces = max(1, int(np.ceil(rate_hz / finest_hz / piece_samples)))
    most_noise_samples = 8192  # Samples of a column that its noise level is read from.
    values = values[np.isfinite(values)][: most_noise_samples * pieces]
    if len(values) < 64:
        return 0.0
    frequency, density = welch(values, fs=1.0, nperseg=min(piece_samples * pieces, len(values) // 2))
    smooth = np.convolve(density[2:], np.ones(smoothed) / smoothed, mode="valid")
    low = smooth[frequency[smoothed + 1 :] * rate_hz <= highest_hz]
    smooth = low if len(low) else smooth[:1]
    lowest_to_mean = 1.08
    # The lowest of some hundred smoothed levels lies below their mean.
    return float(lowest_to_mean * np.sqrt(max(smooth.min(), 0.0) / 2)) if len(smooth) else 0.0


def _own_rate_hz(run: Run, column: str) -> float:
    """Readings of a column per second."""
    count = int(np.isfinite(run.column(column)).sum())
    return count / max(float(run.time_s[-1] - run.time_s[0]), 1e-9)


def sensor_noise(runs: tuple[Run, ...], vehicle: Vehicle, cutoff_hz: float = np.inf) -> SensorNoise:
    """White noise per sample of each sensor, one sigma in the columns' own unit, from the data themselves.

    It is read below `noise_reach` times the cutoff of the analysis, at each sensor's own rate. Each axis has its own:
    rotors shake a frame unlike about its axes. Rotors are alike, and the components of an attitude mix as it turns.
    """
    groups = {
        "rotors": c.rotor_columns("rotor_speed", vehicle.rotor_count),
        "gyroscope": c.ANGULAR_VELOCITY,
        "accelerometer": c.SPECIFIC_FORCE,
        "velocity": c.VELOCITY,
        "position": c.POSITION,
        "attitude": c.QUATERNION,
    }
    levels = {}
    noise_reach = 5.0  # Highest frequency, over the cutoff of the analysis, that a sensor's noise is read from.
    for key, names in groups.items():
        found = [
            [white_level(run.column(n), _own_rate_hz(run, n), noise_reach * cutoff_hz) for n in names]
            for run in runs
            if names and run.has(*names)
        ]
        if found:
            alike = key in ("rotors", "attitude")
            levels[key] = np.full(len(names), np.median(found)) if alike else np.median(found, axis=0)
    return levels


def representative(runs: Sequence[Run], rate_hz: float) -> list[Run]:
    """The runs, or of such as last too long as many pieces of PIECE_S as may be analysed, spread evenly over them all.

    `rate_hz` is the rate of the analysis.
    """
    seconds = [float(run.time_s[-1] - run.time_s[0]) for run in runs]
    most_s = min(MOST_S, MOST_SAMPLES / rate_hz)
    if sum(seconds) <= most_s:
        return list(runs)
    pieces = [
        (run, part[0], part[-1] + 1)
        for run, length in zip(runs, seconds, strict=True)
        for part in np.array_split(np.arange(len(run.time_s)), max(1, int(length / _PIECE_S)))
    ]
    kept = np.unique(np.linspace(0, len(pieces) - 1, int(most_s / _PIECE_S)).round().astype(int))
    return [
        replace(run, table=run.table.iloc[first:stop].reset_index(drop=True))
        for run, first, stop in map(pieces.__getitem__, kept)
    ]


@dataclass
class Prepared:
    """A set ready for analysis."""

    recordings: RecordingSet
    vehicle: Vehicle
    split: Split
    segments: list[Segment]
    noisy_segments: list[Segment]
    thinner: Thinner
    noise: SensorNoise
    terms: list[Term]
    not_testable: dict[str, str] = field(default_factory=dict)
    unseen: tuple[str, ...] = ()
    """Names of the runs held out, of which nothing else is known here."""
    memory: LastMade = field(default_factory=LastMade)
    """Columns of the terms and what they are made of, as they were made last."""

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Channel groups that every segment has."""
        found = [set(residual(s, self.vehicle)) for s in self.segments]
        common = set.intersection(*found) if found else set()
        return tuple(g for g in ("force", "moment", "accelerometer", "gyroscope") if g in common)


def prior_of(key: str, vehicle: Vehicle) -> float:
    """Relative one-sigma of a believed value."""
    name = PARAMETER_NAMES[key]
    for candidate in (name, name.split("_kg_m2")[0], "inertia_kg_m2" if key.startswith("inertia") else name):
        if candidate in vehicle.trust:
            return max(vehicle.trust[candidate], 1e-6)
    return DEFAULT_TRUST["inertia" if key.startswith("inertia") else key]


def value_terms(vehicle: Vehicle, groups: Sequence[str], commanded: bool = False) -> list[Term]:
    """A term for each believed value that acts in the groups of channels.

    `commanded` says that commands alone tell how fast rotors turn.
    """
    values = {"thrust", "mass"} if "force" in groups else set()
    if "moment" in groups:
        values |= {"thrust", "torque", "inertia_xx", "inertia_yy", "inertia_zz", "arm"}
    if commanded:
        # Commands alone determine thrust per mass: C_F and mass are labels of one number, which the path holds.
        values = (values - {"thrust", "mass"}) | ({"lifted"} if {"force", "moment"} <= {*groups} else set())
    held_sd = 1e-6  # Relative one-sigma of a value that stays as believed.
    terms = [value_term(key, vehicle) for key in PARAMETER_NAMES if key in values]
    return [replace(t, kind="held", prior_sd=(held_sd,)) if t.key == "lifted" else t for t in terms]


def value_term(key: str, vehicle: Vehicle) -> Term:
    """The term of a believed value that is known by its trust."""
    return Term(key, "value", prior_sd=(prior_of(key, vehicle),))


def make_terms(vehicle: Vehicle, segments: list[Segment], groups) -> tuple[list[Term], dict[str, str]]:
    """Every term that this set can test, and the ids that it cannot, with the reason."""
    commanded = any(s.command is not None and not s.measured_speed for s in segments)
    terms, reasons = value_terms(vehicle, groups, commanded), {}
    longest_sample = max(1.0 / s.rate_hz for s in segments)
    partner = {
        "offset:rotors-accelerometer": "force",
        "offset:rotors-gyroscope": "moment",
        "offset:accelerometer-velocity": "accelerometer",
        "offset:gyroscope-attitude": "gyroscope",
    }
    for key in OFFSETS:
        if partner[key] in groups:
            terms.append(Term(key, "nuisance", prior_sd=(0.5 * longest_sample,)))
    for effect in (*catalogue().values(), *empirical_effects([s.motion for s in segments])):
        found, why = [], None
        for form in effect.forms(vehicle):
            reason = next((r for s in segments if (r := not_testable_reason(form, s.motion, vehicle))), None)
            if reason:
                why = why or reason
                continue
            found += form_terms(effect.id, form, guesses(form, segments, vehicle, groups))
        terms += found
        if why and not found and effect.id not in UNKNOWNS:
            reasons[effect.id] = why
    return terms, reasons


def guesses(form: Form, segments: list[Segment], vehicle: Vehicle, groups) -> tuple[tuple[float, ...], ...]:
    """Starting points of a form's nonlinear parameters that these recordings suggest."""
    if form.guess is None or "force" not in groups:
        return ()
    return form.guess([(s.motion, residual(s, vehicle)) for s in segments], vehicle)


@step("preparing")
def prepare(
    recordings: RecordingSet,
    cutoff_hz: float = HIGHEST_CUTOFF_HZ,
    shift_s: dict[str, float] | None = None,
    unseen: tuple[str, ...] = (),
) -> Prepared:
    """Segments, noise and terms of a set; `held_out` () of a set says that all of it is to be fitted.

    `unseen` names runs of the whole set that are not in it.
    """
    vehicle, split = recordings.vehicle, split_runs(recordings)
    rate_hz, cutoff = analysis_rate_hz(recordings.runs, vehicle, cutoff_hz)
    noise = sensor_noise(recordings.runs, vehicle, cutoff)
    segments, noisy, full = [], [], full_speed(recordings.runs, vehicle)
    runs = representative(recordings.runs, rate_hz)
    for run in runs:
        segments += build_segments(run, vehicle, rate_hz, cutoff, shift_s, full_speed_rad_s=full)
        noisy += build_segments(run, vehicle, rate_hz, cutoff, shift_s, noise, _draws_of(run, 0), full)
    if not segments:
        raise InputError(
            f"set {recordings.name}: no stretch of {SHORTEST_SEGMENT_S:g} s in which every sensor has readings is left "
            f"in {', '.join(run.name for run in recordings.runs)}"
        )
    thinner = Thinner(rate_hz, cutoff)
    if len(noisy) == len(segments) and rules.COLOURED_NOISE(
        bool(factors := noise_factors(segments, noisy, vehicle, thinner))
    ):
        noise = {k: v * factors.get(k, 1.0) for k, v in noise.items()}
        noisy = []
        for run in runs:
            noisy += build_segments(run, vehicle, rate_hz, cutoff, shift_s, noise, _draws_of(run, 1), full)
    noisy = without_noise(noisy) if len(noisy) == len(segments) else []
    segments = without_noise(segments)
    if made_from_accelerometer(segments, cutoff):
        segments, noisy = ([replace(s, independent_velocity=False) for s in own] for own in (segments, noisy))
    prepared = Prepared(recordings, vehicle, split, segments, noisy, thinner, noise, [], unseen=unseen)
    terms, reasons = make_terms(vehicle, segments, prepared.groups)
    return replace(prepared, terms=terms, not_testable=reasons)


def _draws_of(run: Run, number: int) -> np.random.Generator:
    """The noise that is added to a run once more, by what the run holds: its name and its place change no number."""
    names = [n for n in c.ANGULAR_VELOCITY if run.has(n)]
    signs = run.array(tuple(names)) > 0.0 if names else np.zeros(0, bool)  # signs outlive rounding
    return np.random.default_rng([number, len(run.time_s), zlib.crc32(np.packbits(signs).tobytes())])


def prepare_like(prepared: Prepared, recordings: RecordingSet) -> tuple[list[Segment], list[Segment]]:
    """Segments of other runs of the same vehicle, and the same with the noise that `prepared` found added once more."""
    vehicle = prepared.vehicle
    full = full_speed(prepared.recordings.runs, vehicle)
    segments, noisy, rate_hz = [], [], prepared.segments[0].rate_hz
    for run in representative(recordings.runs, rate_hz):
        own = run, vehicle, rate_hz, prepared.thinner.cutoff_hz, None
        segments += build_segments(*own, full_speed_rad_s=full)
        noisy += build_segments(*own, prepared.noise, _draws_of(run, 1), full)
    noisy = without_noise(noisy) if len(noisy) == len(segments) else []
    same = prepared.segments[0].independent_velocity
    segments, noisy = ([replace(s, independent_velocity=same) for s in own] for own in (without_noise(segments), noisy))
    return segments, noisy


def _model_wrench(segment: Segment, vehicle: Vehicle, effects: list[tuple[Form, np.ndarray]]):
    """Force and moment of the baseline plus effects, native rate, for the accelerations in regressors."""
    force, arm, torque = baseline_wrench(segment.motion, vehicle)
    total = {"force": force, "moment": arm + torque}
    for form, values in effects:
        part = form.contribution(segment.motion, vehicle, values)
        if part.force is not None:
            total["force"] = total["force"] + part.force
        if part.moment is not None:
            total["moment"] = total["moment"] + part.moment
    return total


def with_predictions(segment: Segment, prepared: Prepared, effects: list[tuple[Form, np.ndarray]]) -> Segment:
    """The segment with the accelerations that the baseline plus `effects` predicts, for use in regressors.

    What the accelerometer's own errors multiply is the baseline's alone where the accelerometer is the only source:
    a scale error of readings that an effect makes would be that effect's exact copy.

    The measured ones are the response itself: a column s·a with a response m·a fits anything perfectly, and
    the noise of a differentiated body rate would bias every coefficient that multiplies it.
    """
    vehicle, groups = prepared.vehicle, prepared.groups

    def predicted(motion: Motion) -> dict[str, np.ndarray]:
        model = _model_wrench(replace(segment, motion=motion), vehicle, [])
        changed = accelerations(motion, model, model)
        if not effects:
            return changed
        # Effects that read accelerations are given predicted ones, too.
        at = replace(segment, motion=replace(motion, **changed))
        return accelerations(motion, _model_wrench(at, vehicle, effects), model)

    def accelerations(motion: Motion, known: dict[str, np.ndarray], model: dict[str, np.ndarray]):
        changed = {}
        if motion.specific_force is not None:
            changed["specific_force"] = known["force"] / vehicle.mass_kg
            if motion.accelerometer is not None:
                changed["accelerometer"] = (known if "accelerometer" in groups else model)["force"] / vehicle.mass_kg
        if motion.angular_acceleration is not None:
            inertia, rate = vehicle.inertia_kg_m2.matrix(), motion.angular_velocity
            turning = known["moment"] - np.cross(rate, rate @ inertia)
            changed["angular_acceleration"] = high_passed(turning @ np.linalg.inv(inertia), segment.rate_hz)
        return changed

    given = (vehicle, groups, *((form, *values) for form, values in effects))
    changed = prepared.memory.made(("predicted",), given, segment.motion, predicted)
    return replace(segment, motion=replace(segment.motion, **changed))


def with_thrusts(motion: Motion, vehicle: Vehicle, effects: list[tuple[Form, np.ndarray]]) -> Motion:
    """The motion with the thrust of each rotor scaled so that all of them push as the effects on rotors have it.

    What those do to the thrust is seldom known rotor by rotor; of the believed thrusts each takes the same share. A
    payload, a drag of the frame or an offset act on the body: the rotors push as before.
    """
    believed = rotor_thrusts(motion, vehicle)
    total = believed.sum(axis=1)
    upward = total.copy()
    for form, values in effects:
        if "rotor_speed" in form.requires and not _OF_THE_BODY & set(form.requires):
            force = form.contribution(motion, vehicle, values).force
            upward -= 0.0 if force is None else force[:, 2]
    share = np.divide(upward, total, out=np.ones_like(total), where=total > 0.0)
    return replace(motion, rotor_thrust=believed * share[:, None])


def _wind_columns(segment: Segment, vehicle: Vehicle, groups, effects) -> list[dict[str, np.ndarray]]:
    """What one metre a second more wind from each of north and east adds through the effects that feel the air."""
    wind = np.zeros(3) if segment.motion.wind is None else segment.motion.wind
    columns = []
    for axis in range(2):
        parts = []
        for sign in (0.5, -0.5):
            step = np.zeros(3)
            step[axis] = sign
            moved = replace(segment.motion, wind=wind + step)
            total: dict[str, np.ndarray] = {}
            for form, values in effects:
                for name, part in project(form.contribution(moved, vehicle, values), segment, vehicle, groups).items():
                    total[name] = total.get(name, 0.0) + part
            parts.append(total)
        columns.append({k: parts[0][k] - parts[1][k] for k in parts[0]})
    return columns


def _at_knots(columns: list[dict[str, np.ndarray]], knots_s: np.ndarray, time_s: np.ndarray):
    """Columns (north, east) of a wind that is a line from knot to knot, of each knot in turn; nothing outside."""
    hats = [np.interp(time_s, knots_s, unit, left=0.0, right=0.0)[:, None] for unit in np.eye(len(knots_s))]
    return [{group: part * hat for group, part in column.items()} for column in columns for hat in hats]


def assemble_rows(
    prepared: Prepared,
    terms: list[Term],
    segments: list[Segment] | None = None,
    effects: list[tuple[Form, np.ndarray]] | None = None,
    measured_moment: bool = False,
    for_comparison: bool = False,
) -> list[Rows]:
    """Rows of every segment for the given terms; `effects` only shape the accelerations in regressors.

    `measured_moment` puts the measured moments into the value columns in place of the predicted ones. With
    `for_comparison` the value columns keep the low frequencies of predicted angular accelerations, and rotors push as
    the effects have it (`with_thrusts`).
    """

    def rows_of(segment: Segment) -> Rows:
        blocks = chain.from_iterable(
            columns_of(segment, prepared, terms, effects or [], measured_moment, for_comparison)
        )
        return assemble(segment, prepared.vehicle, prepared.thinner, list(blocks))

    return [rows_of(s) for s in segments or prepared.segments]


def columns_of(
    segment: Segment,
    prepared: Prepared,
    terms: list[Term],
    effects: list[tuple[Form, np.ndarray]],
    measured_moment: bool,
    for_comparison: bool,
) -> Iterator[list[Block]]:
    """Columns of every term in a segment, thinned.

    The columns of believed values are built on the baseline alone: with effects in them, a thrust and a mass that
    grow together would leave a copy of the effects for themselves, and loose trust in values would swallow physics.
    """
    vehicle, groups, made = prepared.vehicle, prepared.groups, prepared.memory.made
    flown, same = segment, (vehicle, groups, segment.independent_velocity)
    if segment.motion.rotor_speed is not None:
        segment = with_predictions(flown, prepared, effects)
        if for_comparison:
            segment = replace(segment, motion=with_thrusts(segment.motion, vehicle, effects))

    def thinned(blocks: Iterable[Block]) -> list[Block]:
        return [{g: prepared.thinner(np.ascontiguousarray(part)) for g, part in block.items()} for block in blocks]

    def of_effect(term: Term, motion: Motion) -> list[Block]:
        return thinned(form_columns(term.form, term.values, replace(segment, motion=motion), vehicle, groups))

    def of_value(term: Term, motion: Motion) -> list[Block]:
        at = replace(flown, motion=motion)
        model = _model_wrench(at, vehicle, [])
        reverse = moment_of(at, vehicle) if measured_moment and "moment" in groups else None
        return thinned([value_columns(term.key, at, vehicle, groups, model, reverse, for_comparison)])

    for term in terms:
        if term.run and term.run != segment.run:
            yield [{}] * term.size
        elif term.kind == "wind":
            columns = _wind_columns(segment, vehicle, groups, effects)
            yield thinned(_at_knots(columns, np.array(term.values), segment.motion.time_s) if term.run else columns)
        elif term.kind == "slope":
            yield thinned([slope_column(term, segment, vehicle, groups)])
        elif term.kind == "state":
            yield thinned([state_column(term, segment, vehicle, groups)])
        elif term.kind == "effect":
            given = (*same, term.form, term.values)
            yield made((term.key,), given, segment.motion, partial(of_effect, term))
        elif term.kind in ("value", "held"):
            yield made((term.key,), (*same, measured_moment, for_comparison), flown.motion, partial(of_value, term))
        else:
            yield thinned([offset_columns(term.key, segment, vehicle, groups)])


__all__ = ["Prepared", "assemble_rows", "prepare", "project", "split_runs"]
