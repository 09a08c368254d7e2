"""What differs between flights before any cause is sought, next to how much flights differ in which nothing changed.

Every flight has a number v of each quantity (`_quantities`) at the conditions that all flights share. The difference of
two sets' means follows Student's t by two yardsticks, of which the rarer counts, twice:

- s² of the flights about the mean of their own set, joined with what is usual in other laboratories and weighed by
  degrees of freedom (Smyth, Statistical Applications in Genetics and Molecular Biology 3, 2004, eq. 3: a moderated t);
- the largest scatter that the flights of any laboratory showed, taken as known.

No flight is known better than its own pieces tell. Of a slope only what a closed loop cannot feign counts (`_slope`).
A false-alarm rate counts all quantities that are looked at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import polygamma, stdtr, stdtrit

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.mismatch.changes.quantities import (
    BY_VOLTAGE,
    CONDITIONS,
    DOUBT_OF_VOLTAGE,
    KINDS,
    PART,
    SLOPES,
    VELOCITY,
    Flown,
    Quantity,
    flown,
    grid_of,
)
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.recordings.sufficient import mended_alike
from rotorid.steps import step

FALSE_ALARMS = 0.01
"""Share of comparisons in which nothing changed that may state something, all quantities together."""
BUDGET = {
    "share": 0.3,
    "trim": 0.15,
    "yaw_trim": 0.05,
    "lift": 0.15,
    "lift_of_throttle": 0.15,
    "lift_without_voltage": 0.15,
    "sideways": 0.1,
    "accelerometer": 0.1,
    "gyroscope_scale": 0.1,
    "follows": 0.025,
    "gyroscope": 0.025,
    "gyroscope_turn": 0.025,
    "drag": 0.025,
    "noise": 0.05,
}
"""Weight of each kind in the false alarms, shared evenly by its members: what pilots break has more."""
_LIFT = ("mass_kg", "thrust_coefficient_n_s2")
_VALUES = {
    "yaw_trim": ("torque_coefficient_n_m_s2",),
    **dict.fromkeys(("lift", "lift_of_throttle", "lift_without_voltage"), _LIFT),
    "follows": ("rotor_speed_limits_rad_s",),
}
CAUSES = {
    kind: (*_VALUES.get(kind, ()), *(e.id for e in catalogue().values() if kind in e.shows_in)) for kind in BUDGET
}
"""Believed values and ids that may be behind a kind of quantity. Where it is stated, no limit of theirs is."""
SCATTER = (
    ("share", "NeuroBEM", 0.018, 3, 4),
    ("share", "imrc", 0.008, 8, 4),
    ("share", "CrazyPAD", 0.013, 8, 4),
    ("share", "appius", 0.04, 1, 4),
    ("trim", "NeuroBEM", 0.0049, 3, 2),
    ("trim", "imrc", 0.0041, 8, 2),
    ("trim", "CrazyPAD", 0.005, 8, 2),
    ("trim", "appius", 0.0085, 1, 2),
    ("yaw_trim", "NeuroBEM", 0.014, 3, 1),
    ("yaw_trim", "imrc", 0.0028, 8, 1),
    ("yaw_trim", "CrazyPAD", 0.0086, 8, 1),
    ("yaw_trim", "appius", 0.036, 1, 1),
    ("sideways", "NeuroBEM", 0.0042, 3, 2),
    ("sideways", "imrc", 0.00089, 8, 2),
    ("sideways", "CrazyPAD", 0.0013, 8, 2),
    ("sideways", "appius", 0.0036, 1, 2),
    ("lift", "NeuroBEM", 0.01, 3, 1),
    ("lift", "imrc", 0.00078, 8, 1),
    ("lift", "appius", 0.034, 1, 1),
    ("lift_of_throttle", "CrazyPAD", 0.011, 8, 1),
    ("follows", "imrc", 0.012, 8, 4),
    ("accelerometer", "NeuroBEM", 0.0016, 3, 3),
    ("accelerometer", "imrc", 0.004, 8, 3),
    ("gyroscope", "NeuroBEM", 0.00089, 3, 3),
    ("gyroscope", "imrc", 0.0045, 8, 3),
    ("gyroscope", "appius", 0.00021, 1, 3),
    ("gyroscope_scale", "NeuroBEM", 0.011, 3, 1),
    ("gyroscope_scale", "imrc", 0.0071, 8, 1),
    ("gyroscope_scale", "appius", 0.097, 1, 1),
    ("gyroscope_turn", "NeuroBEM", 0.019, 3, 3),
    ("gyroscope_turn", "imrc", 0.01, 8, 3),
    ("gyroscope_turn", "appius", 0.015, 1, 3),
    ("drag", "NeuroBEM", 0.031, 3, 2),
    ("drag", "imrc", 0.0045, 8, 2),
    ("drag", "CrazyPAD", 0.051, 8, 2),
    ("drag", "appius", 0.05, 1, 2),
    ("noise", "NeuroBEM", 0.43, 3, 6),
    ("noise", "imrc", 0.3, 8, 6),
    ("noise", "appius", 0.16, 1, 5),
)
"""Kind, laboratory, one-sigma from flight to flight where nothing changed, degrees of freedom, members of the kind.

Of a slope what goes beyond the flights' own doubt, or half of that doubt where it explains all."""
ASSUMED = {"lift_without_voltage": (0.1, 3)}
"""One-sigma and degrees of freedom of what no laboratory shows: here of a battery whose voltage is not recorded."""
_FREEDOM = (2.0, 10.0)
"""Bounds of the degrees of freedom that the usual scatter counts as."""


@dataclass(frozen=True)
class _Usual:
    """How much a kind of quantity differs from flight to flight of one vehicle in which nothing changed."""

    sd: float
    freedom: float
    """As how many degrees of freedom it counts: few where laboratories differ."""
    most: float
    """The largest that any laboratory's flights showed."""


@dataclass(frozen=True)
class _OneFlight:
    """A quantity of one flight."""

    name: str
    value: float
    sd: float
    """One-sigma by its own pieces."""


@dataclass(frozen=True)
class Difference:
    """By how much a quantity differs between two sets, in its unit; of a logarithm relative."""

    quantity: Quantity
    good: tuple[_OneFlight, ...]
    new: tuple[_OneFlight, ...]
    value: float
    sd: float
    freedom: float
    scatter: float
    """One-sigma from flight to flight that it is held against."""
    false_alarms: float
    """How often a difference as rare, of any quantity, is seen where nothing changed."""
    feigned: float
    """The most that disturbances and noise, answered by the controllers, can feign of it; 0 of what is no slope."""
    smallest: float
    """Smallest change that is stated in 19 of 20 comparisons like this."""

    @property
    def stated(self) -> bool:
        """Whether it is a change."""
        return self.false_alarms <= FALSE_ALARMS

    def interval(self, share: float = 0.95) -> tuple[float, float]:
        """The interval that holds the difference with this probability."""
        reach = float(stdtrit(self.freedom, 0.5 + 0.5 * share)) * self.sd + self.feigned
        return self.value - reach, self.value + reach


@dataclass(frozen=True)
class LevelOne:
    """What differs between two sets of flights, without a cause."""

    base: str
    new: str
    differences: tuple[Difference, ...]
    """The rarest first."""
    left_out: tuple[str, ...] = ()
    """Runs without a stretch that is long enough."""

    @property
    def stated(self) -> tuple[Difference, ...]:
        """Those that are changes."""
        return tuple(d for d in self.differences if d.stated)


@step("what differs")
def level_one(base: RecordingSet, new: RecordingSet) -> LevelOne:
    """What differs between two sets of flights, by the scatter of all laboratories.

    Raises
    ------
    InputError
        The sets are of vehicles with other numbers of rotors, or one has no stretch of flight that is long enough.
    """
    if base.vehicle.rotor_count != new.vehicle.rotor_count:
        raise InputError(
            f"{new.name}/vehicle.yaml: {new.vehicle.rotor_count} rotors, expected {base.vehicle.rotor_count} as in "
            f"{base.name}"
        )
    grid, left_out, sides = grid_of((base, new)), [], []
    for own in (base, new):
        flights: dict[str, list[Flown]] = {}
        for run, name in zip(own.runs, flights_of(own), strict=True):
            shown = flown(run, own.vehicle, grid)
            if shown is None:
                left_out.append(run.name)
            else:
                flights.setdefault(name, []).append(shown)
        if not flights:
            raise InputError(
                f"set {own.name}: no stretch of flight with rotors and motion is long enough; expected some seconds"
            )
        sides.append(flights)
    return LevelOne(base.name, new.name, differences(*sides, usual_scatter()), tuple(left_out))


_NO_PROPERTIES = {"name", "noise", "trust"}
"""Of a vehicle file what is no property of the vehicle: its name, and what is believed of sensors and values."""


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else printable(value)


def as_one(sets: Sequence[RecordingSet]) -> RecordingSet:
    """Several sets of one vehicle as one, each run named after its set; a value that one of them states holds for all.

    Raises
    ------
    InputError
        Their vehicles are not believed to be the same.
    """
    first, *others = sets
    stated: dict[str, tuple[RecordingSet, object]] = {}
    for own in sets:
        for key in sorted(own.vehicle.model_fields_set - _NO_PROPERTIES):
            value = getattr(own.vehicle, key)
            earlier, known = stated.setdefault(key, (own, value))
            if value != known:
                raise InputError(
                    f"{own.name}/vehicle.yaml: {key} is {_shown(value)}, that of {earlier.name} {_shown(known)}; "
                    "expected one vehicle in all good sets"
                )
    first = replace(first, vehicle=first.vehicle.model_copy(update={key: value for key, (_, value) in stated.items()}))
    if not others:
        return first
    runs = tuple(replace(run, name=f"{own.name}-{run.name}") for own in sets for run in own.runs)
    return replace(first, name=" + ".join(own.name for own in sets), runs=runs, held_out=())


def seen_by(base: RecordingSet, new: RecordingSet) -> LevelOne | None:
    """What differs, without a cause; None where a set is none of flights."""
    return level_one(base, new) if {base.vehicle.kind, new.vehicle.kind} == {"flight"} else None


def of_one_vehicle(sets: Sequence[RecordingSet]) -> tuple[RecordingSet, ...]:
    """The sets, mended alike, with one number for each value that an importer proposed in some of them: nobody's guess
    is compared.

    It is that of the first set in which somebody stated it, else the first one's guess.
    """
    sets = mended_alike(sets)
    guessed = [{doubt.what for doubt in own.proposed} for own in sets]
    same = {}
    for key in set().union(*guessed) & set(Vehicle.model_fields):
        stated = [own for own, keys in zip(sets, guessed, strict=True) if key not in keys]
        same[key] = getattr((stated or sets)[0].vehicle, key)
    if not same:
        return tuple(sets)
    return tuple(
        replace(own, vehicle=own.vehicle.model_copy(update={k: v for k, v in same.items() if k in keys}))
        for own, keys in zip(sets, guessed, strict=True)
    )


def flights_of(recordings: RecordingSet) -> list[str]:
    """The flight that each run is of: stretches that an importer numbered within a log are one flight.

    Runs that are numbered throughout, of one name that is not the set's, are flights of their own.
    """
    names = [run.name for run in recordings.runs]
    stems = [PART.sub("", name) for name in names]
    if len(set(stems)) == 1 and stems[0] != recordings.name:
        return names
    return [stem if stems.count(stem) > 1 else name for stem, name in zip(stems, names, strict=True)]


@cache
def usual_scatter(without: str = "") -> dict[str, _Usual]:
    """The usual scatter by kind, learnt from all laboratories but the one named.

    Its degrees of freedom follow from how much the logarithms of the laboratories' variances differ (Smyth, eq. 10).
    """
    # A laboratory's largest scatter needs so many flights; of a kind that fewer laboratories have, it is doubled.
    fewest_flights, fewest_laboratories = 3, 3
    out = {}
    for kind in KINDS:
        every = [row for row in SCATTER if row[0] == kind]
        rows = [row for row in every if row[1] != without] or every
        if not rows:
            sd, freedom = ASSUMED[kind]
            out[kind] = _Usual(sd, freedom, 2.0 * sd)
            continue
        sd, freedom, members = np.array([row[2:] for row in rows], float).T
        half = 0.5 * freedom * members
        logs = np.log(sd**2) - polygamma(0, half) + np.log(half)
        apart = np.var(logs, ddof=1) if len(rows) > 1 else np.inf
        apart -= float(np.mean(polygamma(1, half)))
        counts = 2.0 * brentq(lambda x, y=apart: polygamma(1, x) - np.clip(y, 0.1, 1e3), 1e-2, 1e2)
        counts = float(np.clip(counts, *_FREEDOM))
        mean = float(np.exp(0.5 * (np.mean(logs) + polygamma(0, 0.5 * counts) - np.log(0.5 * counts))))
        wider = 1.0 if len(rows) >= fewest_laboratories else 2.0
        most = max([mean, *sd[freedom >= fewest_flights - 1]])
        out[kind] = _Usual(wider * mean, counts, float(wider * most))
    return out


def differences(
    good: Mapping[str, Sequence[Flown]], new: Mapping[str, Sequence[Flown]], usual: Mapping[str, _Usual]
) -> tuple[Difference, ...]:
    """What differs, the rarest first; `good` and `new` hold the runs of each flight by its name."""
    return differences_at(len(good), measured([*good.values(), *new.values()]), [*good, *new], usual)


def differences_at(
    count: int, numbers: Mapping[Quantity, _Numbers], names: Sequence[str], usual: Mapping[str, _Usual]
) -> tuple[Difference, ...]:
    """What differs between the first `count` flights and the others, the rarest first; `numbers` are of all."""
    kinds = [q.kind for q in numbers]
    total = sum(BUDGET[kind] for kind in dict.fromkeys(kinds))
    out = [
        _difference(q, own, count, names, usual[q.kind], BUDGET[q.kind] / total / kinds.count(q.kind))
        for q, own in numbers.items()
    ]
    return tuple(sorted(out, key=lambda d: (d.false_alarms, -abs(d.value) / d.sd)))


def found_in(flights: Mapping[str, Sequence[Flown]]) -> dict[Quantity, tuple[float, int, float]]:
    """What SCATTER is made of, by quantity: the variance from flight to flight, its degrees of freedom, and the mean
    variance by the flights' own pieces."""
    out = {}
    for q, numbers in measured(list(flights.values())).items():
        out[q] = *_scatter_of([numbers.values], [numbers.own], q.kind), float(numbers.own.mean())
    return out


def _quantities(every: Sequence[Flown]) -> list[Quantity]:
    """All that every run has."""
    keys = [k for k, v in every[0].y.items() if all(k in run.y and np.isfinite(run.y[k]).all() for run in every)]
    keys += [k for k in every[0].noise if all(k in run.noise for run in every)]
    out = [Quantity(*key.split("/")) for key in keys]
    for kind, parts in SLOPES.items():
        known = _known(kind, every) == _places(kind)
        out += [
            Quantity(kind, m) for m, own in parts.items() if known and all(response in keys for response, _, _ in own)
        ]
    return out


def _places(kind: str) -> list[int]:
    """Where the conditions of a kind stand in CONDITIONS."""
    return [CONDITIONS.index(name) for name in KINDS[kind].at]


def _known(kind: str, every: Sequence[Flown]) -> list[int]:
    """Those of them that every run has."""
    return [k for k in _places(kind) if all(np.isfinite(run.x[:, k]).all() for run in every)]


@dataclass(frozen=True)
class _Numbers:
    """A quantity of some flights."""

    values: np.ndarray
    """(F,) at the conditions that all of them share."""
    own: np.ndarray
    """(F,) variances by the flights' own pieces."""
    places: np.ndarray
    """(F, k) mean conditions of each."""
    doubt: np.ndarray
    """(k, k) covariance of the slopes by those conditions."""
    feigned: np.ndarray
    """(F,) the most that a closed loop can feign of each."""


def measured(flights: Sequence[Sequence[Flown]]) -> dict[Quantity, _Numbers]:
    """All quantities of some flights, each known by its runs."""
    every = [run for runs in flights for run in runs]
    return {q: _numbers(q, flights, every) for q in _quantities(every)}


def _numbers(q: Quantity, flights: Sequence[Sequence[Flown]], every: Sequence[Flown]) -> _Numbers:
    if q.kind not in SLOPES and q.kind != "noise":
        return _means(q, flights, every)
    if q.kind == "noise":
        parts = [(np.mean([run.noise[q.key] for run in runs]), 0.0, 0.0) for runs in flights]
    else:
        parts = [_slope(q, runs) for runs in flights]
    values, own, feigned = np.array(parts, float).T
    return _Numbers(values, own, np.zeros((len(values), 0)), np.zeros((0, 0)), feigned)


def _means(q: Quantity, flights: Sequence[Sequence[Flown]], every: Sequence[Flown]) -> _Numbers:
    """Means of a quantity at the conditions that all flights share.

    How it depends on them is learnt within all runs together; what is between runs is no part of it.
    """
    at = _known(q.kind, every)
    gram = np.concatenate([run.gram[:, at][:, :, at] for run in every])
    cross = np.concatenate([run.cross[q.key][:, at] for run in every])
    slope, without = _ridge(gram, cross, KINDS[q.kind].penalty)
    away = without - without.mean(axis=0)
    doubt = away.T @ away * (len(away) - 1) / len(away)
    if KINDS[q.kind].moves:
        feigned = dict(zip(VELOCITY, _moved_by_the_rest(q.key, every), strict=True))
        doubt += np.diag([feigned.get(CONDITIONS[k], 0.0) ** 2 for k in at])
    for k in (at.index(k) for k in at if CONDITIONS[k] == "voltage"):
        slope[k] = np.clip(slope[k], *BY_VOLTAGE)
        doubt[k, k] += DOUBT_OF_VOLTAGE**2
    middle = np.mean([np.average(run.x[:, at], axis=0, weights=run.rows) for run in every], axis=0)
    values, variances, places = [], [], []
    for runs in flights:
        rows = np.concatenate([run.rows for run in runs])
        x = np.concatenate([run.x[:, at] for run in runs])
        y = np.concatenate([run.y[q.key] for run in runs]) - (x - middle) @ slope
        values.append(np.average(y, weights=rows))
        variances.append(np.average((y - values[-1]) ** 2, weights=rows) / max(len(rows) - 1, 1))
        places.append(np.average(x, axis=0, weights=rows))
    return _Numbers(np.array(values), np.array(variances), np.array(places), doubt, np.zeros(len(values)))


def _slope(q: Quantity, runs: Sequence[Flown]) -> tuple[float, float, float]:
    """A slope in a flight, its variance by the flight's pieces (jackknife), and the most that is feigned of it.

    In a closed loop what is left of a response drives what the slope is by: force the velocity, noise of the gyroscope
    the rates. A force can feign at most what is left of it at the velocity's frequencies. Noise
    of the gyroscope is in its own rates, which makes the slope by them too large; by those of the attitude it is too
    small; the truth is between.
    """
    at = _places(q.kind)
    other = [CONDITIONS.index(name) for name in KINDS[q.kind].other]
    gram = np.concatenate([run.gram[:, at][:, :, at] for run in runs])
    excited = np.diag(gram.sum(axis=0))
    parts = SLOPES[q.kind][q.member]
    value, feigned, without = 0.0, 0.0, np.zeros(len(gram))
    for response, by, sign in parts:
        cross = np.concatenate([run.cross[response] for run in runs])
        slope, others = _ridge(gram, cross[:, at], 1e-6)
        k = KINDS[q.kind].at.index(by)
        # Of a scale that all axes share an axis says as much as it is excited.
        share = excited[k] / excited.sum() if q.member == "all" else sign
        value, without = value + share * slope[k], without + share * others[:, k]
        if not KINDS[q.kind].moves:
            again, _ = _ridge(np.concatenate([run.gram[:, other][:, :, other] for run in runs]), cross[:, other], 1e-6)
            feigned += abs(share * (slope[k] - again[k]))
        else:
            feigned += abs(share) * _moved_by_the_rest(response, runs)[k]
    return value, (len(without) - 1) ** 2 / len(without) * float(np.var(without)), feigned


def _moved_by_the_rest(force: str, runs: Sequence[Flown]) -> np.ndarray:
    """By how much the slope of a force by each velocity (3,) is wrong where all that is left of it moves these."""
    common, squares = sum(run.feigned[force] for run in runs)
    return common / np.maximum(squares, 1e-12)


def _ridge(gram: np.ndarray, cross: np.ndarray, penalty: float) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (k,) by all pieces, and without each piece (P, k)."""
    whole, right = gram.sum(axis=0), cross.sum(axis=0)
    weight = np.diag(penalty * np.diag(whole) + 1e-12)
    without = np.linalg.solve(whole - gram + weight, (right - cross)[:, :, None])[:, :, 0]
    return np.linalg.solve(whole + weight, right), without


def _difference(
    q: Quantity, numbers: _Numbers, count: int, names: Sequence[str], usual: _Usual, share: float
) -> Difference:
    """The difference of two sets by the yardstick that makes it rarer; it has a `share` of the false alarms."""
    first, second = slice(None, count), slice(count, None)
    values, owns = ([column[part] for part in (first, second)] for column in (numbers.values, numbers.own))
    found, freedom = _scatter_of(values, owns, q.kind)
    total = usual.freedom + freedom
    joint = (usual.freedom * usual.sd**2 + freedom * found) / total
    value = float(values[1].mean() - values[0].mean())
    feigned = float(numbers.feigned[first].mean() + numbers.feigned[second].mean())
    beyond = max(abs(value) - feigned, 0.0)
    apart = numbers.places[second].mean(axis=0) - numbers.places[first].mean(axis=0)
    believed = _overstated(numbers.own, found, freedom)
    tests = []
    known = 1e6  # Degrees of freedom of a scatter that is taken as known.
    for variance, degrees in ((joint, total), (usual.most**2, known)):
        each = [variance + w if q.kind in SLOPES else np.maximum(variance, believed * w) for w in owns]
        sd = float(np.sqrt(sum(v.mean() / len(v) for v in each) + apart @ numbers.doubt @ apart))
        reach = -stdtrit(degrees, 0.25 * FALSE_ALARMS * share) - stdtrit(degrees, 0.05)
        tests.append((2.0 * float(stdtr(degrees, -beyond / sd)), sd, degrees, variance, float(reach) * sd + feigned))
    rate, sd, degrees, variance, _ = min(tests)
    flights = [
        _OneFlight(n, float(v), float(np.sqrt(w))) for n, v, w in zip(names, numbers.values, numbers.own, strict=True)
    ]
    rate, smallest = min(1.0, 2.0 * rate / share), min(test[-1] for test in tests)
    scatter = float(np.sqrt(variance))
    sides = tuple(flights[first]), tuple(flights[second])
    return Difference(q, *sides, value, sd, degrees, scatter, rate, feigned, smallest)


def _overstated(own: np.ndarray, found: float, freedom: int) -> float:
    """What part of the variances (F,) by the flights' own pieces is believed, 0 to 1.

    Pieces of a manoeuvre differ by more than flights that repeat it: where flights are known to differ by less (by
    `found`, the variance between them), pieces are believed by so much less. Without such flights they are believed.
    """
    freedom_of_pieces = 2.0  # As how many degrees of freedom between flights the doubt by a flight's own pieces counts.
    mean = float(own.mean())
    seen = min(1.0, found / mean) if mean > 0 else 1.0
    return (freedom_of_pieces + freedom * seen) / (freedom_of_pieces + freedom)


def _scatter_of(values: Sequence[np.ndarray], owns: Sequence[np.ndarray], kind: str) -> tuple[float, int]:
    """Variance of flights about the mean of their own set, and its degrees of freedom.

    Of a slope it is what goes beyond the flights' own doubt, which is as different as their excitation.
    """
    freedom = sum(len(v) - 1 for v in values)
    if not freedom:
        return 0.0, 0
    squares = sum(float(((v - v.mean()) ** 2).sum()) for v in values)
    doubt = sum(float(w.mean()) * (len(w) - 1) for w in owns) if kind in SLOPES else 0.0
    return max(0.0, squares - doubt) / freedom, freedom
