"""Rotor columns in the wrong order and rotors that spin the other way, from the moments on all rotors at once.

In a closed loop every rotor answers every disturbance, so one rotor at a time misleads. Here whole layouts
compete: each predicts roll, pitch and yaw acceleration from all squared speeds in a band (2-25 Hz; yaw from
0.7 Hz), with a free positive gain an axis so that a wrong C_F, C_Q or inertia does not matter.

Causes come first. A controller answers each rate, and each noise of the gyroscope, with a torque that fits as well as
the rotors' own, of the other sign and after the motion. So torques count before the motion alone, a layout must hold on
the runs held out, and turning senses must show in the torque of the rotors' drag (`_drags`). What fits and fails in
this is a doubt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations, permutations, product

import numpy as np
from scipy.optimize import nnls
from scipy.sparse.csgraph import connected_components
from scipy.stats import t as student

from rotorid.mismatch.evidence.split import HELD_OUT_SHARE, split_runs
from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.axes import Turn, turned
from rotorid.mismatch.mistakes.signals import Corrected, ReadSet, Signals, established, replace_columns, sensor_columns
from rotorid.recordings import Run, Vehicle
from rotorid.recordings.run import Doubt

_LEAST_STEP = 0.6
_LATER_S = np.arange(0.005, 0.1001, 0.005)
"""By how much longer the torque of rotors may lag behind their commands than the delay that roll shows."""


@dataclass(frozen=True)
class _Moments:
    """Normal equations of an axis, piece by piece (a block's band of frequencies), nuisances already taken out."""

    square: np.ndarray
    """(n,)."""
    cross: np.ndarray
    """(n, k)."""
    gram: np.ndarray
    """(n, k, k)."""

    @cached_property
    def whole(self) -> tuple[float, np.ndarray, np.ndarray]:
        """The three summed over the pieces."""
        return float(self.square.sum()), self.cross.sum(axis=0), self.gram.sum(axis=0)


def _moments(blocks: lagged.Blocks, output: int, lag_s: float, weight: np.ndarray) -> _Moments:
    """Moments of one output with the rotors delayed and Z projected out."""
    x = blocks.x * lagged.delay(blocks.frequency_hz, lag_s)[:, :, None]
    y, z = blocks.y[:, :, output], blocks.z
    w = weight[None, :, None]
    if z.shape[2]:
        gram = np.real(np.einsum("bmk,bml->kl", z.conj() * w, z))
        inverse = np.linalg.pinv(gram, hermitian=True)
        x = x - z @ (inverse @ np.real(np.einsum("bmk,bml->kl", z.conj() * w, x)))
        y = y - z @ (inverse @ np.real(np.einsum("bmk,bm->k", z.conj() * w, y)))
    parts = [(x[:, m], y[:, m], weight[m]) for m in lagged.pieces(blocks.frequency_hz)]
    square = [np.sum(w * np.abs(y) ** 2, axis=1) for _, y, w in parts]
    cross = [np.real(np.einsum("bmk,bm->bk", x.conj() * w[:, None], y)) for x, y, w in parts]
    gram = [np.real(np.einsum("bmk,bml->bkl", x.conj() * w[:, None], x)) for x, _, w in parts]
    return _Moments(*(np.concatenate(part) for part in (square, cross, gram)))


@dataclass(frozen=True)
class _Axis:
    """One axis whose acceleration layouts predict."""

    blocks: lagged.Blocks
    output: int
    lags_s: tuple[float, ...]
    """Delays of the rotors that are tried."""
    weight: np.ndarray
    """(m,)."""

    @cached_property
    def moments(self) -> list[_Moments]:
        """With each of the delays."""
        return [_moments(self.blocks, self.output, lag_s, self.weight) for lag_s in self.lags_s]

    def part(self, chosen: np.ndarray) -> _Axis:
        """The same of some of the blocks only."""
        return replace(self, blocks=self.blocks.part(chosen))


def _rows_of(vehicle: Vehicle) -> np.ndarray:
    """Roll and pitch acceleration of one newton at every rotor, (2, k), rad/s²/N."""
    at, inertia = vehicle.rotor_positions_m(), vehicle.inertia_kg_m2
    return np.stack([-at[:, 1] / inertia.xx, at[:, 0] / inertia.yy])


def _best_gain(m: _Moments, row: np.ndarray) -> np.ndarray:
    """A row (k,) times its best positive gain."""
    _, cross, gram = m.whole
    size = row @ gram @ row
    return row * (max(cross @ row / size, 0.0) if size > 0 else 0.0)


def _loss(m: _Moments, row: np.ndarray) -> float:
    """What a row (k,) leaves of an axis."""
    square, cross, gram = m.whole
    return float(square - 2 * cross @ row + row @ gram @ row)


def _tie(whole: float, best: float) -> float:
    """Largest loss that still counts as the best."""
    # Layouts within this log-likelihood, or this share of what is explained, are not distinguished.
    tied_likelihood, tied_share = 12.0, 0.02
    return best + max(lagged.OVERLAP * tied_likelihood, tied_share * (whole - best))


def _losses_of_orders(m: list[_Moments], rows: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """What every order (h, k) leaves of roll and pitch, each with its best positive gain, (h,)."""
    total = np.zeros(len(orders))
    for axis, part in enumerate(m):
        b = rows[axis][orders]
        square, cross, gram = part.whole
        size = np.einsum("hk,kl,hl->h", b, gram, b)
        gain = np.where(size > 0, np.maximum(b @ cross, 0.0), 0.0)
        total += square - gain**2 / np.maximum(size, 1e-300)
    return total


def _orders_to_try(count: int) -> np.ndarray:
    """Orders of the columns: every one for few rotors, else every exchange of two; the believed one first."""
    most_rotors_for_every_order = 6
    if count <= most_rotors_for_every_order:
        return np.array(list(permutations(range(count))))
    exchanges = np.tile(np.arange(count), (1 + count * (count - 1) // 2, 1))
    for order, (i, j) in zip(exchanges[1:], combinations(range(count), 2), strict=True):
        order[i], order[j] = j, i
    return exchanges


def _moves(order: np.ndarray) -> int:
    """How many exchanges of two columns an order takes."""
    cycles, _ = connected_components(np.eye(len(order))[order])
    return len(order) - cycles


def _contest(axis_moments: list[_Moments], believed: list[np.ndarray], other: list[np.ndarray]) -> tuple[float, float]:
    """How far the data go from a believed prediction (rows (k,) an axis, gains included) towards another.

    The step (0: the believed one fits; 1: the other does), and the p-value that it is zero, for pieces that are
    independent of each other.
    """
    scores, curvatures = [], []
    for m, old, new in zip(axis_moments, believed, other, strict=True):
        change = new - old
        scores.append(m.cross @ change - m.gram @ old @ change)
        curvatures.append(m.gram @ change @ change)
    score, curvature = np.concatenate(scores), np.concatenate(curvatures)
    count = len(score)
    step = float(score.sum() / max(curvature.sum(), 1e-300))
    rest = score - curvature * step
    sd = np.sqrt(max(np.sum(rest**2) * count / max(count - 1, 1), lagged.OVERLAP * curvature.sum())) / max(
        curvature.sum(), 1e-300
    )
    return step, float(student.sf(step / sd, max(count - 1, 1)))


def find(recordings: ReadSet, by_yaw: bool = True) -> Corrected:
    """The layout (order of the columns, turning senses) that needs the fewest changes among those that fit.

    Without `by_yaw` the order by roll and pitch alone.
    """
    least_advantage = 1.5  # What the right layout explains over what the believed one explains, at least.
    vehicle = recordings.vehicle
    if not 3 <= vehicle.rotor_count <= 8:
        return Corrected(recordings)
    signals = recordings.signals
    sensor = next((n for n in map(lagged.speeds_of, signals) if n), None)
    blocks = _thrust_blocks(signals, vehicle, sensor) if sensor else None
    free = lagged.fit(blocks, lagged.CAUSES_S - _late_stamps(signals, vehicle, sensor)) if blocks else None
    if free is None:
        return Corrected(recordings)
    rolling = [_Axis(blocks, axis, (free.lag_s,), free.weight[axis]) for axis in (0, 1)]
    parts = [axis.moments[0] for axis in rolling]
    rows = _rows_of(vehicle)
    orders = _orders_to_try(vehicle.rotor_count)
    yawing = _yaw_axis(signals, vehicle, sensor, free) if by_yaw else None
    yaw = yawing.moments if yawing else []
    believed = vehicle.yaw_signs()
    senses = np.array(list(product((1.0, -1.0), repeat=vehicle.rotor_count))) if yaw else believed[None]
    # Every layout with the delay that suits it best: half a period of an oscillation late is the other sense.
    by_lag = np.array([[_loss(m, _yaw_row(m, s)) for s in senses] for m in yaw]) if yaw else np.zeros((1, 1))
    yaw_losses = by_lag.min(axis=0)
    losses = _losses_of_orders(parts, rows, orders)[:, None] + yaw_losses[None, :]
    if not np.isfinite(losses).all():
        # Rotors that all turn alike make no moment that distinguishes them.
        return Corrected(recordings)
    whole = float(sum(m.square.sum() for m in parts) + (yaw[0].square.sum() if yaw else 0.0))
    costs = np.array([_moves(o) for o in orders])[:, None]
    if yaw:
        changed = (senses[None, :, :] != believed[orders][:, None, :]).sum(axis=2)
        costs = costs + np.where(changed == len(believed), 1, changed)  # all senses at once are one change
    least = float(losses.min())
    tied = np.argwhere(losses <= _tie(whole, least))
    ranked = sorted(tied.tolist(), key=lambda at: (costs[at[0], at[1]], losses[at[0], at[1]]))
    order, spun = ranked[0]
    if costs[order, spun] == 0:
        return Corrected(recordings)
    # Only axes on which the two layouts differ can distinguish them; the moment about yaw is asked for senses alone.
    contested = [
        (axis, 0, partial(_best_gain, row=row), partial(_best_gain, row=row[orders[order]]))
        for axis, row in zip(rolling, rows, strict=True)
        if not np.array_equal(row, row[orders[order]])
    ]
    expected = int(np.flatnonzero((senses == believed[orders[order]]).all(axis=1))[0]) if yaw else spun
    turns = spun != expected
    if turns:
        own = int(by_lag[:, spun].argmin())
        contested.append((yawing, own, *(partial(_yaw_row, signs=senses[k]) for k in (expected, spun))))
    now, then = ([c[side](c[0].moments[c[1]]) for c in contested] for side in (2, 3))
    seen = [axis.moments[lag] for axis, lag, _, _ in contested]
    as_believed, best = (sum(map(_loss, seen, side)) for side in (now, then))
    if turns:
        as_believed += yaw_losses[expected] - _loss(seen[-1], now[-1])
    step, p_value = _contest(seen, now, then)
    p_value = min(1.0, p_value * losses.size)
    disputed = float(sum(m.square.sum() for m in seen))
    least_likelihood = 25.0  # Log-likelihood that the right layout must bring over none, and over the believed one.
    likely = (as_believed - best) / lagged.OVERLAP > least_likelihood
    explains = disputed - best > least_advantage * (disputed - as_believed)
    p_limit = 1e-6
    if not (likely and explains and step > _LEAST_STEP and p_value < p_limit):
        return Corrected(recordings)
    if order:
        # What the believed order leaves of roll and pitch where the torque may come after the motion.
        early = lagged.fit(blocks, -lagged.CAUSES_S[::-1])
        moments = [_moments(blocks, axis, early.lag_s, free.weight[axis]) for axis in (0, 1)]
        left = sum(_loss(m, _best_gain(m, row)) for m, row in zip(moments, rows, strict=True))
        if left < least - yaw_losses.min() - lagged.OVERLAP * least_likelihood:
            # The believed order, with stamps of the rotors that are late: `timing` finds them.
            return Corrected(recordings)
    held_out = _held_out(recordings, blocks)
    same = int(np.flatnonzero((senses == believed).all(axis=1))[0])
    if yaw and spun != same and not _drags(yaw[int(by_lag[:, spun].argmin())], senses[spun]):
        # The moment about yaw has no say, be it of senses or, by those of the columns, of the order.
        why = "not by the drag of the rotors as vehicle.yaml has it"
        return _doubted(recordings, turns, why).then(partial(find, by_yaw=False))
    if not _holds(contested, held_out):
        return _doubted(recordings, turns, "the recordings held out do not confirm it")
    cost = int(costs[order, spun])
    if not any({"attitude", "gyroscope"} <= set(s.values) for s in signals):
        gyroscope = _turned_gyroscope(recordings, parts, rows, yaw, believed, _tie(whole, least), cost, p_value)
        if gyroscope:
            return gyroscope
    rival = any(costs[a, b] == cost for a, b in ranked[1:])
    result = Corrected(recordings)
    if order:
        result = _reordered(recordings, orders[order], p_value, rival)
    turning = np.flatnonzero(senses[spun] != believed[orders[order]]) if yaw else []
    if len(turning):
        # Columns are in order by now: column i belongs to rotor orders[order][i].
        rotors = sorted(int(orders[order][i]) for i in turning)
        result = result.then(partial(_spun, rotors=rotors, p_value=p_value, ambiguous=rival))
    return result


def _turned_gyroscope(
    recordings: ReadSet,
    parts: list[_Moments],
    rows: np.ndarray,
    yaw: list[_Moments],
    believed: np.ndarray,
    enough: float,
    cost: int,
    p_value: float,
) -> Corrected | None:
    """A gyroscope with flipped or exchanged axes that takes no more changes than a layout's `cost`; None if none.

    For sets without an attitude. `enough` is the loss up to which it fits as well. Roll and pitch exchanged are, on a
    square of rotors, two opposite rotors exchanged: with as many changes it is either, and nobody can say which.
    """
    best = None
    for source, signs in product(((0, 1, 2), (1, 0, 2)), product((1, -1), repeat=3)):
        true = [signs[i] * rows[source[i]] for i in (0, 1)]
        total = sum(_loss(m, _best_gain(m, row)) for m, row in zip(parts, true, strict=True))
        total += min((_loss(m, _yaw_row(m, signs[2] * believed)) for m in yaw), default=0.0)
        changes = sum(s < 0 for s in signs) + (source != (0, 1, 2))
        if total <= enough and 0 < changes <= cost and (best is None or changes < best[0]):
            best = (changes, Turn(source, signs))
    if best is None or best[0] == cost and best[1].source == (0, 1, 2):
        return None
    note = "No attitude is recorded: the gyroscope's axes were identified from the believed rotors' moments."
    found = turned(recordings, "gyroscope", best[1], p_value)
    finding = found.findings[0]
    if best[0] == cost:
        words = "; or else rotors are in another order than vehicle.yaml has them, which nothing recorded shows."
        finding = replace(
            finding,
            status="ambiguous",
            alternatives=("axis_sign", "rotor_order"),
            sentence=finding.sentence.removesuffix(".") + words,
        )
    return Corrected(found.recordings, (finding,), (note,))


def _thrust_blocks(signals: list[Signals], vehicle: Vehicle, sensor: str) -> lagged.Blocks | None:
    def make(s: Signals):
        rate = s.values["gyroscope"]
        return rate[:, :2], lagged.squared_speeds(s, vehicle, sensor), rate

    return lagged.gather(signals, ("gyroscope", sensor), "rolling", make, changing=True)


def _reordered(recordings: ReadSet, order: np.ndarray, p: float, ambiguous: bool) -> Corrected:
    """Column i belongs to rotor order[i] of vehicle.yaml."""
    names = sensor_columns(recordings.vehicle)

    def change(run: Run):
        columns = {}
        for kind in ("rotors", "commands", "throttle"):
            for i, name in enumerate(names[kind]):
                if name in run.table.columns:
                    columns[names[kind][order[i]]] = run.table[name].to_numpy()
        return columns

    wrong = [i for i in range(len(order)) if order[i] != i]
    moved = ", ".join(f"column {i + 1} belongs to rotor {order[i] + 1}" for i in wrong)
    sentence = f"The rotor columns are in another order than vehicle.yaml: {moved}; put in order."
    finding = established("rotor_order", sentence, p, [names["rotors"][i] for i in wrong])
    if ambiguous:
        return Corrected(recordings, (finding.or_else(["spin_direction"]),))
    return Corrected(replace_columns(recordings, change), (finding,))


def _yaw_axis(signals: list[Signals], vehicle: Vehicle, sensor: str, roll: lagged.LaggedFit) -> _Axis | None:
    """Yaw acceleration against every rotor's torque (k) and acceleration (k); None without a torque coefficient.

    Measured rotors are as late as roll says. Commands may be later: of rotors that lag, torque and acceleration are.
    """
    if not np.any(vehicle.torque_coefficients_n_m_s2()):
        return None

    def make(s: Signals):
        rate = s.values["gyroscope"]
        torque = lagged.squared_speeds(s, vehicle, sensor) / vehicle.thrust_coefficients_n_s2()
        torque = torque * vehicle.torque_coefficients_n_m_s2() / vehicle.inertia_kg_m2.zz
        change = np.gradient(s.values[sensor], 1.0 / s.rate_hz, axis=0)
        return rate[:, 2:], np.concatenate([torque, change], axis=1), rate

    blocks = lagged.gather(signals, ("gyroscope", sensor), "yawing", make, changing=True)
    sharp = roll.lag_sd < 0.005
    late = roll.lag_s if sharp else 0.0
    free = lagged.fit(blocks, np.array([late]))
    lags = (late,) if sensor == "rotors" else (late, *(late + _LATER_S))
    return _Axis(blocks, 0, lags, free.weight[0]) if free else None


def _late_stamps(signals: list[Signals], vehicle: Vehicle, sensor: str) -> float:
    """By how much the rotors' stamps are late, s, where the force that they carry shows it: the lift has one sign."""
    # Share of the specific force along the rotors' axis that they must explain to show by it how late their stamps are.
    least_lift = 0.6
    lift = lagged.fit(lagged.lifting(signals, vehicle, sensor))
    known = lift is not None and lift.explained[0] > least_lift and lift.gain[0, 0] > 0
    return max(0.0, -lift.lag_s - 2 * lift.lag_sd) if known else 0.0


def _held_out(recordings: ReadSet, blocks: lagged.Blocks) -> Callable[[int, float], bool]:
    """Whether a time (s since its start) of a run (its number) is held out.

    The last third of each run where no run is, or where those that are, or all others, have none of the blocks.
    """
    split = split_runs(recordings)
    held = [run.name in split.held_out for run in recordings.runs]
    if {held[k] for k in blocks.run} == {True, False}:
        return lambda run, time_s: held[run]
    ends = [(1 - HELD_OUT_SHARE) * float(run.time_s[-1] - run.time_s[0]) for run in recordings.runs]
    return lambda run, time_s: time_s > ends[run]


def _holds(contested: list, held_out: Callable[[int, float], bool]) -> bool:
    """Whether the data held out go from the believed rows to the others, each with its gains from the other data.

    `contested` has an axis, the number of its delay, and of each layout the row that a moment gives.
    """
    seen, now, then = [], [], []
    for axis, lag, believed, other in contested:
        out = np.array([held_out(*at) for at in zip(axis.blocks.run, axis.blocks.time_s, strict=True)])
        if out.all() or not out.any():
            return False
        fitted, unseen = (axis.part(part).moments[lag] for part in (~out, out))
        seen.append(unseen)
        now.append(believed(fitted))
        then.append(other(fitted))
    step, p_value = _contest(seen, now, then)
    p_held_out = 0.01  # Chance of a layout on the runs held out alone, its gains from the others.
    return step > _LEAST_STEP and p_value < p_held_out


def _drags(m: _Moments, signs: np.ndarray) -> bool:
    """Whether rotors with these turning senses make a yaw torque by the air's drag, about as vehicle.yaml has it.

    A rotor that turns the other way does so with both of its torques. What a controller answers looks like the torque
    of speeding rotors up alone: it is the derivative of what rotors do.
    """
    # Share of the believed torque coefficient: 0.6 and more wherever wrong senses came out as the true ones (drawn and
    # real flights), none in ten flights with right senses whose controllers answer gusts or their gyroscope's noise.
    least_share = 0.3
    return float(np.abs(_yaw_row(m, signs)[: len(signs)]).max()) >= least_share


def _doubted(recordings: ReadSet, turns: bool, why: str) -> Corrected:
    """The set as it is, with a doubt about its rotors' turning senses, or their order."""
    what = "turning senses" if turns else "order of the rotors"
    doubt = Doubt("rotors", f"Another {what} than vehicle.yaml's fits the moments, but {why}: left as it is.")
    return Corrected(replace(recordings, proposed=(*recordings.proposed, doubt)))


def _spun(recordings: ReadSet, rotors: list[int], p_value: float, ambiguous: bool) -> Corrected:
    """The believed turning senses of some rotors reversed."""
    vehicle = recordings.vehicle
    every = len(rotors) == vehicle.rotor_count
    numbers = ", ".join(str(i + 1) for i in rotors)
    who = "all rotors spin" if every else f"rotor {numbers} spins" if len(rotors) == 1 else f"rotors {numbers} spin"
    sentence = f"The yaw moments say that {who} the other way than vehicle.yaml has it: turned round."
    finding = established("spin_direction", sentence, p_value, ["moment_z"])
    if ambiguous:
        return Corrected(recordings, (finding.or_else(["rotor_order"]),))
    other = {"ccw": "cw", "cw": "ccw"}
    new = tuple(
        r.model_copy(update={"spin": other[r.spin]}) if i in rotors else r for i, r in enumerate(vehicle.rotors)
    )
    return Corrected(replace(recordings, vehicle=vehicle.model_copy(update={"rotors": new})), (finding,))


def _yaw_row(m: _Moments, signs: np.ndarray) -> np.ndarray:
    """Best row (2k,) of torques and acceleration torques with these senses; neither gain negative."""
    k = len(signs)
    basis = np.zeros((2 * k, 2))
    basis[:k, 0], basis[k:, 1] = signs, signs
    _, cross, gram = m.whole
    gram, cross = basis.T @ gram @ basis, basis.T @ cross
    scale = 1 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    root = np.sqrt(np.maximum(values, 1e-9))
    gain, _ = nnls(root[:, None] * vectors.T, vectors.T @ (cross * scale) / root)
    return basis @ (scale * gain)
