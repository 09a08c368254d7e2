"""What lies between command and thrust where no rotor speed is recorded: curve, voltage, lag, delay.

Commands answer disturbances: in a loop, force and moment regressed on commands show too small a gain and a lateness of
the controller's own. So the path is read where the loop is not the cause:

- *Gauge.* Commands alone determine the thrust per mass as a function of command and voltage. C_F and the full speed
  are one number with it: rotors turn as fast as the believed C_F needs for the lift that was felt.
- *Curve and voltage* from the force along the rotors' axis, its mean included: what flies is lifted. Errors
  are weighted by the spectrum of what is left, learnt anew after each fit.
- *Lag and delay* from the frequency bands of lift, roll and pitch in which the response is that of a cause
  (`causal_bands`): coherent, with a gain that a vehicle can have and that a lag and a delay explain together with the
  phase. A controller that answers a disturbance is coherent, too: a share of it that answers the rates adds to the
  response what looks like a lateness, and its gain grows with frequency, where that of a lag falls and of a delay
  stays.
- *Silence.* Without such a band nothing is stated and the believed path stays.

Intervals hold what a loop can feign: of a response with the coherence γ² a share √((1 − γ²)/γ²) may be the loop's
(Forssell and Ljung, Automatica 35, 1999), which does not fall with the length of the recording. Coherence-weighted
responses of rotorcraft: Tischler and Remple, Aircraft and Rotorcraft System Identification.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import CURVE, DELAY, LAG, SUPPLY, Effect, SpeedForm, SpeedPath
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.speedpath import CommandChain, SpeedFit, SpeedResult
from rotorid.recordings import Vehicle
from rotorid.vehicle.mixer import wrench_matrix

PIECE_S = 3.0
"""Length of the pieces that spectra are averaged over; shorter where a stretch is."""
LIFT_TOP_HZ = 4.0
"""Above it other things than the rotors act along their axis: noise, vibration, bending."""
_EDGES_HZ = (0.25, 0.5, 0.8, 1.2, 1.8, 2.7, 4.0, 6.0, 9.0, 13.0)
"""Edges of the bands in which responses are averaged."""
_TOLERANCE = 0.08
"""Relative error that a response may have besides its scatter: what flies is no lag of first order exactly."""
_PLAINER = 9.0
"""Whitened squares by which one form must be better than another that is plainer."""
_SQUARE, _SLIGHT = 2.0, 0.04
"""Elasticity of a speed proportional to the command, and a difference from it that nobody notices."""
LIFT_SILENT = (
    "what moves the commands of this recording is mostly what the controller answers: fly brisk climbs and descents"
)
LAG_SILENT = (
    "in no band of lift, roll or pitch the vehicle follows its commands without the commands following the vehicle: "
    "excite collective and attitude up to 8 Hz"
)
ELASTICITY = (0.6, 4.0)
"""Elasticities of thrust over command that a speed controller, a motor and a propeller can have."""
_FEIGNED = 0.25
"""One-sigma of what the loop feigns, as a share of the most that coherence allows: elasticities of real flights with
a coherence of 0.95 come out 5 to 7 % too small, which is 0.2 to 0.3 of it."""


@dataclass(frozen=True)
class Bands:
    """The bands of a channel in which its response is that of a cause."""

    low_hz: float
    high_hz: float
    gain: float
    tau_s: float
    delay_s: float
    coherence: float
    """Mean squared coherence."""
    alone: tuple[float, float]
    """What a lag alone and a delay alone leave, squares over their variance."""


@dataclass(frozen=True)
class LiftPath:
    """What the recording says of the path from command to thrust; each number with its one-sigma.

    `elasticity` and `voltage` are exponents of the thrust (twice those of the speed) about the mean command and
    voltage. None where the recording does not say it.
    """

    reference: float
    """Mean command, rad/s, about which the curve is stated."""
    voltage_reference_v: float | None
    elasticity: tuple[float, float] | None = None
    voltage: tuple[float, float] | None = None
    lag_s: tuple[float, float] | None = None
    """All of the lateness."""
    late_by: int = LAG
    """Stage at which: a lag or a delay."""
    one_of_two: bool = False
    """Whether the other of the two explains as much."""
    scale: float = 1.0
    """Rotor speed over the believed one that makes the felt force."""
    shape: str = "power"
    reasons: Mapping[int, str] = field(default_factory=dict)
    """To stages of the path of which nothing is said, why."""
    bands: Mapping[str, Bands] = field(default_factory=dict)
    """To `lift`, `roll`, `pitch` the bands in which the response is that of a cause."""

    @property
    def curved(self) -> bool:
        """Whether thrust does not go with the square of the command."""
        return self.elasticity is not None and abs(self.elasticity[0] - _SQUARE) > max(
            1.96 * self.elasticity[1], _SLIGHT
        )

    @property
    def sags(self) -> bool:
        """Whether thrust falls with the voltage."""
        return self.voltage is not None and self.voltage[0] > max(1.96 * self.voltage[1], 2.5 * _SLIGHT)


@dataclass(frozen=True)
class _Driven:
    """A stretch thinned: what was commanded and what was felt."""

    command: np.ndarray
    """(n, k), rad/s, at the rate of the segment: what the path is applied to."""
    ratio: np.ndarray | None
    """Voltage over the mean of all stretches, (n,)."""
    climb: np.ndarray | None
    """Velocity along the rotors' axis and squared speed across it, (n, 2), m/s and m²/s²."""
    felt: np.ndarray
    """Force along the rotors' axis over the weight, moments about x and y over weight times arm, (m, 1 to 3)."""
    dt_s: float
    every: int
    """Samples that are averaged into one of `felt`."""


def thinned_by(every: int, values: np.ndarray) -> np.ndarray:
    """Means (m, ...) of so many successive values (n, ...)."""
    count = len(values) // every
    return values[: count * every].reshape(count, every, *values.shape[1:]).mean(axis=1)


class _Problem:
    """What was felt in the pieces of all stretches, and what a path makes of their commands there."""

    def __init__(self, segments: Sequence[Segment], vehicle: Vehicle):
        self.vehicle = vehicle
        weight = vehicle.mass_kg * vehicle.gravity_m_s2
        mixer = wrench_matrix(vehicle)
        arm_m = float(np.abs(mixer[1:3]).max() / mixer[0].max()) or 1.0
        self.mixer = mixer[:3] / (weight * np.array([1.0, arm_m, arm_m]))[:, None]
        inertia = vehicle.inertia_kg_m2.matrix()
        turns = all(s.motion.has(("angular_velocity", "angular_acceleration")) for s in segments)
        self.channels = ("lift", "roll", "pitch") if turns else ("lift",)
        self.reference = float(np.mean(np.concatenate([s.command.ravel() for s in segments])))
        voltages = [s.motion.voltage for s in segments]
        self.voltage_reference_v = None
        if all(v is not None for v in voltages):
            self.voltage_reference_v = float(np.mean(np.concatenate(voltages)))
        self.flown, self.piece_s = [], PIECE_S
        longest = max(len(s.command) * s.dt_s for s in segments)
        least_piece_s = 1.5
        self.piece_s = float(np.clip(longest / 1.5, least_piece_s, PIECE_S))
        thin_hz = 50.0  # Rate that what is compared is thinned to, at least.
        for s in segments:
            if len(s.command) * s.dt_s < self.piece_s:
                continue
            felt = [-s.motion.specific_force[:, 2] / vehicle.gravity_m_s2]
            if turns:
                rate, turning = s.motion.angular_velocity, s.motion.angular_acceleration
                moment = turning @ inertia + np.cross(rate, rate @ inertia)
                felt += [moment[:, 0] / (weight * arm_m), moment[:, 1] / (weight * arm_m)]
            every = max(1, int(s.rate_hz / thin_hz))
            ratio = None
            if self.voltage_reference_v is not None:
                ratio = np.maximum(s.motion.voltage, 1e-3) / self.voltage_reference_v
            climb = None
            if s.motion.velocity is not None:
                v = s.motion.air_velocity
                climb = np.stack([v[:, 2], v[:, 0] ** 2 + v[:, 1] ** 2], axis=1)
            thinned = thinned_by(every, np.stack(felt, axis=1))
            self.flown.append(_Driven(s.command, ratio, climb, thinned, s.dt_s, every))
        self.climbs = all(f.climb is not None for f in self.flown)
        self.felt = np.concatenate([self.pieces(f, f.felt) for f in self.flown]) if self.flown else None

    def pieces(self, flown: _Driven, values: np.ndarray) -> np.ndarray:
        """Spectra (pieces, bins, columns) of thinned values (m, columns)."""
        size = int(self.piece_s / (flown.dt_s * flown.every))
        window = np.hanning(size)
        window = window / np.sqrt((window**2).mean()) / size
        starts = range(0, len(values) - size + 1, max(1, size // 2))
        bins = int(_EDGES_HZ[-1] * self.piece_s) + 1
        out = [np.fft.rfft(values[k : k + size] * window[:, None], axis=0)[:bins] for k in starts]
        shape = (0, min(bins, size // 2 + 1), values.shape[1])
        return np.array(out) if out else np.zeros(shape, complex)

    @property
    def frequencies_hz(self) -> np.ndarray:
        return np.arange(self.felt.shape[1]) / self.piece_s

    def made(self, law: Callable, exponents: tuple[float, float], tau_s: float, air: bool):
        """Spectra (pieces, bins, channels) of the wrench that a path makes at the reference's thrust, and of the lift's
        other columns (pieces, bins, 2 or 0)."""
        wrench, others = [], []
        for f in self.flown:
            thrust = law(f.command / self.reference, exponents[0])
            if f.ratio is not None and exponents[1]:
                thrust = thrust * (f.ratio ** exponents[1])[:, None]
            path = SpeedPath(np.sqrt(thrust), f.dt_s * np.arange(len(thrust)), 1.0, holds=False)
            speed = _of_stage(LAG).speed_forms[0].apply(path, [tau_s])
            squares = speed**2 * self.reference**2
            made = squares @ self.mixer[: len(self.channels)].T
            wrench.append(self.pieces(f, thinned_by(f.every, made)))
            if air:
                columns = np.stack([speed.mean(axis=1) * f.climb[:, 0], f.climb[:, 1]], axis=1)
                others.append(self.pieces(f, thinned_by(f.every, columns)))
        return np.concatenate(wrench), np.concatenate(others) if air else None


def _of_stage(stage: int) -> Effect:
    """The effect that acts at a stage between command and speed."""
    return next(e for e in catalogue().values() if any(f.stage == stage for f in e.speed_forms))


def _power(u: np.ndarray, elasticity: float) -> np.ndarray:
    """Thrust over that at u = 1."""
    return np.maximum(u, 1e-3) ** elasticity


def _line(u: np.ndarray, elasticity: float) -> np.ndarray:
    """The same of a speed that is a straight line of the command."""
    return np.maximum(1.0 + 0.5 * elasticity * (u - 1.0), 1e-2) ** 2


SHAPES = {"power": _power, "line": _line}


def causal_bands(
    frequencies_hz: np.ndarray,
    made: np.ndarray,
    felt: np.ndarray,
    gain: tuple[float, float],
    reach_hz: tuple[float, float],
) -> Bands | None:
    """The widest range in which a lag and a delay explain the response from `made` to `felt` (pieces, bins).

    None without one. `gain` bounds the gain, `reach_hz` the frequencies compared.
    """
    bands = []
    freedom = 0.6  # Independent values a bin of half-overlapping pieces.
    for start, stop in zip(_EDGES_HZ, _EDGES_HZ[1:], strict=False):
        inside = (frequencies_hz >= start) & (frequencies_hz < stop)
        if not inside.any() or start < reach_hz[0] or stop > reach_hz[1] * 1.01:
            continue
        x, y = made[:, inside], felt[:, inside]
        cross, xx, yy = (np.conj(x) * y).sum(), (np.abs(x) ** 2).sum(), (np.abs(y) ** 2).sum()
        middle = float((frequencies_hz[inside] * (np.abs(x) ** 2).sum(axis=0)).sum() / max(xx, 1e-300))
        coherence = float(np.abs(cross) ** 2 / max(xx * yy, 1e-300))
        bands.append((middle, cross / max(xx, 1e-300), coherence, max(1.0, freedom * x.size)))
    least_bands = 3  # Bands in a row that a lag and a delay must explain: gain and phase of two may be anything's.
    ranges = [(i, j) for i in range(len(bands)) for j in range(i + least_bands, len(bands) + 1)]
    coherent = 0.6  # Squared coherence below which a band says nothing.
    for first, last in sorted(ranges, key=lambda r: (r[0] - r[1], r[0])):
        own = bands[first:last]
        if min(b[2] for b in own) >= coherent and (found := _explained(own, gain)) is not None:
            return found
    return None


def _explained(bands: Sequence[tuple], gain: tuple[float, float]) -> Bands | None:
    """Gain, lag and delay of bands (frequency, response, coherence, number of values); None where they do not fit."""
    f_hz, response, coherence, count = (np.array(own) for own in zip(*bands, strict=True))
    scatter = np.sqrt((1 - coherence) / (2 * np.maximum(coherence, 1e-3) * count))
    sd = np.hypot(scatter, _TOLERANCE)

    def off(model: np.ndarray) -> np.ndarray:
        """Logarithm of the response over a model's, in standard errors: of the gain, then of the phase."""
        ratio = np.log(response / model)
        return np.concatenate([ratio.real / sd, ratio.imag / sd])

    def left(q: np.ndarray) -> np.ndarray:
        return off(q[0] * np.exp(-2j * np.pi * f_hz * q[2]) / (1 + 2j * np.pi * f_hz * q[1]))

    def answered(q: np.ndarray) -> np.ndarray:
        """What is left by rotors that are not late, of whose commands a share answers the rates: gain (1 − jωT).

        A controller commands a moment against a rate, so what turns is, negative, the integral of what is commanded.
        """
        return off(q[0] * (1 - 2j * np.pi * f_hz * q[1]))

    start = float(np.clip(np.abs(response[0]), *gain))

    def best(tau_s: float, delay_s: float):
        bounds = ([gain[0] * 0.999, 0.0, 0.0], [gain[1] * 1.001, tau_s + 1e-6, delay_s + 1e-6])
        tries = [(start, share * tau_s, 0.05 * delay_s) for share in (0.05, 0.25, 0.6)]
        fits = (least_squares(left, t, bounds=bounds, x_scale=[start, 0.02, 0.01]) for t in tries)
        return min(fits, key=lambda s: s.cost)

    slowest_s, longest_delay_s = 0.2, 0.06
    both = best(slowest_s, longest_delay_s)
    most_off = 2.5  # Standard errors by which a band may be off.
    if np.abs(left(both.x)).max() > most_off or both.x[1] > 0.99 * slowest_s:
        return None
    if not gain[0] < both.x[0] < gain[1]:
        return None
    alone = 2 * best(slowest_s, 0.0).cost, 2 * best(0.0, slowest_s).cost
    ends = ([1e-3 * start, 0.0], [1e3 * start, np.inf])
    tries = [(start, share * slowest_s) for share in (0.05, 0.25, 0.6)]
    of_loop = 2 * min(least_squares(answered, t, bounds=ends, x_scale=[start, 0.02]).cost for t in tries)
    # Whitened squares by which a loop's answer must explain a response better than a lag or a delay to be the likelier:
    # of rotors recorded late it explains moments 10 to 49 worse, lift 0.3 better to 12 worse; of answers 3 to 13
    # better.
    likelier = 1.0
    if of_loop < min(alone) - likelier:
        return None
    return Bands(float(f_hz[0]), float(f_hz[-1]), *map(float, both.x), float(coherence.mean()), alone)


@dataclass(frozen=True)
class _Fit:
    """A path fitted to the lift."""

    values: np.ndarray
    """Elasticity, exponent of the voltage, time constant, s."""
    sd: np.ndarray
    cost: float
    """Weighted squares."""
    scale: float
    """Thrust over the believed one."""


def _fit(problem: _Problem, law: Callable, free: Sequence[int], start: Sequence[float], weights, air: bool = False):
    """Least squares of the lift up to LIFT_TOP_HZ with the parameters `free`; `weights` (bins,) or None to learn them.

    Returns the fit and the weights. Rotors make what is felt: the gain is free, the mean is a bin like any other.
    """
    low, high = np.array([ELASTICITY[0] / 2, -2.0, 0.0]), np.array([6.0, 6.0, 0.3])
    values, free, learn = np.array(start, float), list(free), weights is None
    own = problem.frequencies_hz <= LIFT_TOP_HZ + 0.5 / problem.piece_s
    felt = problem.felt[:, own, 0]
    weights = np.ones(felt.shape[1]) if learn else weights

    def left(whole: np.ndarray) -> tuple[np.ndarray, float]:
        made, others = problem.made(law, (whole[0], whole[1]), whole[2], air)
        columns = np.concatenate([made[:, own, :1], *([others[:, own]] if air else [])], axis=2)
        flat = (weights[:, None] * columns).reshape(-1, columns.shape[2])
        goal = (weights * felt).ravel()
        both = np.concatenate([flat.real, flat.imag])
        beta = np.linalg.lstsq(both, np.concatenate([goal.real, goal.imag]), rcond=1e-9)[0]
        return felt - columns @ beta, float(beta[0])

    def at(z: np.ndarray) -> np.ndarray:
        whole = values.copy()
        whole[free] = z
        return whole

    def squares(z: np.ndarray) -> np.ndarray:
        rows = (weights * left(at(z))[0]).ravel()
        return np.concatenate([rows.real, rows.imag])

    sd = np.zeros(3)
    least_left = 1e-3  # Share of the spectrum of the lift that no model is better than.
    rounds = 6
    for _ in range(rounds if learn else 1):
        found = least_squares(
            squares,
            np.clip(values[free], low[free] + 1e-6, high[free] - 1e-6),
            bounds=(low[free], high[free]),
            x_scale=np.array([0.5, 0.5, 0.02])[free],
            diff_step=1e-3,
            max_nfev=12,
            xtol=1e-4,
            ftol=1e-5,
        )
        values = at(found.x)
        # Pieces overlap by half.
        sd[free] = np.sqrt(2.0 * np.diag(np.linalg.pinv(found.jac.T @ found.jac)))
        rest, scale = left(values)
        cost = float((weights**2 * np.abs(rest) ** 2).sum())
        if learn:
            least = least_left * np.sqrt((np.abs(felt[:, 1:]) ** 2).mean())
            weights = 1.0 / np.hypot(np.sqrt((np.abs(rest) ** 2).mean(axis=0)), least + 1e-12)
    return _Fit(values, sd, cost, scale), weights


def read_path(segments: Sequence[Segment], vehicle: Vehicle, command_rate_hz: float) -> LiftPath:
    """The path from command to thrust that stretches of flight say.

    `command_rate_hz` is the rate at which commands change; where it is low a lag is not asked for.
    """
    problem = _Problem(segments, vehicle)
    if problem.felt is None or not len(problem.felt):
        reason = f"no stretch of {problem.piece_s:.1f} s with commands"
        return LiftPath(problem.reference, None, reasons=dict.fromkeys((CURVE, SUPPLY, LAG, DELAY), reason))
    # Commands a period of the highest frequency that is compared: of fewer nobody recorded what happened between.
    commands_per_period = 4.0
    f_hz, top_hz = problem.frequencies_hz, command_rate_hz / commands_per_period
    made = problem.made(_power, (2.0, 0.0), 0.0, False)[0]
    mean, wanted = made[:, 0, 0].real, problem.felt[:, 0, 0].real
    scale = float(mean @ wanted / (mean @ mean))
    bands = {}
    # Factor by which the gain of roll and pitch may differ from the believed one: inertias are seldom known better.
    gain = 1.6
    # Below, moments of the air and turns of the pilot are what moves the commands of roll and pitch.
    moments_from_hz = 1.8
    for c, name in enumerate(problem.channels):
        if c == 0:
            limits, reach = (ELASTICITY[0] / 2, ELASTICITY[1] / 2), (0.0, min(top_hz, LIFT_TOP_HZ))
        else:
            around = bands["lift"].gain if "lift" in bands else 1.0
            limits, reach = (around / gain, around * gain), (moments_from_hz, top_hz)
        found = causal_bands(f_hz, scale * made[:, :, c], problem.felt[:, :, c], limits, reach)
        if found is not None:
            bands[name] = found
    reasons = {}
    moments = [_lateness(b) for name, b in bands.items() if name != "lift"]
    late = [_of_one_loop(moments)] if moments else []
    elasticity = voltage = None
    shape = "power"
    if "lift" in bands:
        knows = problem.voltage_reference_v is not None
        free = [0, *([1] if knows else []), 2]
        start = (2.0 * bands["lift"].gain, 0.0, bands["lift"].tau_s + bands["lift"].delay_s)
        power, weights = _fit(problem, _power, free, start, None)
        line, _ = _fit(problem, _line, free, power.values, weights)
        shape, fit = ("line", line) if line.cost < power.cost - _PLAINER else ("power", power)
        sd = _doubted(problem, bands["lift"], SHAPES[shape], free, fit, weights)
        late.append((fit.values[2], sd[2]))
        widest = 0.35  # Relative 95 % half-width of an elasticity beyond which the recording does not say it.
        if 1.96 * sd[0] <= widest * fit.values[0] and ELASTICITY[0] <= fit.values[0] <= ELASTICITY[1]:
            elasticity = fit.values[0], sd[0]
            scale = fit.scale
        widest_voltage = 0.8  # 95 % half-width of the voltage's exponent beyond which it is not said.
        if elasticity is not None and knows and 1.96 * sd[1] <= widest_voltage:
            voltage = fit.values[1], sd[1]
    reasons |= {key: LIFT_SILENT for key, own in ((CURVE, elasticity), (SUPPLY, voltage)) if own is None}
    lag = _together(late) if late else None
    arm_m = float(np.linalg.norm(vehicle.rotor_positions_m()[:, :2], axis=1).max())
    # The largest lateness in units of √(arm/g), in which a vehicle without power tips over: no controller holds one
    # level whose rotors are later, and what is so late is a logger or a disturbance.
    latest = 2.0
    latest_s = latest * np.sqrt(arm_m / vehicle.gravity_m_s2) if arm_m > 0 else np.inf
    widest_lag = 0.6  # Relative 95 % half-width of a lateness beyond which it is not said.
    if lag is None or lag[0] > latest_s or 1.96 * lag[1] > widest_lag * lag[0] + 0.5 / command_rate_hz:
        lag, words = None, LAG_SILENT if top_hz >= LIFT_TOP_HZ else _slow_commands(command_rate_hz)
        reasons |= dict.fromkeys((LAG, DELAY), words)
    return LiftPath(
        problem.reference,
        problem.voltage_reference_v,
        elasticity,
        voltage,
        lag,
        *_lag_or_delay(list(bands.values())),
        scale=float(np.sqrt(scale)),
        shape=shape,
        reasons=reasons,
        bands=bands,
    )


def _doubted(problem: _Problem, own: Bands, law, free, fit: _Fit, weights) -> np.ndarray:
    """One-sigma of a fit's parameters with what their scatter does not hold."""
    sd = fit.sd
    if problem.climbs:
        # What airspeed and climb do to the lift may be free next to it: as far as that moves a number it is in doubt.
        other, _ = _fit(problem, law, free, fit.values, weights, air=True)
        sd = np.hypot(sd, 0.5 * np.abs(other.values - fit.values))
    loop = _FEIGNED * np.sqrt((1.0 - own.coherence) / own.coherence)
    late_s = loop / (np.pi * (own.low_hz + own.high_hz))
    sd = np.hypot(sd, [loop * fit.values[0], loop * max(abs(fit.values[1]), 0.5), late_s])
    sd[0] = np.hypot(sd[0], 0.5 * abs(2.0 * own.gain - fit.values[0]))
    return sd


def _lateness(own: Bands) -> tuple[float, float]:
    """Lag and delay of a moment's channel together, and its one-sigma, s; there every disturbance moves commands."""
    loop = 2.0 * _FEIGNED * np.sqrt((1.0 - own.coherence) / own.coherence)
    return own.tau_s + own.delay_s, float(np.hypot(loop, _TOLERANCE) / (np.pi * (own.low_hz + own.high_hz)))


def _together(known: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Estimates of one number as one; where they disagree beyond their errors, with the larger error."""
    values, sd = (np.array(own) for own in zip(*known, strict=True))
    weight = 1.0 / sd**2
    mean = float(weight @ values / weight.sum())
    scatter = float(weight @ (values - mean) ** 2) / max(1, len(known) - 1)
    return mean, float(np.sqrt(max(1.0, scatter) / weight.sum()))


def _of_one_loop(known: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The same of channels in which one controller feigns alike: no surer together than the surest of them."""
    mean, sd = _together(known)
    return mean, max(sd, min(own for _, own in known))


def _lag_or_delay(bands: Sequence[Bands]) -> tuple[int, bool]:
    """Stage of the lateness, whether a lag or a delay explains bands, and whether either would do."""
    only_lag, only_delay = (sum(b.alone[i] for b in bands) for i in (0, 1))
    return DELAY if only_delay < only_lag - _PLAINER else LAG, abs(only_lag - only_delay) < _PLAINER


def _slow_commands(rate_hz: float) -> str:
    return f"commands come {rate_hz:.0f} times a second, too seldom to say how late the rotors follow: log them faster"


def chain_of_lift(
    segments: Sequence[Segment],
    vehicle: Vehicle,
    full_speed: float,
    full_voltage: float | None,
    command_rate_hz: float,
) -> CommandChain:
    """The chain that stretches of flight with commands alone say, on the believed speeds' scale."""
    found = read_path(segments, vehicle, command_rate_hz)
    chain, values, variances, p_values, alternatives = [], [], [], {}, {}

    def add(effect: Effect, form: SpeedForm, number: tuple[float, float]) -> None:
        (value, sd), key = number, effect.id
        chain.append((key, form))
        values.append(value)
        variances.append(sd**2)
        p_values[key] = float(chi2.sf(((value - form.neutral[0]) / sd) ** 2, 1))

    if found.curved:
        curve = _of_stage(CURVE)
        add(curve, curve.about(found.reference / full_speed, found.shape), found.elasticity)
    if found.sags:
        supply = _of_stage(SUPPLY)
        add(supply, supply.about(found.voltage_reference_v / full_voltage), found.voltage)
    # Standard errors by which rotors must be later than commands are which hold until the next: half a sample.
    surely_late = 3.0
    if found.lag_s is not None and found.lag_s[0] - 0.5 / command_rate_hz > surely_late * found.lag_s[1]:
        late = _of_stage(found.late_by)
        add(late, late.speed_forms[0], found.lag_s)
        if found.one_of_two:
            alternatives[late.id] = (_of_stage(LAG + DELAY - found.late_by).id,)
    fit = SpeedFit(
        tuple(chain),
        np.array(values),
        {"late": 0.0},
        0.0,
        np.diag(variances) if chain else np.zeros((0, 0)),
        holds=False,
    )
    every = {key: alternatives.get(key, ()) for key, _ in chain}
    known = {"e_u": found.elasticity, "e_V": found.voltage, "tau": found.lag_s}
    about = {key: (*own, "s" if key == "tau" else "1") for key, own in known.items() if own is not None}
    about = {"u_h": (found.reference / full_speed, 0.0, "1"), **about}
    result = SpeedResult(
        fit,
        p_values,
        every,
        silent={_of_stage(stage).id: why for stage, why in found.reasons.items()},
        about_hover=about,
        lifted_by_commands="lift" in found.bands,
        turned_by_commands=not {"roll", "pitch"}.isdisjoint(found.bands),
    )
    return CommandChain(result, full_speed, full_voltage, found.scale)
