"""What in a flight cannot be right, by physics that every multirotor obeys.

Thrust carries the weight, the accelerometer feels the thrust and not gravity, the gyroscope is the derivative of the
attitude, rotors on the left roll the vehicle to the right. Each doubt is one sentence with the numbers that raised it
and what most often causes them. Nothing is corrected here; limits are wide, since the believed vehicle may be wrong,
too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from difflib import get_close_matches

import numpy as np
import scipy

from rotorid.io.text.wording import listed
from rotorid.recordings import columns as c
from rotorid.recordings.body import Body, body_of, impossible, quantities
from rotorid.recordings.run import Doubt, RecordingSet, Run, means_of
from rotorid.recordings.sufficient import driven_by
from rotorid.recordings.vehicle import Vehicle

_STEP_S = 0.02
"""Step of the common clock; what is compared is slower than some hertz."""
_SMOOTH_S = 0.1
_LONGEST_GAP_S = 0.25
_GRAVITY_M_S2 = (9.5, 10.1)
_LIFT_M_S2 = (5.0, 20.0)
"""Where the median of an accelerometer in flight lies, in its unit and axes."""
_HIGHEST_VOLTAGE_V = 120.0
_FASTEST_USUAL_RAD_S = 20.0
_SLOWEST_HZ = 30.0
"""Readings a second below which lines between them change what a verdict says of rotors."""
_FOLLOWS = 0.8
"""Correlation of a rotor's speed with a command from which it follows that command."""
_LEAST_TURNING_RAD_S = 0.05
"""Spread of a body rate below which nothing can be said of it."""
_AGREES, _CONTRADICTS = 0.5, -0.3
"""Correlations: above, two signals agree; below, one of them is turned round."""
_TOP = 0.99
"""Share of the rotor speeds below their highest that counts: single samples may be faults."""
_SLOW_S, _LATEST_STEPS, _LEAST_EXPLAINED = 0.5, 4, 0.4
"""Regression of turning on rotor speeds: slower changes left out, latest lag tried, least share explained."""
_SURE_Z, _ALIKE, _RIDGE = 6.0, 5.0, 0.02
"""Standard errors by which a rotor's sign must be sure; samples that count as one; ridge, a share of the regressors."""
_DEGREE = np.pi / 180
_LEAST_TIME_S = 20.0
_MOST_S = 7200.0
"""How much of a run is looked at: a clock that was set on the way would need more memory than there is."""
_AT_REST = 0.2
"""Share of the median rotor speed below which a rotor counts as at rest."""


def physical_doubts(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """What cannot be right in a set of kind `flight`; empty where all agrees."""
    looks = _accelerometer, _gyroscope, _world, _rotors, _throttle, _command_order, _held, _joined, _rest
    found = [
        (run.name, doubt)
        for run in recordings.runs
        if (clock := _clock(run)) is not None
        for look in looks
        for doubt in look(run, clock, recordings.vehicle)
    ]
    return (*_once(found), *_amount(recordings))


def _once(found: list[tuple[str, Doubt]]) -> list[Doubt]:
    """Doubts by run as one for each thing in doubt: the first run's, with the number of runs that repeat it."""
    alike: dict[tuple[str, str], list[tuple[str, Doubt]]] = {}
    for run, doubt in found:
        # Numbers differ between runs.
        alike.setdefault((doubt.what, re.sub(r"[-\d.]+", "", doubt.sentence)), []).append((run, doubt))
    out = []
    for (run, first), *others in alike.values():
        end = "" if first.sentence.endswith((".", "?")) else "."
        more = f"{end} The same in {len(others)} more." if others else ""
        out.append(replace(first, sentence=f"{run}: {first.sentence}{more}"))
    return out


# Common clock -------------------------------------------------------------------------------------


def _clock(run: Run) -> np.ndarray | None:
    duration = float(run.time_s[-1] - run.time_s[0])
    if not duration > 2.0:
        return None
    return np.arange(run.time_s[0], run.time_s[0] + min(duration, _MOST_S), _STEP_S)


def _on(run: Run, clock: np.ndarray, names: tuple[str, ...], smooth_s: float = _SMOOTH_S) -> np.ndarray | None:
    """Columns as means over `smooth_s` on the common clock, (n, k), NaN in gaps; None where one is missing."""
    if not run.has(*names):
        return None
    values = run.array(names)
    known = np.isfinite(values).all(axis=1)
    if known.sum() < 10:
        return None
    time, values = run.time_s[known], values[known]
    first, last = (np.searchsorted(time, clock + side * smooth_s / 2) for side in (-1, 1))
    mean, count = means_of(values, first, last), last - first
    line = np.column_stack([np.interp(clock, time, column) for column in values.T])
    near = np.clip(np.searchsorted(time, clock), 1, len(time) - 1)
    gap = time[near] - time[near - 1]
    out = np.where((count > 0)[:, None], mean, line)
    out[(gap > _LONGEST_GAP_S) & (count == 0)] = np.nan
    return out


def _speeds(run: Run, clock: np.ndarray, vehicle: Vehicle, smooth_s: float = _SMOOTH_S) -> np.ndarray | None:
    """Rotor speeds (n, rotors), rad/s: measured, else commanded, else throttle times the upper limit."""
    *speeds, throttle = vehicle.rotor_groups().values()
    for names in speeds:
        if (values := _on(run, clock, names, smooth_s)) is not None:
            return values
    shares, limits = _on(run, clock, throttle, smooth_s), vehicle.rotor_speed_limits_rad_s
    return None if shares is None or limits is None else shares * limits[1]


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    known = np.isfinite(a) & np.isfinite(b)
    a, b = a[known], b[known]
    if len(a) < 50 or a.std() == 0 or b.std() == 0:
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def _flown(run: Run, vehicle: Vehicle) -> tuple[tuple[float, float], float | None, str] | None:
    """What a run says about the rotors in the air (on a stand: turning), as `body_of` takes it.

    Speeds at hover and at the most, lift, first column; None where the run is short or says nothing.
    """
    clock = _clock(run)
    speeds = None if clock is None else _speeds(run, clock, vehicle)
    if clock is None or speeds is None or not np.isfinite(speeds).any():
        return None
    coefficients = vehicle.thrust_coefficients_n_s2()
    thrust = float(np.nanmedian((coefficients * speeds**2).sum(axis=1)))
    if not thrust > 0:
        return None
    force = _on(run, clock, c.SPECIFIC_FORCE)
    lift = None if force is None else -float(np.nanmedian(force[:, 2]))
    if lift is None or not _LIFT_M_S2[0] < lift < _LIFT_M_S2[1]:
        lift = 9.81  # On average thrust balances weight in a flight; a wrong accelerometer is a doubt of its own.
    hover, top = float(np.sqrt(thrust / coefficients.sum())), float(np.nanquantile(speeds, _TOP))
    return (hover, top), lift if vehicle.kind == "flight" else None, driven_by(run, vehicle)[0]


def impossible_values(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """Believed values that no multirotor has together, by the rotor speeds of each run; each value once."""
    vehicle = recordings.vehicle
    speeds = {run.name: x for run in recordings.runs if (x := _flown(run, vehicle))} or {"": ()}
    bodies: dict[tuple[int, ...], tuple[Body, list[str]]] = {}
    for run, turning in speeds.items():
        body = body_of(vehicle, *turning)
        if body is None:
            return ()
        # Runs in which the same quantities are wrong have the same cause.
        wrong = tuple(number for number, q in enumerate(quantities(body)) if not q.fits)
        bodies.setdefault(wrong, (body, []))[1].append(run)
    found: dict[str, tuple[Doubt, list[str]]] = {}
    for body, alike in bodies.values():
        for doubt in impossible(body):
            found.setdefault(doubt.what, (doubt, []))[1].extend(alike)
    return tuple(
        doubt if len(runs) == len(speeds) else replace(doubt, sentence=f"{listed(runs)}: {doubt.sentence}")
        for doubt, runs in found.values()
    )


def gravity(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """A gravity that is not the earth's."""
    value, (low, high) = recordings.vehicle.gravity_m_s2, _GRAVITY_M_S2
    if low <= value <= high:
        return ()
    units = [
        unit for unit, factor in {"g": 9.81, "ft/s²": 0.3048, "cm/s²": 0.01}.items() if low <= value * factor <= high
    ]
    fits = f"; {units[0]} would fit" if units else ""
    sentence = f"gravity_m_s2 = {value:g}: expected that of the earth, {low:g} to {high:g} m/s²{fits}"
    return (Doubt("gravity_m_s2", sentence, stops=True),)


def voltages(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """A battery that no voltmeter reads in volts, in the first run that has it."""
    name = c.BATTERY_VOLTAGE
    for run in recordings.runs:
        middle = float(np.nanmedian(run.column(name))) if run.has(name) else 0.0
        if middle < 0:
            said = "the sign is turned"
        elif middle > _HIGHEST_VOLTAGE_V:
            said = "mV would fit" if 2 < middle / 1e3 < _HIGHEST_VOLTAGE_V else "0.1 V would fit"
        else:
            continue
        sentence = f"{run.name}: {name} has a median of {middle:.4g}, expected 0 to {_HIGHEST_VOLTAGE_V:g} V: {said}"
        return (Doubt(name, sentence, stops=True),)
    return ()


# Doubts -------------------------------------------------------------------------------------------


def _accelerometer(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether it feels the thrust that carries the vehicle, in m/s² and along -z."""
    force = _on(run, clock, c.SPECIFIC_FORCE)
    if force is None:
        return
    middle = np.nanmedian(force, axis=0)
    size = float(np.linalg.norm(middle))
    axis, seen = "z", f"the accelerometer's median is {size:.3g}"
    if middle[2] > 0.5 * size and size > 0.5:
        said = (
            f"specific_force_z_m_s2 is positive in flight (median {middle[2]:.3g}), expected about -9.8: the body axes "
            "are forward-left-up, or the sign is turned"
        )
    elif 0.5 < size < 2.0:
        said = f"{seen}, expected about 9.8 m/s²: it is in multiples of g"
    elif size <= 0.5:
        said = f"{seen} m/s², expected about 9.8: gravity was added back, but a specific force holds none"
    elif size > _LIFT_M_S2[1]:
        scales = {"ft/s²": 28 < size < 37, "milli-g": 700 < size < 1400, "cm/s²": 700 < size / 9.81 < 1400}
        unit = next((unit for unit, fits in scales.items() if fits), "")
        said = f"the accelerometer's median is {size:.4g}, expected about 9.8 m/s²"
        said += f": {unit} would fit" if unit else ""
    elif -middle[2] < 0.7 * size:
        axis = "xyz"[int(np.argmax(np.abs(middle)))]
        said = f"the accelerometer feels the thrust along {axis}, not along -z: its axes are not the body's"
    else:
        return
    yield Doubt(f"specific_force_{axis}_m_s2", said, stops=True)


def _gyroscope(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether it is the derivative of the attitude; without one, whether anything turns so fast."""
    gyro, attitude = _on(run, clock, c.ANGULAR_VELOCITY), _on(run, clock, c.QUATERNION)
    if gyro is None:
        return
    if attitude is None:
        usual = float(np.nanmedian(np.linalg.norm(gyro, axis=1)))
        if usual > _FASTEST_USUAL_RAD_S:
            yield Doubt(
                c.ANGULAR_VELOCITY[0],
                f"the vehicle turns at {usual:.3g} rad/s in the median, expected at most {_FASTEST_USUAL_RAD_S:g}: the "
                "gyroscope is in degrees per second, in counts, or ten times too large",
                stops=True,
            )
        return
    # Body rates, rad/s, of the attitude on the common clock; NaN at gaps and ends.
    derived = np.full((len(attitude), 3), np.nan)
    norm = np.linalg.norm(attitude, axis=1)
    known = np.isfinite(norm) & (norm > 0.1)
    both = known[:-2] & known[2:]
    first, last = attitude[:-2][both], attitude[2:][both]
    start, stop = (scipy.spatial.transform.Rotation.from_quat(mean[:, [1, 2, 3, 0]]) for mean in (first, last))
    turn = start.inv() * stop
    derived[1:-1][both] = turn.as_rotvec() / (2 * _STEP_S)
    for k, axis in enumerate("xyz"):
        if not np.nanstd(derived[:, k]) > _LEAST_TURNING_RAD_S:
            continue
        r = _correlation(gyro[:, k], derived[:, k])
        scale = float(np.nanstd(gyro[:, k]) / np.nanstd(derived[:, k]))
        name = f"angular_velocity_{axis}_rad_s"
        said = ""
        if r < _CONTRADICTS:
            said = (
                f"{name} turns against the attitude (correlation {r:.2f}): body axes of gyroscope and attitude differ, "
                "or the quaternion is the inverse one"
            )
        elif r > _AGREES and 0.5 < scale * _DEGREE < 2:
            said = f"{name} is {scale:.3g} times the derivative of the attitude: it is in degrees per second"
        elif r > _AGREES and not 0.5 < scale < 2:
            said = f"{name} is {scale:.3g} times the derivative of the attitude"
        elif np.isfinite(r) and r < 0.2:
            others = [abs(_correlation(gyro[:, k], derived[:, j])) for j in range(3)]
            best = int(np.nanargmax(others))
            if others[best] > 0.6 and best != k:
                said = f"{name} follows the attitude about {'xyz'[best]}, not about {axis}: the axes are exchanged"
        if said:
            yield Doubt(name, said, stops=True)


def _world(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether velocity, position, attitude and specific force agree on world axes and units."""
    same_unit = (0.2, 5.0)  # Of two signals that agree, the ratio of their spreads that noise and smoothing explain.
    attitude, force = _on(run, clock, c.QUATERNION), _on(run, clock, c.SPECIFIC_FORCE)
    velocity, position = _on(run, clock, c.VELOCITY), _on(run, clock, c.POSITION)
    if velocity is not None and position is not None:
        derived = np.gradient(position, _STEP_S, axis=0)
        for k, axis in enumerate("xyz"):
            if not np.nanstd(velocity[:, k]) > 0.2:
                continue
            own, place = f"velocity_{axis}_m_s", f"position_{axis}_m"
            r = _correlation(velocity[:, k], derived[:, k])
            scale = float(np.nanstd(velocity[:, k]) / max(np.nanstd(derived[:, k]), 1e-300))
            what = own
            if r < _CONTRADICTS:
                said = f"{own} goes against the derivative of {place} (correlation {r:.2f})"
            elif r < 0.2:
                said = (
                    f"{own} does not follow {place} (correlation {r:.2f}): one of them is in body axes, or axes are "
                    "exchanged"
                )
            elif r > _AGREES and not same_unit[0] < scale < same_unit[1]:
                # Units that are used as well as metres are smaller: the column with the larger numbers is the one.
                what, which = (own, "the velocity") if scale > 1 else (place, "the position")
                said = f"{own} is {scale:.3g} times the derivative of {place}, expected 1: {which} is in another unit"
            else:
                continue
            yield Doubt(what, said, stops=True)
    if attitude is None or force is None:
        return
    known = np.isfinite(attitude).all(axis=1) & np.isfinite(force).all(axis=1)
    known &= np.linalg.norm(np.nan_to_num(attitude), axis=1) > 0.1
    if known.sum() < 50:
        return
    turn = scipy.spatial.transform.Rotation.from_quat(attitude[known][:, [1, 2, 3, 0]])
    world = turn.apply(force[known])
    if np.median(world[:, 2]) > 5.0 and np.median(force[known][:, 2]) < 0:
        yield Doubt(
            c.QUATERNION[0],
            "turned into the world, the accelerometer points down: the attitude refers to axes with z up",
            stops=True,
        )
    if velocity is None:
        return
    change = np.gradient(velocity, _STEP_S, axis=0)[known]
    for k, axis in enumerate("xy"):
        if np.nanstd(world[:, k]) > 0.5 and np.nanstd(change[:, k]) > 0.5:
            r = _correlation(world[:, k], change[:, k])
            if r < _CONTRADICTS:
                yield Doubt(
                    f"velocity_{axis}_m_s",
                    f"the velocity along {axis} changes against the tilt of the thrust (correlation {r:.2f}): world "
                    "axes of attitude and velocity differ",
                    stops=True,
                )


def _band(values: np.ndarray) -> np.ndarray:
    """What is faster than `_SLOW_S`: the values less their mean over it, (n, k)."""
    width = int(_SLOW_S / _STEP_S)
    index = np.arange(len(values))
    first, last = np.maximum(index - width // 2, 0), np.minimum(index + width // 2 + 1, len(values))
    return values - means_of(values, first, last)


def _pushes(speeds: np.ndarray, gyro: np.ndarray) -> np.ndarray | None:
    """Sign of what each rotor does to roll and pitch, (2, rotors), by a regression of the turning on squared speeds.

    The lag of the motors that explains most is taken. 0 where a rotor's part is not sure; None where the rotors explain
    too little.
    """
    known = np.isfinite(speeds).all(axis=1) & np.isfinite(gyro).all(axis=1)
    if known.mean() < 0.8 or not (np.ptp(speeds[known], axis=0) > 0).any():
        return None
    clean = [np.where(known[:, None], x, np.nanmean(x, axis=0)) for x in (speeds**2, gyro)]
    push, turning = _band(clean[0] / clean[0].mean()), np.gradient(_band(clean[1]), _STEP_S, axis=0)[:, :2]
    # All rotors together turn nothing: what they share is left out, and a mixture hardly flown is held small (ridge).
    push = push - push.mean(axis=1, keepdims=True)
    held = _RIDGE * np.trace(push.T @ push) / push.shape[1] * np.eye(push.shape[1])
    best: tuple[float, np.ndarray] | None = None
    for late in range(_LATEST_STEPS + 1):
        x, y = push[: len(push) - late], turning[late:]
        inverse = np.linalg.inv(x.T @ x + held)
        fit = inverse @ x.T @ y
        rest = y - x @ fit
        explained = float((1 - (rest**2).sum(axis=0) / (y**2).sum(axis=0)).min())
        if best is None or explained > best[0]:
            # Neighbours are alike over a few samples: errors by as many fewer.
            spread = np.sqrt(np.diag(inverse @ x.T @ x @ inverse)[:, None] * rest.var(axis=0) * _ALIKE)
            best = explained, np.where(np.abs(fit) > _SURE_Z * spread, np.sign(fit), 0.0).T
    return best[1] if best is not None and best[0] > _LEAST_EXPLAINED else None


def _rotors(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether each rotor turns the vehicle as its place says; if not, where it seems to sit."""
    speeds, gyro = _speeds(run, clock, vehicle, 2 * _STEP_S), _on(run, clock, c.ANGULAR_VELOCITY, 2 * _STEP_S)
    if speeds is None or gyro is None or vehicle.rotor_count < 3:
        return
    if not (np.nanstd(gyro[:, :2], axis=0) > _LEAST_TURNING_RAD_S).all():
        return
    found = _pushes(speeds, gyro)
    if found is None or (np.abs(found).sum(axis=1) < vehicle.rotor_count - 1).any():
        return
    places = vehicle.rotor_positions_m()
    stated = np.array([-np.sign(places[:, 1]), np.sign(places[:, 0])])
    wrong = [i + 1 for i in range(vehicle.rotor_count) if (found[:, i] * stated[:, i] < 0).any()]
    if not wrong:
        return
    sure = [i for i in range(vehicle.rotor_count) if found[:, i].all()]
    ends = [("front" if found[1, i] > 0 else "rear", "right" if -found[0, i] > 0 else "left") for i in sure]
    seats = ", ".join(f"{i + 1} {end} {side}" for i, (end, side) in zip(sure, ends, strict=True))
    rotors = f"rotor {wrong[0]} does" if len(wrong) == 1 else f"rotors {', '.join(map(str, wrong))} do"
    yield Doubt(
        "rotors",
        f"{rotors} not turn the vehicle as the stated places say; by roll and pitch they sit: {seats}: look at the "
        "order of the rotors, or at the signs of the body axes",
        stops=True,
    )


def _command_order(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether each rotor's measured speed follows its own command; if not, which one it follows."""
    speeds, *asked = (_on(run, clock, names, 2 * _STEP_S) for names in vehicle.rotor_groups().values())
    commands = next((own for own in asked if own is not None), None)
    if speeds is None or commands is None or vehicle.rotor_count < 3:
        return
    known = np.isfinite(speeds).all(axis=1) & np.isfinite(commands).all(axis=1)
    # By how they differ from each other: all of them grow together when the vehicle climbs.
    apart = [own[known] - own[known].mean(axis=1, keepdims=True) for own in (speeds, commands)]
    if known.sum() < 100 or not all((own.std(axis=0) > 0).all() for own in apart):
        return
    alike = np.corrcoef(*(own.T for own in apart))[: vehicle.rotor_count, vehicle.rotor_count :]
    if (alike.argmax(axis=1) == np.arange(vehicle.rotor_count)).all():
        return
    _, follows = scipy.optimize.linear_sum_assignment(alike, maximize=True)
    wrong = [i for i, k in enumerate(follows) if i != k]
    if wrong and alike[wrong, follows[wrong]].min() > _FOLLOWS and alike[wrong, wrong].max() < 0.5 * _FOLLOWS:
        pairs = ", ".join(f"rotor {i + 1} follows command {follows[i] + 1}" for i in wrong)
        yield Doubt("rotors", f"commands and measured speeds are in different orders: {pairs}", stops=True)


def _throttle(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether throttles are fractions."""
    names = [n for n in c.rotor_columns("throttle", vehicle.rotor_count) if run.has(n)]
    if not names:
        return
    values = run.array(tuple(names))
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if low < -0.01 or high > 1.01:
        how = "µs (1000 to 2000)" if 800 < high < 2500 else "percent" if 2 < high <= 100 else "another range"
        yield Doubt(
            names[0], f"throttle runs from {low:.4g} to {high:.4g}, expected 0 to 1: it is in {how}", stops=True
        )


def _held(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Rotor speeds that keep one value while the vehicle moves: they were not measured."""
    names = driven_by(run, vehicle)
    held = [name for name in names if np.nanmin(run.column(name)) == np.nanmax(run.column(name))]
    if held:
        value = float(np.nanmax(run.column(held[0])))
        yield Doubt(
            held[0],
            f"{listed(held)} {'keeps' if len(held) == 1 else 'keep'} one value ({value:.4g}) throughout, expected the "
            "changes that keep a vehicle in the air: not measured, or a sensor that stands still",
        )


def _joined(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Rotor speeds, rates and specific forces that were interpolated linearly between rarer readings."""
    # Samples, share of them on straight lines, and a bend, over the largest value, below which a line is straight as
    # far as it was written, and how many times that bends are where lines meet.
    least_joined, mostly, rounded, sharp = 200, 0.6, 2e-6, 30.0
    for names in (c.rotor_columns("rotor_speed", vehicle.rotor_count), c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE):
        values = run.array(names) if run.has(*names) else np.zeros((0, 1))
        values = values[np.isfinite(values).all(axis=1)]
        if len(values) < least_joined:
            continue
        steps, kinks = np.abs(np.diff(values, axis=0)), np.abs(np.diff(values, 2, axis=0))
        apart = np.diff(np.unique(values))  # as far as readings were rounded
        rounding = float(apart[apart > 1e-9 * np.abs(values).max()].min(initial=np.inf))
        least = np.full(values.shape[1], max(rounded * float(np.abs(values).max()), 2.1 * rounding))
        straight = (kinks <= least) & (steps[1:] > least)
        # Smooth signals are nearly straight as well, but nowhere is there a sharp bend.
        share, bends = straight.mean(), kinks / np.maximum(least, 1e-300)
        if share > mostly and np.median(bends[~straight]) > sharp:
            rate_hz = (1.0 - float(share)) * (len(values) - 1) / float(run.time_s[-1] - run.time_s[0])
            yield Doubt(
                names[0],
                f"{listed(names)} lie on straight lines between about {rate_hz:.2g} readings a second: interpolated, "
                "which looks like a lag; expected the readings themselves, and empty cells between them",
                stops=rate_hz < _SLOWEST_HZ,
            )


def _rest(run: Run, clock: np.ndarray, vehicle: Vehicle) -> Iterator[Doubt]:
    """Whether the vehicle stood on the ground for a part of the run."""
    speeds, _, throttles = vehicle.rotor_groups().values()
    names = next((names for names in (speeds, throttles) if run.has(*names)), ())
    if not names:
        return
    mean = np.abs(run.array(names)[run.complete(names)]).mean(axis=1)
    at_rest = float((mean < _AT_REST * np.median(mean[mean > 0])).mean()) if (mean > 0).any() else 1.0
    if at_rest > 0.02:
        yield Doubt(
            names[0],
            f"all rotors are at rest in {at_rest:.0%} of the samples: keep only the part in the air",
        )


def _amount(recordings: RecordingSet) -> Iterator[Doubt]:
    """Doubts about how much there is and how often it was sampled."""
    total = sum(float(r.time_s[-1] - r.time_s[0]) for r in recordings.runs)
    if total < _LEAST_TIME_S:
        sentence = f"Only {total:.0f} s are recorded: intervals will be wide; {_LEAST_TIME_S:g} s and more are better."
        yield Doubt(c.TIME, sentence)
    speeds = c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count)
    lag = "a lag of the motors, of some 50 ms, cannot be distinguished from a delay"
    for name, columns, least, cost in (
        ("rotor speeds", speeds, 25.0, lag),
        ("body rates", c.ANGULAR_VELOCITY, 50.0, "moments are known only below a few hertz"),
        ("accelerometer", c.SPECIFIC_FORCE, 50.0, "forces are known only below a few hertz"),
        ("attitude", c.QUATERNION, 20.0, "wind and drag are known only below a few hertz"),
    ):
        rates = []
        for run in recordings.runs:
            if run.has(*columns):
                rates.append(run.complete(columns).sum() / max(float(run.time_s[-1] - run.time_s[0]), 1e-9))
        if rates and min(rates) < least:
            come = "come" if name.endswith("s") else "comes"
            said = f"The {name} {come} at {min(rates):.3g} Hz, {least:g} Hz and more are better: {cost}."
            yield Doubt(columns[0], said)


def near_names(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """Columns that are kept without a meaning but are nearly one that has a meaning."""
    count = max(recordings.vehicle.rotor_count, 1)
    known = [*c.FIXED, *(n for k in ("rotor_speed", "rotor_command", "throttle") for n in c.rotor_columns(k, count))]
    there = {n for run in recordings.runs for n in run.table.columns}
    out = []
    for name in sorted(there - set(known)):
        near = [n for n in get_close_matches(name, known, 1, 0.85) if n not in there]
        if near and not c.is_known(name):
            out.append(Doubt(name, f"Column {name} is not known; did you mean {near[0]}?"))
    return tuple(out)
