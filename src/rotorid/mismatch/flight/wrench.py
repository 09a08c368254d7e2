"""The model of force, moment and sensor effects: rows, whitening, search, refinement; the chain before the rotors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize_scalar

from rotorid.effects.catalogue import ids_of, moving_air
from rotorid.effects.contract import Form
from rotorid.effects.steady_wind import through_drag
from rotorid.mismatch.decide.select import LEAST_PROMISE, LEAST_TRANSFER, Questions, Search, Selection
from rotorid.mismatch.decide.selected import coefficient_of, coefficients, relative_change
from rotorid.mismatch.evidence.lift import chain_of_lift
from rotorid.mismatch.evidence.motion import Segment, own_rate_hz, running_mean
from rotorid.mismatch.evidence.regression import (
    AGREEMENT,
    NOISE_BAND,
    Fit,
    Regression,
    autoregression,
    band_power,
    build,
    full_fit_residuals,
)
from rotorid.mismatch.evidence.rows import (
    Contributions,
    Rows,
    Term,
    baseline_wrench,
    compared_alone,
    form_terms,
    state_terms,
)
from rotorid.mismatch.evidence.speedpath import (
    CommandChain,
    MeasuredSpeed,
    SpeedSearch,
    candidate_forms,
    smoothed_acceleration,
)
from rotorid.mismatch.evidence.split import training_rule
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.flight.prepare import Prepared, assemble_rows
from rotorid.recordings import Vehicle
from rotorid.recordings.columns import rotor_columns
from rotorid.recordings.signal.kernels import causal
from rotorid.steps import step

SAME_WRENCH = 0.004
"""Share of the spread of the rotors' force or moment to which no model and no recording of them are known."""
WORTH_STATING = 3.0
"""Times that share which counts as noise where it is asked whether something matters."""


@dataclass
class WrenchModel:
    """Rows, regression and selection of the wrench and sensor effects."""

    prepared: Prepared
    terms: list[Term]
    rows: list[Rows]
    regression: Regression
    search: Search
    selection: Selection
    noise: np.ndarray
    """Noise of each of the twelve channels in the band of the rows, as the search took it."""
    floor: np.ndarray
    """What is left of each channel where the whole catalogue is free to explain."""
    wind: np.ndarray | None = None
    """Steady wind north and east, m/s, that drag and lift are built on; None for still air."""
    wind_sd: np.ndarray | None = None
    gusts: tuple = ()
    """Gusts (`gusts.Gust`) that drag and lift are built on."""
    segments: list[Segment] = field(default_factory=list)
    """What the rows are made of: rotor speeds as the chain has them, moving air where it moves."""
    noisy_segments: list[Segment] = field(default_factory=list)
    contributions: Contributions | None = None
    """What the terms add to the channels as far as their regressors are more than noise."""
    effects: list[tuple[Form, np.ndarray]] | None = None
    """Effects that shape the accelerations in the rows' regressors."""
    inflated: np.ndarray | None = None
    """Mask of the channels (12,) whose noise is what the model itself leaves."""

    def full_fit(self) -> Fit:
        """The fit of everything in the model, winds of single runs and all."""
        always = [t.key for t in self.regression.terms if t.kind != "effect"]
        return self.regression.fit(always + self.selection.active)

    def unnamed(self, columns: np.ndarray) -> np.ndarray:
        """Mask of the columns that belong to empirical terms, which no finding may count as its own."""
        keys = [k for k in self.selection.active if self.search.terms[k].effect in UNKNOWNS]
        return np.isin(columns, self.regression.columns(keys))

    @property
    def rows_per_block(self) -> int:
        """Rows of a second."""
        return max(2, int(self.prepared.thinner.rate_hz))

    def delivered_with(self, keys: Sequence[str], loose: dict[str, float]) -> list[str]:
        """Keys of winds, of the nuisances that are significant given the terms `keys`, and of these.

        A calm flight does not know the offset between two sensors, and one that is nothing but noise where it was
        fitted is a mismatch in the first turn held out.
        """
        nuisances = self.regression.keys_of("nuisance")
        always = [*self.regression.keys_of("wind"), *keys]
        fit = self.regression.fit([*nuisances, *always], loose=loose)

        sure_z = 3.0  # Standard errors by which a nuisance must differ from nothing to be delivered.

        def sure(key: str) -> bool:
            beta, covariance = coefficients(self.regression, fit, key)
            return abs(float(beta[0])) > sure_z * float(np.sqrt(covariance[0, 0]))

        return [*filter(sure, nuisances), *always]

    def values_beside(self, active: Sequence[str]) -> list[str]:
        """Keys of all believed values."""
        return self.regression.keys_of("value")

    def change(self, key: str, coefficient: float, sd: float) -> tuple[float, float]:
        """Relative change of a believed value and its one-sigma from its coefficient."""
        return relative_change(key, coefficient, sd)

    def coefficient(self, key: str, change: float) -> float:
        """Coefficient of a relative change of a believed value."""
        return coefficient_of(key, change)


def block_seconds(rows: list[Rows], rate_hz: float) -> float:
    """Length of a block: a second, longer where a recording would give too many."""
    seconds = sum(len(r.y) for r in rows) / rate_hz
    longest_blocks = 400
    return max(1.0 if seconds > 40 else 0.5, seconds / longest_blocks)


def channel_floor(segments: list[Segment], vehicle: Vehicle) -> np.ndarray:
    """One-sigma per channel (12,) below which nothing is distinguished.

    Of a force or moment a share (SAME_WRENCH) of how the rotors' own changes: held commands and the steps of an
    integrator are so much off in simulators without any noise.
    """
    floor = np.zeros(12)
    parts = [baseline_wrench(s.motion, vehicle) for s in segments if s.motion.rotor_speed is not None]
    if parts:
        force = np.concatenate([force for force, _, _ in parts])
        moment = np.concatenate([arm + torque for _, arm, torque in parts])
        floor[:6] = SAME_WRENCH * np.nanstd(np.hstack([force, moment]), axis=0)
        sideways = 0.25
        # Along the rotors' axis a command held late is felt at once, sideways by what the vehicle turns meanwhile.
        floor[:3] = np.maximum(floor[:3], sideways * floor[:3].max())
    floor[6:9], floor[9:12] = AGREEMENT["accelerometer"], AGREEMENT["gyroscope"]
    return floor


@step("searching what acts")
def wrench_model(
    prepared: Prepared,
    terms: list[Term],
    effects: list[tuple[Form, np.ndarray]] | None = None,
    start: list[str] | None = None,
    segments: list[Segment] | None = None,
    noisy_segments: list[Segment] | None = None,
    before: WrenchModel | None = None,
) -> WrenchModel:
    """Assemble, whiten, reduce and search; `before` is a model of the same rows that says in which channels noise is
    what a model leaves."""
    segments = prepared.segments if segments is None else segments
    noisy_segments = prepared.noisy_segments if noisy_segments is None else noisy_segments
    rows = assemble_rows(prepared, terms, segments, effects)
    noisy = assemble_rows(prepared, terms, noisy_segments, effects) if noisy_segments else None
    colours = {}
    if noisy is not None:
        colours = without_unseen(rows, noisy, prepared.thinner.rate_hz, prepared.thinner.cutoff_hz)
    precision = np.concatenate([1 / np.square(np.broadcast_to(t.prior_sd, (t.size,)).astype(float)) for t in terms])
    left, beta = full_fit_residuals(rows, precision, colours)
    above = np.zeros(12, bool) if before is None or before.inflated is None else before.inflated
    if above.any():
        left = [np.where(above, own, full) for own, full in zip(after_residual(before), left, strict=True)]
    model = searched(prepared, terms, rows, noisy, left, start, segments)
    model = replace(model, floor=np.fmin(model.noise, _whole_floor(model, beta, segments)))
    # The whole catalogue at once may explain what no model of it does (noise of the rotor speeds, say, with no
    # thrust and a deaf gyroscope): such a channel would weigh as if it were exact, and pull at all values.
    remains = after_residual(model)
    fitted = [p for p, r in zip(remains, rows, strict=True) if r.run in prepared.split.training]
    inflated = inflated_channels(fitted, model.noise)
    if inflated.any():
        left = [np.where(inflated, own, full) for own, full in zip(remains, left, strict=True)]
        active = model.selection.active
        again = searched(prepared, terms, rows, noisy, left, active, segments)
        model = replace(again, floor=model.floor)
    model = replace(model, inflated=inflated | above)
    return replace(model, segments=segments, noisy_segments=noisy_segments, effects=effects)


def _whole_floor(model: WrenchModel, beta: np.ndarray, segments: list[Segment]) -> np.ndarray:
    """What coefficients of the whole catalogue leave of each channel (12,), the noise of regressors aside."""
    added = model.contributions.of(np.arange(len(beta)), beta)
    left = np.concatenate([r.y - part for r, part in zip(model.rows, added, strict=True)])
    return np.hypot(left.std(axis=0), channel_floor(segments, model.prepared.vehicle))


def inflated_channels(remains: list[np.ndarray], noise: np.ndarray) -> np.ndarray:
    """Mask of the channels in which residuals (n, 12) are by far larger than their noise (12,)."""
    rms = np.sqrt(sum((p**2).sum(axis=0) for p in remains) / max(1, sum(len(p) for p in remains)))
    with np.errstate(invalid="ignore"):
        # A residual that the chosen model leaves this many times larger than the noise is itself the better noise.
        most_inflation = 2.0
        return rms > most_inflation * noise


def searched(
    prepared: Prepared,
    terms: list[Term],
    rows: list[Rows],
    noisy: list[Rows] | None,
    left: list[np.ndarray],
    start: list[str] | None,
    segments: list[Segment],
) -> WrenchModel:
    """The search with residuals `left` (n, 12) of every stretch taken for the noise."""
    present = np.flatnonzero(np.isfinite(rows[0].y).all(axis=0))
    floor = channel_floor(segments, prepared.vehicle)
    filters = {c: autoregression([r[:, c] for r in left], floor[c]) for c in present}
    noise = np.full(12, np.nan)
    for c in present:
        noise[c] = np.hypot(np.concatenate([r[:, c] for r in left]).std(), floor[c])
    rate = prepared.thinner.rate_hz
    regression = whitened(prepared, rows, terms, filters, segments, noisy, apart=True)
    contributions = Contributions(rows, noisy, rate)
    per = max(2, int(rate))

    values, held = ([t.key for t in terms if t.kind == kind] for kind in ("value", "held"))
    least_noise = np.concatenate([WORTH_STATING * floor[:6], floor[6:]])
    seconds = Seconds(rows, np.maximum(noise, least_noise), per)

    def sizes_of(key: str, beta: np.ndarray) -> np.ndarray:
        # What refitted values would absorb of a term does not count as its size.
        short = any(t.key == key and t.run for t in terms)
        own = regression.columns([key])
        cols, coefficients = (own, beta) if key in (*values, *held) else regression.beyond(values, key, beta)
        return seconds.sizes(cols, coefficients, 1.0 if short else 0.9)

    # Winds of single runs are always in the model: fits of the search leave their many columns out.
    ask = Questions(sizes_of, seconds.sizes)
    search = Search(regression.without_winds(), ask)
    selection = search.run(start)
    return WrenchModel(prepared, terms, rows, regression, search, selection, noise, noise, contributions=contributions)


def whitened(
    prepared: Prepared,
    rows: list[Rows],
    terms: list[Term],
    filters: dict[int, np.ndarray],
    segments: list[Segment],
    noisy: list[Rows] | None = None,
    apart: bool = False,
    by_channel: bool = False,
) -> Regression:
    """The regression of a flight's rows: blocks of the runs that are fitted count.

    `noisy` are the rows with the sensors' noise added once more. With `apart`, errors of a sensor that is compared with
    another are estimated by that comparison alone. `by_channel` as in `regression.build`.
    """
    rate_hz = prepared.thinner.rate_hz
    rule, block_s = training_rule(prepared.split, segments), block_seconds(rows, rate_hz)
    alone = compared_alone(terms, rows) if apart else ()
    return build(rows, terms, filters, rule, block_s, rate_hz, noisy, *alone, by_channel=by_channel)


def without_unseen(rows: list[Rows], noisy: list[Rows], rate_hz: float, cutoff_hz: float) -> dict[int, np.ndarray]:
    """Make columns say nothing in channels where they are mostly noise, in rows and noisy copies (in place).

    Returns the whitening filters of the noise in channels where some column exceeds the noise only through them.

    In a calm flight, say, the rotors' moment is noise that the residual has with the other sign: a free believed
    value (or a scale error) would take it away and call itself wrong. How much noise there is, is measured where
    little else is: near the cutoff. A column passes as it is or weighed by the colour of the channel's own noise:
    the acceleration of a rotor with a noisy tachometer is all noise at 20 Hz, where the channel is too, and still
    above the noise below 2 Hz.
    """
    band = tuple(share * cutoff_hz for share in NOISE_BAND)
    seen = np.zeros(rows[0].x.shape[1:], bool)
    colours = {}
    most_noise = 0.3  # Share of a column's energy in a channel that may be noise of the sensors it is made of.
    for c in range(12):
        added = [b.y[:, c] - a.y[:, c] for a, b in zip(rows, noisy, strict=True)]
        more = 1.0
        if all(np.isfinite(r.y[:, c]).all() for r in rows):
            power = band_power(added, rate_hz, band)
            more = max(1.0, band_power([r.y[:, c] for r in rows], rate_hz, band) / power) if power > 0 else 1.0
        columns = np.flatnonzero(np.any([r.x[:, c].any(axis=0) for r in rows], axis=0))
        seen[c, columns] = _noise_of_columns(rows, noisy, c, columns) * more <= most_noise
        doubtful = columns[~seen[c, columns]]
        if len(doubtful) and np.isfinite(np.concatenate(added)).all():
            taps = autoregression(added)
            seen[c, doubtful] = _noise_of_columns(rows, noisy, c, doubtful, taps) * more <= most_noise
            if seen[c, doubtful].any():
                colours[c] = taps
    # In place: the columns are the largest arrays of the whole analysis.
    for r in (*rows, *noisy):
        np.multiply(r.x, seen, out=r.x)
    return colours


def _noise_of_columns(rows, noisy, channel: int, columns: np.ndarray, taps: np.ndarray | None = None) -> np.ndarray:
    """Share of the energy of columns (k,) in a channel that is noise, after a whitening filter if one is given."""
    energy, noise = np.zeros(len(columns)), np.zeros(len(columns))
    for a, b in zip(rows, noisy, strict=True):
        x = a.x[:, channel][:, columns]
        added = b.x[:, channel][:, columns] - x
        if taps is not None:
            x, added = causal(taps, x), causal(taps, added)
        energy += (x**2).sum(axis=0)
        noise += (added**2).sum(axis=0)
    return noise / np.maximum(energy, 1e-300)


class Seconds:
    """How large contributions are second by second, from Gram matrices of their columns over blocks of `per` rows.

    A search asks for the size of the same columns with other coefficients over and over: the rows are read once.
    """

    def __init__(self, rows: list[Rows], noise: np.ndarray, per: int):
        self.rows, self.noise, self.per = rows, noise, per
        self._grams: dict[tuple[int, ...], tuple[np.ndarray, list[np.ndarray]]] = {}

    def sizes(self, cols: np.ndarray, beta: np.ndarray, quantile: float = 0.9) -> np.ndarray:
        """Strongest tenth of the seconds of columns times coefficients per channel, in units of its noise, (12,)."""
        channels, parts = self._grams_of(tuple(int(c) for c in cols))
        best = np.zeros(12)
        for gram in parts:
            local = np.sqrt(np.maximum((gram @ beta) @ beta, 0.0))
            # As `np.quantile`, which takes longer for few seconds than all the rest.
            low, part = divmod(quantile * (len(local) - 1), 1.0)
            lower, upper = np.sort(local, axis=0)[[int(low), min(int(low) + 1, len(local) - 1)]]
            best[channels] = np.fmax(best[channels], (lower + part * (upper - lower)) / self.noise[channels])
        return np.nan_to_num(best)

    def _grams_of(self, cols: tuple[int, ...]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Channels (c,) that columns act in, and of every stretch their mean products there, (seconds, c, k, k)."""
        if cols not in self._grams:
            parts = [r.x[: len(r.y) // self.per * self.per][:, :, list(cols)] for r in self.rows]
            channels = np.flatnonzero(np.any([p.any(axis=(0, 2)) for p in parts], axis=0))
            shape = (self.per, len(channels), len(cols))
            parts = [p[:, channels].reshape(len(p) // self.per, *shape) for p in parts if len(p)]
            turned = [p.transpose(0, 2, 3, 1) for p in parts]
            self._grams[cols] = channels, [t @ t.swapaxes(-1, -2) / self.per for t in turned]
        return self._grams[cols]


def path_segments(segments: list[Segment], chain: CommandChain, cutoff_hz: float) -> list[Segment]:
    """Segments whose rotor speeds are what the chain makes of the commands.

    What commands do in answer to lift or moments is no cause of them: of these the mean over `answered_s` counts.
    """
    out = []
    for s in segments:
        speed = caused(chain.speeds(s), s.dt_s, chain)
        acceleration = smoothed_acceleration(speed, s.rate_hz, cutoff_hz)
        out.append(replace(s, motion=replace(s.motion, rotor_speed=speed, rotor_acceleration=acceleration)))
    return out


def caused(speed: np.ndarray, dt_s: float, chain: CommandChain) -> np.ndarray:
    """Rotor speeds (n, k) with the mean over `answered_s` of their collective, and of what they differ by, where these
    are answers."""
    lifted, turned = chain.result.lifted_by_commands, chain.result.turned_by_commands
    if lifted and turned:
        return speed
    squares = speed**2
    # Seconds over which commands that answer disturbances are averaged: trims are slower, answers quicker.
    answered_s = 3.0
    size = min(len(squares) - 1, int(answered_s / dt_s)) | 1
    slow = np.stack([running_mean(column, size) for column in squares.T], axis=1)
    collective, differing = ((squares if own else slow) for own in (lifted, turned))
    parts = collective.mean(axis=1, keepdims=True) + differing - differing.mean(axis=1, keepdims=True)
    return np.sqrt(np.maximum(parts, 0.0))


@step("from command to rotor speed")
def speed_path(prepared: Prepared) -> CommandChain | None:
    """What lies between command and rotor speed; None where no command is recorded, or nothing can show it."""
    segments = [s for s in prepared.segments if s.run in prepared.split.training]
    if not segments or any(s.command is None for s in segments):
        return None
    vehicle = prepared.vehicle
    limits = vehicle.rotor_speed_limits_rad_s
    full_speed = limits[1] if limits else max(float(s.command.max()) for s in segments)
    voltages = [s.motion.voltage for s in prepared.segments]
    full_voltage = max(float(v.max()) for v in voltages) if all(v is not None for v in voltages) else None
    if segments[0].measured_speed:
        problem = MeasuredSpeed(segments, full_speed, full_voltage)
        search = SpeedSearch(problem, candidate_forms(segments, full_voltage is not None))
        return CommandChain(search.run(), full_speed, full_voltage)
    if "force" not in prepared.groups:
        return None
    return chain_of_lift(segments, vehicle, full_speed, full_voltage, _command_rate_hz(prepared))


def _command_rate_hz(prepared: Prepared) -> float:
    """Fresh commands a second, in the run that has fewest."""
    rates = []
    for run in prepared.recordings.runs:
        for group in ("rotor_command", "throttle"):
            names = rotor_columns(group, prepared.vehicle.rotor_count)
            if names and run.has(*names):
                rates.append(own_rate_hz(run.time_s, run.array(names)))
                break
    return min(rates)


def chosen(model: WrenchModel) -> list[tuple[Form, np.ndarray]]:
    """Forms in the model with their parameter values (nonlinear ones at their present point)."""
    found = []
    for key in model.selection.active:
        term = model.search.terms[key]
        cols = model.regression.columns([key])
        where = model.selection.fit.places(cols)
        values = np.array(term.values, float)
        if term.form.linear:
            values[list(term.form.linear)] = model.selection.fit.beta[where]
        found.append((term.form, values))
    return found


@step("refining")
def refine_nonlinear(prepared: Prepared, model: WrenchModel, segments, wide: bool) -> dict[str, np.ndarray]:
    """Best nonlinear parameters of the active terms by a profile over each (others linear, free), bounded.

    What rings is searched about the best of a grid where the search is `wide`, else about its start.
    """
    active = model.selection.active
    refined = {}
    for key in active:
        term = model.search.terms[key]
        others = [t for t in model.terms if t.kind != "effect" or (t.key in active and t.key != key)]
        values = np.array(term.values, float)
        for index in term.form.nonlinear:
            values[index] = _profiled(prepared, model, others, term, values, index, segments, wide)
        if term.form.nonlinear:
            refined[key] = values
    return refined


def _profiled(prepared, model, others, term: Term, values: np.ndarray, index: int, segments, wide: bool) -> float:
    """The value of one nonlinear parameter that leaves the least, searched within a factor of six of its start."""
    parameter, start = term.form.parameters[index], values[index]
    training = [s for s in segments if s.run in prepared.split.training]
    fixed = assemble_rows(prepared, others, training, chosen(model))

    def cost(log_factor: float) -> float:
        trial = values.copy()
        trial[index] = start * np.exp(log_factor)
        moved = replace(term, values=tuple(trial))
        own = assemble_rows(prepared, [moved], training, chosen(model))
        rows = [replace(a, x=np.concatenate([a.x, b.x], axis=2)) for a, b in zip(fixed, own, strict=True)]
        return _profile_cost(model, [*others, moved], rows, fixed_gain=not term.form.linear)

    low = np.log(max(parameter.low, start / 6, 1e-9) / start)
    high = np.log(min(parameter.high, start * 6) / start)
    if term.form.memory and len(parameter.starts) > 1:
        # Points over a nonlinear parameter's range, a tenth apart, where its cost may have several minima.
        memory_grid = 37
        # What rings has several minima over its frequency: the search starts about the best of a grid.
        grid = np.sort(np.append(np.linspace(low, high, memory_grid - 1), 0.0))
        best = int(np.argmin([cost(factor) for factor in grid])) if wide else int(np.searchsorted(grid, 0.0))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, memory_grid - 1)]
    found = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 0.01, "maxiter": 18})
    return float(start * np.exp(found.x))


def nonlinear_intervals(prepared: Prepared, model: WrenchModel, segments) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Values and one-sigma of every parameter of the active terms that have nonlinear ones.

    One Gauss-Newton step with the slopes of the nonlinear parameters as columns; a form without linear parameters
    has its contribution at gain one.
    """
    active = [model.search.terms[k] for k in model.selection.active]
    if not any(t.form.nonlinear for t in active):
        return {}
    values = dict(zip([t.key for t in active], [v for _, v in chosen(model)], strict=True))
    terms = [t for t in model.terms if t.kind != "effect"]
    fixed = []
    for term in active:
        if term.form.swings:
            terms += state_terms(segments, replace(term, values=tuple(float(v) for v in values[term.key])))
        at = tuple(float(v) for v in values[term.key])
        if term.form.linear:
            terms.append(replace(term, values=at))
        else:
            fixed.append(replace(term, values=at))
        terms += [
            Term(f"slope:{term.key}/{i}", "slope", term.effect, term.form, at, 1, (np.inf,), slope_of=i)
            for i in term.form.nonlinear
        ]
    rows = assemble_rows(prepared, terms + fixed, segments, chosen(model))
    width = sum(t.size for t in terms)
    rows = [replace(r, y=r.y - r.x[:, :, width:].sum(axis=2), x=r.x[:, :, :width]) for r in rows]
    regression = whitened(prepared, rows, terms, model.regression.filters, segments)
    fit = regression.fit([t.key for t in terms], jackknife=True)
    out = {}
    for term in active:
        if not term.form.nonlinear:
            continue
        centre, sd = values[term.key].copy(), np.zeros(len(term.form.parameters))
        if term.form.linear:
            cols = regression.columns([term.key])
            centre[list(term.form.linear)] = fit.beta[cols]
            sd[list(term.form.linear)] = np.sqrt(np.diag(fit.covariance)[cols])
        for i in term.form.nonlinear:
            col = regression.columns([f"slope:{term.key}/{i}"])[0]
            sd[i] = np.sqrt(fit.covariance[col, col])
        out[term.key] = (centre, sd)
    return out


def _profile_cost(model: WrenchModel, terms: list[Term], rows: list[Rows], fixed_gain: bool) -> float:
    """Whitened squares of rows with the linear coefficients of `terms` free (the last at gain one if asked)."""
    size = rows[0].x.shape[2]
    gram, cross, square = np.zeros((size, size)), np.zeros(size), 0.0
    for r in rows:
        for c, taps in model.regression.filters.items():
            y = causal(taps, r.y[:, c])[12:]
            x = causal(taps, r.x[:, c])[12:]
            if fixed_gain:
                y = y - x[:, -1]
                x = x[:, :-1]
                gram[:-1, :-1] += x.T @ x
                cross[:-1] += x.T @ y
            else:
                gram += x.T @ x
                cross += x.T @ y
            square += float(y @ y)
    precision = np.concatenate([1 / np.square(np.broadcast_to(t.prior_sd, (t.size,)).astype(float)) for t in terms])
    gram += np.diag(precision) + 1e-9 * np.diag(np.diag(gram)) + 1e-12 * np.eye(size)
    return square - float(cross @ np.linalg.solve(gram, cross))


def in_wind(segments: list[Segment], wind: np.ndarray) -> list[Segment]:
    """Segments whose air moves over ground by `wind` (north, east), m/s."""
    air = np.array([wind[0], wind[1], 0.0])
    return [replace(s, motion=replace(s.motion, wind=air)) for s in segments]


@step("wind")
def with_wind(prepared: Prepared, model: WrenchModel, segments, noisy, terms: list[Term]) -> WrenchModel:
    """The model with drag and lift built on airspeed, where a steady wind and drag were both found.

    Where only drag was, a wind that shows through it alone is looked for: through a drag that grows with the square of
    the airspeed a wind is no force that is constant in world axes.
    """
    wind_id = moving_air("all the time").id
    effects = [model.search.terms[k].effect for k in model.selection.active]
    if not ids_of("feels_air") & set(effects):
        return model
    if wind_id in effects:
        return _blown_by(prepared, model, segments, noisy, terms)
    felt = _with_felt_wind(prepared, model, segments, noisy)
    blown = felt if felt is model else _blown_by(prepared, felt, segments, noisy, terms)
    return model if blown.wind is None else blown


def _with_felt_wind(prepared: Prepared, model: WrenchModel, segments, noisy) -> WrenchModel:
    """The model with a wind that shows through the drag alone, to first order, where the search takes it."""
    active, wind, forms = model.selection.active, moving_air("all the time"), chosen(model)
    effects = [model.search.terms[k].effect for k in active]
    known = all(s.motion.rotation is not None and s.motion.velocity is not None for s in segments)
    if not known or not ids_of("drag") & set(effects):
        return model
    always = [t for t in model.terms if t.kind != "effect"]
    asked = [*always, *[model.search.terms[k] for k in active], _wind_term()]
    regression = regression_of(prepared, asked, forms, in_wind(segments, np.zeros(2)), model.regression.filters)
    keys = [t.key for t in asked]
    seen = regression.compare(keys, keys[:-1])
    if seen.promised.sum() <= LEAST_PROMISE or seen.transfer < LEAST_TRANSFER:
        return model  # what asks for a wind here does not find it elsewhere
    felt = through_drag([f for effect, f in zip(effects, forms, strict=True) if effect in ids_of("feels_air")])
    terms = [*model.terms, *form_terms(wind.id, felt)]
    again = wrench_model(prepared, terms, forms, active, segments, noisy, model)
    return again if any(again.search.terms[k].effect == wind.id for k in again.selection.active) else model


def _wind_term() -> Term:
    """Columns of one metre a second more wind, north and east, through every effect that feels the air."""
    return Term("wind", "wind", moving_air("all the time").id, size=2, prior_sd=(np.inf, np.inf))


def _blown_by(prepared: Prepared, model: WrenchModel, segments, noisy, terms: list[Term]) -> WrenchModel:
    """The model with its steady wind fitted through every effect that feels the air, and the search repeated in it.

    A linear wind column would leave part of the drag and lift to other names. The same model where the wind does not
    show through them, or no drag is left with it.
    """
    active = model.selection.active
    wind_key = next(k for k in active if model.search.terms[k].effect == _wind_term().effect)
    wind = _first_wind(model, wind_key)
    if wind is None:
        return model
    kept = [*(t for t in terms if t.effect != _wind_term().effect), _wind_term()]
    effects = [c for k, c in zip(active, chosen(model), strict=True) if k != wind_key]
    active = [k for k in active if k != wind_key]
    drags, always = ids_of("drag"), [t for t in terms if t.kind != "effect"]
    had = any(model.search.terms[k].effect in drags for k in active)
    # Searches in a wind at most: in moving air another drag may explain more, and through it the wind is another.
    wind_rounds = 3
    for _ in range(wind_rounds):
        again = None  # of a long flight the columns of one model are half a gigabyte: the last round's go first
        own = [*always, *[model.search.terms[k] for k in active], _wind_term()]
        found = _fitted_wind(prepared, own, effects, wind, segments, model.regression.filters)
        if found is None:
            return model
        wind, sd, effects = found
        again = wrench_model(prepared, kept, effects, active, in_wind(segments, wind), in_wind(noisy, wind), model)
        has = {again.search.terms[k].effect for k in again.selection.active}
        if not has & ids_of("feels_air") or (had and not drags & has):
            return model
        if set(again.selection.active) == set(active):
            break
        active, effects = again.selection.active, chosen(again)
    again.wind, again.wind_sd = wind, sd
    return again


def regression_of(prepared: Prepared, terms: list[Term], effects, segments, filters) -> Regression:
    """The regression of these terms alone, whitened as a model's was; `effects` are the forms at work."""
    return whitened(prepared, assemble_rows(prepared, terms, segments, effects), terms, filters, segments)


def _fitted_wind(prepared: Prepared, terms: list[Term], effects, wind: np.ndarray, segments, filters):
    """A steady wind (north, east), m/s, its one-sigma, and `effects` with their linear values jointly.

    By Gauss-Newton from `wind`; None for a wind that the fit through the drag does not see. `terms` end with those of
    `effects` and the wind's own.
    """
    own = terms[-1 - len(effects) : -1]
    for _ in range(4):
        regression = regression_of(prepared, terms, effects, in_wind(segments, wind), filters)
        fit = regression.fit([t.key for t in terms], jackknife=True)
        step = fit.beta[-2:]
        wind = wind + np.clip(step, -3.0, 3.0)
        effects = [with_linear(e, regression, fit, t) for e, t in zip(effects, own, strict=True)]
        if np.abs(step).max() < 0.01:
            break
    blown = replace(fit, beta=np.append(fit.beta[:-2], wind))  # the last step from it is all that the fit holds
    most_p_of_wind = 1e-3  # p-value up to which a wind is seen by the fit through the drag.
    if regression.wald(blown, regression.columns(["wind"]), int(regression.training.sum())) > most_p_of_wind:
        return None
    return wind, np.sqrt(np.diag(fit.covariance)[-2:]), effects


def with_linear(effect: tuple[Form, np.ndarray], regression: Regression, fit: Fit, term: Term):
    """A form with its linear values as fitted."""
    form, values = effect
    if form.linear:
        values = values.copy()
        values[list(form.linear)] = fit.beta[np.isin(fit.columns, regression.columns([term.key]))]
    return form, values


def _first_wind(model: WrenchModel, wind_key: str) -> np.ndarray | None:
    """Wind (north, east), m/s, from a linear wind column and the drag found with it; None without a drag."""
    values = dict(zip(model.selection.active, chosen(model), strict=True))
    form, force = values[wind_key]
    drag = linear_drag(model)
    speed = np.mean([r for s in model.prepared.segments for r in s.motion.rotor_speed.sum(axis=1)[::50]])
    if not form.linear_drag:
        return force  # it is the wind itself
    if form.linear_drag == "of airspeed alone":
        force = force / speed
    if drag is not None:
        k_d = np.mean(drag[1]) if drag[0].linear_drag == "times rotor speed" else drag[1][0] / speed
        return force / k_d if k_d > 0 else None
    return np.zeros(2) + 0.5 * np.sign(force)


def linear_drag(model: WrenchModel) -> tuple[Form, np.ndarray] | None:
    """The drag in proportion to airspeed that is in a model, with its values; None where there is none."""
    pairs = zip(model.selection.active, chosen(model), strict=True)
    drags = (c for k, c in pairs if model.search.terms[k].effect in ids_of("drag"))
    return next((c for c in drags if c[0].linear_drag), None)


def after_residual(model: WrenchModel) -> list[np.ndarray]:
    """Residual rows with the selected effects, (n, 12) per segment."""
    full = model.full_fit()
    return [r.y - r.x[:, :, full.columns] @ full.beta for r in model.rows]
