"""The regression of an instrument: rows (reading less load, and what every candidate would add to it), whitening,
blocks, search over the catalogue, nonlinear parameters refined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.catalogue import before_the_rotors, catalogue
from rotorid.effects.contract import Form, not_testable_reason
from rotorid.effects.loading import NO_ROTORS, Loading, forms_of, weight
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.select import Questions, Search, Selection
from rotorid.mismatch.decide.support import Chosen, chosen_at
from rotorid.mismatch.evidence.comparison import LEAST_RUNS
from rotorid.mismatch.evidence.regression import (
    MOST_ATTENUATION,
    Regression,
    autoregression,
    bounded,
    build,
    full_fit_residuals,
)
from rotorid.mismatch.evidence.rows import Contributions, Rows, Term, form_reading, form_terms
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.instrument.setup import SHORT, PreparedInstrument, averaged, has_weight, pieces_of, rotor_wrench
from rotorid.recordings import Vehicle
from rotorid.recordings.signal.kernels import causal

_DEFAULT_TRUST = {"thrust": 0.1, "torque": 0.2, "mass": 0.05, "arm": 0.03, "gain": 0.03}
VALUE_NAMES = {
    "thrust": "thrust_coefficient_n_s2",
    "torque": "torque_coefficient_n_m_s2",
    "mass": "mass_kg",
    "arm": "arm_scale",
    "gain": "reading_gain",
    "gain_x": "reading_gain_x",
    "gain_y": "reading_gain_y",
    "gain_z": "reading_gain_z",
}
_STILL = "the vehicle does not move on a stand"
OFFSET = "offset:load-reading"
_AtWork = Sequence[tuple[Form, np.ndarray]]
"""Forms with their parameter values."""
_DISPLACED = ("velocity", "angular_velocity", "angular_acceleration", "specific_force", "accelerometer", "gyroscope")
MEMORY = 4
"""Blocks over which the noise of a sensor may be alike beyond what whitening takes away: 1/f noise has no end."""
MOST_OFFSET = 2.0
"""Samples by which reading and load may lie apart before it is a finding. The derivative of a reading that lags by τ is
what it lacks, divided by τ: an offset in time without end would be that filter itself."""
UNMOVED = 1e-9
"""Relative change of a believed value that is held."""


class ReadingSearch(Search):
    """The search, which also asks whether nonlinear parameters are resolved and which others carry over."""

    def __init__(self, regression: Regression, ask: Questions, refused: Mapping[str, str] | None = None):
        super().__init__(regression, ask)
        self.refused = refused or {}

    def physical(self, term, beta, error):
        """Also no nonlinear parameter at its bound, and none that is below what an instrument resolves."""
        for i in term.form.nonlinear:
            parameter, value = term.form.parameters[i], term.values[i]
            near = 0.01 * min(parameter.high - parameter.low, abs(value) + 1e-12)
            if value > parameter.high - near or (value < parameter.low + near and parameter.low > 0):
                return False
            if not term.form.linear and abs(value) < parameter.negligible:
                return False
        return super().physical(term, beta, error)

    def candidates(self, active, *rest):
        # More causes than this at once are not distinguished by six channels: what they leave is stated as unexplained.
        most_at_once = 6
        return iter(()) if len(active) >= most_at_once else super().candidates(active, *rest)

    def swapped(self, active, dropped):
        """A model with one id in another's place; no nameless one takes that of a named one that explains most of it.

        What mixes the loads anew in each run holds every crosstalk of runs that load one axis each, and a little more.
        """
        found = super().swapped(active, dropped)
        if found is None or not self._displaces_a_name(active, found):
            return found
        nameless = {t.once for t in self.terms.values() if t.effect in UNKNOWNS}
        return super().swapped(active, {**dropped, **dict.fromkeys(nameless, "without a name")})

    def _displaces_a_name(self, active: list[str], found: list[str]) -> bool:
        """Whether a nameless id stands in `found` for named ones that explain most of what it does."""
        most_of_it = 0.5  # Share of what a nameless id explains from which a named one is not given up for it.
        new = [k for k in found if k not in active]
        gone = [k for k in active if k not in found]
        if not any(self.terms[k].effect in UNKNOWNS for k in new) or not gone:
            return False
        rest = [*self.always, *(k for k in found if k in active)]
        base, named, nameless = (self.regression.explained([*rest, *own]) for own in ([], gone, new))
        return named - base > most_of_it * (nameless - base)

    def unsteady(self, active):
        """None: an instrument's runs load different axes, and no coefficient could be asked of each."""
        return None

    def alternatives(self, key, active):
        """Of what is collinear with a term over all runs together, what is worth about as much where it was not fitted.

        A stand's runs differ in their tilt: one of them may separate a weight's moment from a tare. What has numbers of
        its own for every run says nothing of one that was left out; what explains as much by more numbers is no rival.
        """
        rest = [k for k in active if k != key]
        runs = len(np.unique(self.regression.run[self.regression.training]))

        def refuted(effect):
            own, terms = [*self.always, *rest, key], [t.key for t in self.terms.values() if t.effect == effect]
            others = ([*self.always, *rest, t] for t in terms)
            worse = min(self.regression.compare(own, o, whole_runs=runs >= LEAST_RUNS).total for o in others)
            return rules.ELSEWHERE(worse > rules.ELSEWHERE["squares"])

        return [effect for effect in super().alternatives(key, active) if not refuted(effect)]


@dataclass
class ReadingModel:
    """A fitted model of an instrument's reading."""

    setup: PreparedInstrument
    loadings: tuple[Loading, ...]
    terms: list[Term]
    rows: list[Rows]
    regression: Regression
    search: Search
    selection: Selection
    noise: np.ndarray
    """One sigma of a row's noise by channel, (6,); NaN where a channel is not compared."""

    @property
    def contributions(self) -> Contributions:
        """What the terms add to the reading."""
        return Contributions(self.rows)

    @property
    def rows_per_block(self) -> int:
        """Rows of a block of the regression."""
        return block_length(self.setup, self.rows)

    def unnamed(self, columns: np.ndarray) -> np.ndarray:
        """Mask of the columns of terms without a name: fitted, so that nothing else takes them up; not delivered."""
        keys = [k for k in self.selection.active if self.search.terms[k].effect in UNKNOWNS]
        return np.isin(columns, self.regression.columns(keys))

    def delivered_with(self, keys: Sequence[str], loose: dict[str, float]) -> list[str]:
        """Keys of all nuisances and of the terms `keys`."""
        return [*self.regression.keys_of("nuisance"), *keys]

    def values_beside(self, active: Sequence[str]) -> list[str]:
        """Keys of the believed values that no form at work absorbs."""
        kept = kept_values(self.search, active)
        return [k for k in self.regression.keys_of("value") if k in kept]

    def change(self, key: str, coefficient: float, sd: float) -> tuple[float, float]:
        """Relative change of a believed value and its one-sigma: nothing accelerates on a stand, its coefficient."""
        return coefficient, sd

    def coefficient(self, key: str, change: float) -> float:
        """Coefficient of a relative change of a believed value: itself."""
        return change


def kept_values(search: Search, active: Sequence[str]) -> list[str]:
    """Terms that are in every model next to the effects, less believed values that a form at work absorbs."""
    taken = {v for k in active for v in search.terms[k].form.takes_up}
    return [k for k in search.always if k not in taken]


def chosen_already(model: ReadingModel) -> Chosen:
    """The model of a stand or bench that was chosen, with its posterior and support."""
    taps = model.regression.filters
    return chosen_at(regression_of(model.setup, model.rows, model.terms, taps, by_channel=True), model.selection.active)


def regression_of(
    setup: PreparedInstrument,
    rows: list[Rows],
    terms: list[Term],
    filters: dict[int, np.ndarray],
    noisy: list[Rows] | None = None,
    by_channel: bool = False,
) -> Regression:
    """The regression of a reading's rows; `filters`, `noisy` and `by_channel` as in `regression.build`."""
    block_s = block_length(setup, rows) / setup.rate_hz
    out = build(rows, terms, filters, None, block_s, setup.rate_hz, noisy, by_channel=by_channel)
    restrain(out, setup)
    return out


def block_length(setup: PreparedInstrument, rows: list[Rows]) -> int:
    """Rows of a block: short stretches whole, else about `block_s`, within bounds on their number."""
    typical = float(np.median([len(r.y) for r in rows]))
    total = sum(len(r.y) for r in rows)
    least_blocks = 40
    if typical < SHORT:
        return max(2, int(typical)) if len(rows) >= 12 else max(2, total // least_blocks)
    block_s = 2.0
    wanted = block_s * setup.rate_hz
    most_blocks = 150
    return int(np.clip(wanted, max(total / most_blocks, 5), max(total / least_blocks, 5)))


def _noise_and_filters(
    setup: PreparedInstrument, terms: list[Term], rows: list[Rows]
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Noise by channel (6,) and whitening filters, from what the whole catalogue leaves."""
    total = sum(len(r.y) for r in rows)
    size = rows[0].x.shape[2]
    rows_per_column = 8
    kept = _modest(terms, total // rows_per_column) if size > total // rows_per_column else np.arange(size)
    precision = np.concatenate([1.0 / np.square(np.asarray(t.prior_sd, float)) for t in terms])
    thin = [Rows(r.run, r.time_s, r.y, r.x[:, :, kept]) for r in rows]
    left, _ = full_fit_residuals(thin, precision[kept])
    noise, filters = np.full(6, np.nan), {}
    correction = np.sqrt(total / max(total - len(kept), 1))
    short = np.median([len(r.y) for r in rows]) < SHORT
    for c in setup.instrument.channels:
        parts = [r[:, c] - r[:, c].mean() * short for r in left]
        sigma = float(np.sqrt(np.mean(np.concatenate([r[:, c] for r in left]) ** 2))) * correction
        noise[c] = max(sigma, 1e-12)
        filters[c] = np.array([1.0 / noise[c]]) if short else autoregression(parts)
    return noise, filters


def _modest(terms: list[Term], most: int) -> np.ndarray:
    """Columns of the first form of each id, the short ones first, as many as the rows can bear."""
    at, places = 0, []
    seen: set[str] = set()
    for t in terms:
        if t.effect not in seen or t.kind != "effect":
            places.append((t.size if t.kind == "effect" else 0, at, t.size))
            seen.add(t.effect)
        at += t.size
    chosen: list[int] = []
    for _, start, size in sorted(places):
        if len(chosen) + size > max(most, 2):
            break
        chosen += range(start, start + size)
    return np.array(sorted(chosen), int)


def whole_reading(terms: list[Term], active) -> list[tuple[Form, np.ndarray]]:
    """Forms at work that change the reading as a whole, gain one: filters, resonances, other clocks."""
    chosen = [t for t in terms if t.key in (active or ()) and _changes_whole(t)]
    return [(t.form, np.array(t.values, float)) for t in chosen]


def reading_model(
    setup: PreparedInstrument,
    terms: list[Term],
    active: list[str] | None = None,
    loadings=None,
    filters=None,
    refused=None,
) -> ReadingModel:
    """Rows, regression and search from what is `active`; `filters` (noise, taps) of an earlier round may be kept.

    Ids that are `refused`, with the reason, do not enter.
    """
    whole = whole_reading(terms, active)
    # Measured speeds are the load: their noise is in regressors and residual, and is learnt by adding it once more.
    noisy = rows_of(setup, terms, setup.noisier, whole) if loadings is None and setup.noisier is not None else None
    loadings = setup.loadings if loadings is None else loadings
    rows = rows_of(setup, terms, loadings, whole)
    noise, taps = _noise_and_filters(setup, terms, rows) if filters is None else filters
    short = np.median([len(r.y) for r in rows]) < SHORT
    regression = regression_of(setup, rows, terms, taps, noisy)
    joint_sizes = size_of_columns(rows, noise, max(1, int(setup.rate_hz)) if not short else 1)
    sizes = _size_function(regression, joint_sizes)
    search = ReadingSearch(regression, Questions(sizes, joint_sizes), refused)
    selection = search.run(active)
    always = kept_values(search, selection.active)
    if always != search.always:
        selection = replace(selection, fit=regression.fit(always + selection.active, jackknife=True))
    return ReadingModel(setup, tuple(loadings), terms, rows, regression, search, selection, noise)


def restrain(regression: Regression, setup: PreparedInstrument) -> None:
    """Say, in place, how long noise is alike, and limit an offset in time and believed values that nothing excites.

    What is more of an offset is a delay or a filter. Of a value whose column is mostly the speeds' noise (the arm while
    all rotors turn alike) nothing is said: it stays as believed.
    """
    regression.memory = MEMORY
    for key in regression.keys_of("nuisance"):
        if key == OFFSET:
            regression.limit[regression.columns([key])] = MOST_OFFSET / setup.instrument.rate_hz
    for key in regression.keys_of("value"):
        if regression.column_noise(key) > MOST_ATTENUATION:
            regression.limit[regression.columns([key])] = UNMOVED


def size_of_columns(rows: list[Rows], noise: np.ndarray, per: int):
    """Size of columns with coefficients: rms over the strongest tenth of the seconds, in units of the noise, (6,)."""
    unit_noise = np.where(np.isfinite(noise), noise, np.inf)

    # Quantile of the seconds' energies above which a contribution's size is taken: what shows only after a change of
    # load is in few of them.
    strongest = 0.9

    def sizes(cols: np.ndarray, beta: np.ndarray) -> np.ndarray:
        energies = []
        for r in rows:
            square = (r.x[:, :, cols] @ beta) ** 2
            count = max(1, len(square) // per)
            whole = len(square) // count * count
            energies.append(square[:whole].reshape(count, -1, 6).mean(axis=1))
        every = np.sort(np.concatenate(energies), axis=0)
        return np.sqrt(every[int(strongest * len(every)) :].mean(axis=0)) / unit_noise

    return sizes


def _size_function(regression: Regression, of_columns):
    """Size of a term by channel, in units of the noise and of its form's resolution, (6,)."""
    resolution = {t.key: t.form.resolution if t.form else 1.0 for t in regression.terms}
    return lambda key, beta: of_columns(regression.columns([key]), beta) / resolution[key]


def refined(model: ReadingModel) -> tuple[list[Term], float]:
    """Terms with the nonlinear parameters of those at work fitted, all linear ones free (variable projection).

    Second the sum of whitened squares that is left.
    """
    setup, search = model.setup, model.search
    moving = [k for k in model.selection.active if search.terms[k].form.nonlinear]
    if not moving:
        return model.terms, np.inf
    timing = [k for k in search.always if search.terms[k].kind == "nuisance"]
    always = kept_values(search, model.selection.active)
    fixed = [k for k in (*always, *model.selection.active) if k not in moving and k not in timing]
    reg = model.regression

    taps = reg.filters
    longest = max(len(t) for t in taps.values()) - 1

    def white(values):
        """Columns (n, 6) of every part through the whitening filters, in a row."""
        return np.concatenate(
            [np.stack([causal(taps[c], v[:, c])[longest:] for c in taps], axis=1).ravel() for v in values]
        )

    y = white([np.nan_to_num(r.y) for r in model.rows])
    base = [white([r.x[:, :, c] for r in model.rows]) for c in reg.columns(fixed)]
    prior = reg.precision[reg.columns(fixed)]
    spans = [(k, i) for k in moving for i in search.terms[k].form.nonlinear]
    start = np.array([search.terms[k].values[i] for k, i in spans])
    parameters = [search.terms[k].form.parameters[i] for k, i in spans]
    low, high = np.array([p.low for p in parameters]), np.array([p.high for p in parameters])
    span = np.where(np.isfinite(high - low), high - low, 0.0)
    scale = np.where(start == 0.0, 0.02 * span, np.maximum(np.abs(start), 1e-9))

    def with_values(theta):
        out = {k: np.array(search.terms[k].values, float) for k in moving}
        for (k, i), value in zip(spans, theta, strict=True):
            out[k][i] = value
        return {k: replace(search.terms[k], values=tuple(v)) for k, v in out.items()}

    def residual(theta):
        target, free = y, list(base)
        weights, limits = list(prior), [np.inf] * len(base)
        moved = list(with_values(theta).values())
        terms = [*(search.terms[k] for k in timing), *moved]
        rows = rows_of(setup, terms, model.loadings, whole_reading(moved, moving))
        at = 0
        for term in terms:
            own = [white([r.x[:, :, c] for r in rows]) for c in range(at, at + term.size)]
            at += term.size
            if term.kind == "effect" and not term.form.linear:
                target = target - own[0]
                continue
            free += own
            weights += [1.0 / sd**2 for sd in term.prior_sd]
            limits += [MOST_OFFSET / setup.instrument.rate_hz if term.kind == "nuisance" else np.inf] * len(own)
        if not free:
            return target
        x = np.stack(free, axis=1)
        beta = bounded(x.T @ x + np.diag(weights), x.T @ target, np.array(limits))[0]
        return target - x @ beta

    start = np.clip(start, low + 1e-9 * scale, high - 1e-9 * scale)
    found = least_squares(
        residual, start, bounds=(low, high), x_scale=scale, diff_step=1e-3, max_nfev=25, xtol=1e-6, ftol=1e-8
    )
    best = with_values(found.x)
    return [best.get(t.key, t) for t in model.terms], 2.0 * found.cost


def fitted_model(
    setup: PreparedInstrument, terms: list[Term], active: list[str] | None = None, loadings=None, refused=None
) -> ReadingModel:
    """Search and refinement in turn until the same terms with the same values come out.

    What is noise is learnt anew after the first refinement: whitened by a ring or a lag that no column had before it,
    the regression would be deaf at the very frequencies where the effect shows.
    """
    rounds = 4
    # Relative change of nonlinear parameters from round to round below which they have settled.
    settled = 1e-3
    model = reading_model(setup, terms, active, loadings, refused=refused)
    for number in range(rounds):
        before, start = model.selection.active, _nonlinear_values(model)
        if not len(start):
            break
        terms, _ = refined(model)
        kept = (model.noise, model.regression.filters) if number else None
        model = reading_model(setup, terms, before, loadings, kept, refused)
        values = _nonlinear_values(model)
        if set(model.selection.active) == set(before) and np.allclose(values, start, rtol=settled):
            break
    rivals = _rivals_refined(model)
    if not rivals:
        return model
    kept = (model.noise, model.regression.filters)
    terms = [rivals.get(t.key, t) for t in model.terms]
    return reading_model(setup, terms, model.selection.active, loadings, kept, refused)


def _rivals_refined(model: ReadingModel) -> dict[str, Term]:
    """Of the terms that could change the reading in place of one at work those that leave no more, parameters fitted.

    A delay whose length was fitted explains more than any low-pass whose cutoff was not.
    """
    search, selection, found = model.search, model.selection, {}
    whole = [k for k in selection.active if _changes_whole(search.terms[k])]
    most = refined(model)[1] + rules.ELSEWHERE["squares"] if whole else 0.0
    for key in whole:
        rest = [k for k in selection.active if k != key]
        taken = {search.terms[k].effect for k in rest} | set(search.refused)
        own = search.terms[key].effect, search.terms[key].form.name
        starts: dict[tuple[str, str], list[str]] = {}
        for term in model.terms:
            if _changes_whole(term) and term.effect not in taken and (term.effect, term.form.name) != own:
                starts.setdefault((term.effect, term.form.name), []).append(term.key)
        for keys in starts.values():
            best = max(keys, key=lambda start: search.worth([*rest, start]))
            terms, left = refined(replace(model, selection=replace(selection, active=[*rest, best])))
            if left < most:
                found[best] = next(t for t in terms if t.key == best)
    return found


def _changes_whole(term: Term) -> bool:
    """Whether a term changes the reading as a whole: a filter, a resonance, another clock."""
    return term.kind == "effect" and not term.form.linear


def _nonlinear_values(model: ReadingModel) -> np.ndarray:
    """Nonlinear parameters of all terms at work, in their order."""
    terms = [model.search.terms[k] for k in sorted(model.selection.active)]
    return np.array([t.values[i] for t in terms for i in t.form.nonlinear])


def active_values(model: ReadingModel, key: str) -> np.ndarray:
    """Parameter values of a term at work, linear and nonlinear."""
    term = model.search.terms[key]
    values = np.array(term.values, float)
    if term.form.linear:
        fit = model.selection.fit
        where = fit.places(model.regression.columns([key]))
        values[list(term.form.linear)] = fit.beta[where]
    return values


def nonlinear_deviation(model: ReadingModel, key: str) -> np.ndarray:
    """One-sigma of every parameter of a term with nonlinear ones, (p,): its slopes join the regression."""
    setup, term, form = model.setup, model.search.terms[key], model.search.terms[key].form
    active = model.selection.active
    at_work = [replace(t, values=tuple(active_values(model, t.key))) if t.key in active else t for t in model.terms]
    own = next(t for t in at_work if t.key == key)
    stay = {*kept_values(model.search, active), *active} - (set() if form.linear else {key})
    slopes = [
        Term(f"{key}/slope{i}", "slope", term.effect, form, own.values, 1, (np.inf,), slope_of=i)
        for i in form.nonlinear
    ]
    terms = [*(t for t in at_work if t.key in stay), *slopes]
    rows = rows_of(setup, terms, model.loadings, whole_reading(at_work, active))
    if not form.linear:
        # The form itself, at gain one, is in the model: only its slopes are fitted.
        known = rows_of(setup, [own], model.loadings)
        rows = [Rows(r.run, r.time_s, r.y - k.x[:, :, 0], r.x) for r, k in zip(rows, known, strict=True)]
    regression = regression_of(setup, rows, terms, model.regression.filters)
    fit = regression.fit([t.key for t in terms], jackknife=True)
    sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    out = np.zeros(len(form.parameters))
    for places, keys in ((form.nonlinear, [s.key for s in slopes]), (form.linear, [key] if form.linear else [])):
        out[list(places)] = sd[fit.places(regression.columns(keys))]
    return out


def _value_keys(setup: PreparedInstrument) -> list[str]:
    """Believed values that this set can contradict."""
    vehicle, channels = setup.vehicle, setup.instrument.channels
    if vehicle.kind == "bench":
        loaded = [k for k in setup.instrument.loaded if k < 3]
        return ["gain"] + ([f"gain_{'xyz'[k]}" for k in loaded] if len(loaded) > 1 else [])
    keys = []
    commanded = not all(x.measured for x in setup.loadings)
    if not (commanded and setup.estimated_full_speed):
        keys.append("thrust")
    if 5 in channels and vehicle.torque_coefficients_n_m_s2().any():
        keys.append("torque")
    if has_weight(vehicle) and any(k < 3 for k in channels):
        keys.append("mass")
    if any(k in (3, 4) for k in channels) and np.abs(vehicle.rotor_positions_m()).max() > 0:
        keys.append("arm")
    return keys


def make_terms(setup: PreparedInstrument) -> tuple[list[Term], dict[str, str]]:
    """Every term that this set can test, and the ids that it cannot, with the reason."""
    trust = setup.vehicle.trust
    sd = {k: max(trust.get(VALUE_NAMES[k], _DEFAULT_TRUST[k.split("_")[0]]), 1e-6) for k in _value_keys(setup)}
    terms = [Term(key, "value", prior_sd=(relative,)) for key, relative in sd.items()]
    reasons: dict[str, str] = {}
    if not setup.steady_points and not setup.instrument.by_hand:
        terms.append(Term(OFFSET, "nuisance", prior_sd=(0.5 / setup.instrument.rate_hz,)))
    empirical = [e for e in UNKNOWNS.values() if e.reading_forms]
    for effect in (*catalogue().values(), *empirical):
        if effect.id in before_the_rotors() or not effect.fitted:
            continue
        if setup.instrument.by_hand and effect.shows == "after a change of load":
            reasons[effect.id] = "loads were put on by hand: their first moments are not known"
            continue
        if setup.steady_points and effect.shows:
            reasons[effect.id] = "the recordings are steady points: nothing that takes time shows in them"
            continue
        if effect.shows_in_moments and not any(c >= 3 for c in setup.instrument.channels):
            reasons[effect.id] = "only forces are read: what each rotor gives shows in the moments"
            continue
        found, why = [], None
        for form in forms_of(effect, setup.instrument):
            if not effect.reading_forms:
                lacking = _lacks(form, setup)
                if lacking:
                    why = why or lacking
                    continue
            found += form_terms(effect.id, form)
        terms += found
        if not found and effect.id not in UNKNOWNS:
            of_kind = NO_ROTORS if setup.instrument.bench else _STILL
            reasons[effect.id] = why or (of_kind if effect.lack_on is None else effect.lack_on(setup.instrument))
    return terms, reasons


def _lacks(form: Form, setup: PreparedInstrument) -> str | None:
    """Why a form for a flight cannot be tested on this stand."""
    if any(name in _DISPLACED for name in form.requires):
        return _STILL
    return next((r for x in setup.loadings if (r := not_testable_reason(form, x.motion, setup.vehicle))), None)


def value_column(key: str, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading of a relative change of one believed value, (n, 6)."""
    if key == "gain":
        return loading.load
    if key.startswith("gain_"):
        out = np.zeros_like(loading.load)
        axis = "xyz".index(key[-1])
        out[:, axis] = loading.load[:, axis]
        return out
    if key == "mass":
        return weight(loading.motion, vehicle)
    if key == "torque":
        still = vehicle.model_copy(update={"thrust_coefficient_n_s2": 1e-300})
        return rotor_wrench(loading.motion, still)
    still = vehicle.model_copy(update={"torque_coefficient_n_m_s2": None})
    if key == "thrust":
        return rotor_wrench(loading.motion, still)
    flat = still.model_copy(
        update={"rotors": tuple(r.model_copy(update={"x_m": 0.0, "y_m": 0.0}) for r in vehicle.rotors)}
    )
    return rotor_wrench(loading.motion, still) - rotor_wrench(loading.motion, flat)


def _term_columns(term: Term, loading: Loading, vehicle: Vehicle, at_work: _AtWork = ()) -> list[np.ndarray]:
    """Columns of a term, (n, 6) each; the offset in time moves the load with what is `at_work` on its reading."""
    if term.kind == "value":
        return [value_column(term.key, loading, vehicle)]
    if term.kind == "nuisance":
        predicted = sum((form_reading(form, values, loading, vehicle) for form, values in at_work), loading.load)
        return [np.gradient(predicted, loading.dt_s, axis=0)]
    form, values = term.form, np.asarray(term.values, float)
    if term.slope_of is not None:
        step = 1e-3 * max(abs(values[term.slope_of]), 1e-6)
        up, down = values.copy(), values.copy()
        up[term.slope_of] += step
        down[term.slope_of] -= step
        return [(form_reading(form, up, loading, vehicle) - form_reading(form, down, loading, vehicle)) / (2 * step)]
    if not form.linear:
        return [form_reading(form, values, loading, vehicle)]
    columns = []
    for index in form.linear:
        unit = values.copy()
        unit[list(form.linear)] = 0.0
        unit[index] = 1.0
        columns.append(form_reading(form, unit, loading, vehicle))
    return columns


def rows_of(setup: PreparedInstrument, terms: list[Term], loadings=None, at_work: _AtWork = ()) -> list[Rows]:
    """Rows of every stretch's parts, averaged; a channel that is not compared is NaN in y and zero in x.

    `at_work` are the effects known so far: what a reading's clock is off moves their part of it as well.
    """
    out = []
    channels = list(setup.instrument.channels)
    for loading in setup.loadings if loadings is None else loadings:
        pieces = pieces_of(loading, setup.average)
        if not pieces:
            continue
        y = np.full((loading.size, 6), np.nan)
        y[:, channels] = (loading.reading - loading.load)[:, channels]
        small, times = averaged(y, setup.average), averaged(loading.time_s, setup.average)
        x = np.zeros((len(small), 6, sum(t.size for t in terms)))
        at = 0
        for term in terms:
            for column in _term_columns(term, loading, setup.vehicle, at_work):
                x[:, channels, at] = averaged(column[:, channels], setup.average)
                at += 1
        out += [Rows(loading.run, times[p], small[p], x[p]) for p in pieces]
    return out
