"""How far apart two competing models are on recordings not made yet, by the comparison that the engine decides with.

The engine compares models by what they leave in whitened squares (`mismatch.evidence.comparison`). If model h is
true with coefficients θ, the best that its rival can do leaves λ more of them: what is left of h's contribution once
the rival's terms and all that both share are fitted to it, with the priors and within the limits of the engine's own
fit. A believed value moves at a cost and no further than its limit: without one the rotors' distance would take over
most of a moment. The loss difference that the engine will then find is about λ with a standard deviation of 2 √λ: in
standard errors of the data the models are √λ apart, give or take one. The normal equations are those of the set as
recorded plus those of the part of the simulated flight that will be fitted, through the same filters (the instruments'
noise and what the model left).

A separation is the median over draws of θ, as doubtful as the set leaves it, and over the forms of h that the set does
not distinguish. How fast the vehicle's loops are is known
roughly: a flight is simulated with the bandwidths as stated and with slower ones (SLOWER_LOOPS), and the smaller median
is the one stated. The interval is over all draws of both.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from rotorid.mismatch.decide.problem import Prior
from rotorid.mismatch.evidence.comparison import ENVIRONMENT_S
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import Regression, autoregression, ridge_inverse
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.evidence.split import HELD_OUT_SHARE
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.flight.absent import scales
from rotorid.mismatch.flight.prepare import Prepared, assemble_rows, prepare_like
from rotorid.mismatch.flight.wrench import after_residual, channel_floor, chosen, path_segments, whitened
from rotorid.plan.candidates import Limits, Reference
from rotorid.plan.questions import FittedSet, Hypothesis, Question, chain_interval, chain_squares
from rotorid.plan.simulate import ChangedVehicle, CompetingModel, SimulatedFlight, commands, fly, recorded
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.steps import step

_DRAWS = 400
_LEAST_RATE_HZ = 400.0
"""Flights are simulated at least this finely."""
FITTED_SHARE = 1.0 - HELD_OUT_SHARE
"""Share of a later recording that the joint judgement fits: the rest is held out (`rotorid.plan.questions`)."""
_SIZES = np.geomspace(1e-2, 1e2, 41)
"""Sizes, of the coefficients found, among which that of a model's coefficients is looked for."""


@dataclass(frozen=True)
class Information:
    """What some recordings hold about the open questions."""

    gram: np.ndarray
    """Normal equations of the set's terms, in the columns of the set's regression: (K, K), of a flight (C, K, K), one
    for each of SLOWER_LOOPS."""
    squares: np.ndarray | float = 0.0
    """λ of every pair of competing chains, (P,) or (C, P); 0 for nothing."""
    seconds: float = 0.0
    """How long they are."""
    shares: np.ndarray | float = 0.0
    """Products (K, K) of the columns as shares of the weight, summed over these seconds; of flights alone."""

    def __add__(self, other: Information) -> Information:
        return Information(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    def share(self, of: float) -> Information:
        """A share of it: a part of the recordings in which the same is done."""
        return Information(*(of * value for value in vars(self).values()))

    @property
    def each(self) -> list[np.ndarray]:
        """Normal equations (K, K) of each of the loops."""
        return list(self.gram.reshape(-1, *self.gram.shape[-2:]))


@dataclass(frozen=True)
class Separation:
    """How far apart a model is from its nearest rival if it is the true one."""

    true: str
    rival: str
    sigma: float
    interval_95: tuple[float, float]
    """Of the separation that will be found: the model's own doubt about its size, the loops' and the noise's."""
    so_far: float
    """What the set at hand separates them by."""
    log_odds: float = 0.0
    """Expected log odds, nats, of the true model against its nearest rival."""


def asked_terms(known: FittedSet, ids: Iterable[str] = ()) -> list[Term]:
    """Terms that any open question needs, or that stand for some `ids`, in the order of the regression."""
    wanted = {*known.model.search.always, *known.model.selection.active}
    for question in known.questions:
        wanted |= {*question.shared, *(k for choices in question.rivals.values() for keys in choices for k in keys)}
    return [t for t in known.regression.terms if t.key in wanted or (t.effect and t.effect in ids)]


def placed(known: FittedSet, terms: Sequence[Term], products: np.ndarray) -> np.ndarray:
    """Products (k, k) of the columns of some terms at their places in the set's regression, (K, K)."""
    columns = known.regression.columns([t.key for t in terms])
    out = np.zeros_like(known.regression.gram[0])
    out[np.ix_(columns, columns)] = products
    return out


def of_set(known: FittedSet) -> Information:
    """What the fitted runs of the set hold."""
    regression = known.regression
    gram, _, bias, _ = regression.normal(np.arange(len(regression.precision)))
    seconds = float(regression.training.sum() * regression.block_s)
    flight = isinstance(known, FittedSet)
    shares = seconds * _shares_of(known.model.rows, known.prepared.vehicle) if flight else 0.0
    return Information(gram - bias, seconds=seconds, shares=shares)


def _shares_of(rows: Sequence[Rows], vehicle: Vehicle) -> np.ndarray:
    """Products (K, K) of the columns of force and moment as shares of the weight, the mean over rows."""
    scale = scales(vehicle)[:, None]
    columns = [np.nan_to_num(r.x[:, :6]) / scale for r in rows]
    return sum(np.einsum("nci,ncj->ij", x, x, optimize=True) for x in columns) / sum(len(x) for x in columns)


def world_of(
    known: FittedSet, question: Question | None = None, hypothesis: Hypothesis | None = None
) -> CompetingModel:
    """The model of a hypothesis of a question, to fly; the model as fitted where none is given, or none with terms."""
    model, regression = known.model, known.regression
    effects = chosen(model)
    if hypothesis is not None and hypothesis.keys:
        keys = (*question.shared, *hypothesis.keys)
        fit, effects = regression.fit(keys), []
        for term in (t for k in keys if (t := model.search.terms.get(k)) is not None and t.kind == "effect"):
            values = np.array(term.values, float)
            if term.form.linear:
                values[list(term.form.linear)] = fit.beta[fit.places(regression.columns([term.key]))]
            effects.append((term.form, values))
    unnamed = {t.form.name for t in regression.terms if t.kind == "effect" and t.effect in UNKNOWNS}
    effects = tuple(e for e in effects if e[0].name not in unnamed)
    limits, segments = known.prepared.vehicle.rotor_speed_limits_rad_s, known.prepared.segments
    commanded = (float(s.command.max()) for s in segments if s.command is not None)
    chain, full, volt, scale = (), limits[1] if limits else max(commanded, default=1.0), None, 1.0
    if known.fitted.chain is not None:
        result, full, volt, scale = known.fitted.chain
        chain = tuple((form, result.fit.of(key)[1]) for key, form in result.fit.chain)
    voltages = [s.motion.voltage.mean() for s in segments if s.motion.voltage is not None]
    return CompetingModel(
        vehicle=known.prepared.vehicle,
        effects=effects,
        derivatives=known.derivatives,
        chain=chain,
        full_speed_rad_s=full,
        scale=scale,
        voltage_v=float(np.mean(voltages)) if voltages else None,
        full_voltage_v=volt,
        wind_m_s=None if model.wind is None else np.array([*model.wind, 0.0]),
    )


def step_of(known: FittedSet) -> float:
    """Step of the simulation, s: the recording's own, or a whole part of it."""
    rate = _own_rate_hz(known)
    return 1.0 / (rate * int(np.ceil(_LEAST_RATE_HZ / rate)))


@step("flying a manoeuvre in simulation")
def flown(world: CompetingModel, reference: Reference, limits: Limits) -> tuple[SimulatedFlight, ...]:
    """A reference flown by a competing model, with the loops as stated and slower (SLOWER_LOOPS)."""
    # Shares of the stated bandwidths that flights are simulated with: what is asked of quick motions only a loop as
    # fast as stated flies.
    slower_loops = (1.0, 0.7)
    fast, slow = limits.attitude_bandwidth_rad_s, limits.position_bandwidth_rad_s
    return tuple(fly(world, reference, s * fast, limits.middle_m, slow and s * slow) for s in slower_loops)


def of_flights(
    known: FittedSet,
    flights: Sequence[SimulatedFlight],
    world: CompetingModel,
    terms: Sequence[Term],
    change: ChangedVehicle | None = None,
) -> Information:
    """What the fitted part of a flight would hold, flown with each of the loops.

    After a `change` of the vehicle by hand all of the flight is compared with the set.
    """
    found = [_of_flight(known, flight, world, terms, change) for flight in flights]
    grams, squares = np.stack([i.gram for i in found]), np.stack([i.squares for i in found])
    whole = Information(grams, squares, found[0].seconds, found[0].shares)
    return whole.share(FITTED_SHARE) if change is None else whole


def _of_flight(
    known: FittedSet,
    flight: SimulatedFlight,
    world: CompetingModel,
    terms: Sequence[Term],
    change: ChangedVehicle | None = None,
) -> Information:
    """What a flight would hold, in the columns of the set's regression.

    After a `change` by hand the columns are those of the changed vehicle in the parameters of the set, less what the
    nuisances of the change take over.
    """
    model, prepared = known.model, known.prepared
    acting, effects = list(terms), model.effects if model.effects is not None else chosen(model)
    if change is not None:
        prepared = replace(prepared, vehicle=change.vehicle)
        acting, effects = [*change.nuisances, *(change.term(t) for t in terms)], list(world.effects)
    apart = []
    for models in known.chains:
        for true, rival in permutations(models, 2):
            asked = commands(replace(world, chain=true.steps), flight.motion)
            made = _stretches_of(known, prepared, replace(flight, command_rad_s=asked), world)
            apart.append(chain_squares(known.fitted, made, true, rival))
    segments = _stretches_of(known, prepared, flight, world)
    if known.fitted.commanded:
        segments = path_segments(segments, known.fitted.chain, prepared.thinner.cutoff_hz)
    rows = assemble_rows(prepared, acting, segments, effects)
    own = known.regression.again(rows, acting)
    seconds = float(flight.motion.time_s[-1] - flight.motion.time_s[0])
    gram = own.gram.sum(axis=0) if change is None else _after_change(own, terms, change)
    shares = seconds * _shares_of(rows, prepared.vehicle) if change is None else 0.0
    return Information(placed(known, terms, gram), np.array(apart), seconds, placed(known, terms, shares))


def _stretches_of(
    known: FittedSet, prepared: Prepared, flight: SimulatedFlight, world: CompetingModel, name: str = "planned"
) -> list[Segment]:
    """Stretches of a flight as the set's sensors would record it."""
    runs = known.recordings.runs
    columns = tuple(n for n in runs[0].table.columns if all(r.has(n) for r in runs))
    run = recorded(flight, world, columns, _own_rate_hz(known), name)
    return prepare_like(prepared, RecordingSet("planned", prepared.vehicle, (run,), ()))[0]


def _after_change(own: Regression, terms: Sequence[Term], change: ChangedVehicle) -> np.ndarray:
    """Normal equations (K, K) of terms in the parameters of before a change, its nuisances projected out."""
    share = np.concatenate([np.full(t.size, change.shares.get(t.key, 1.0)) for t in terms])
    kept, out = own.columns([t.key for t in terms]), own.columns([t.key for t in change.nuisances])
    total = own.gram.sum(axis=0)
    gram = total[np.ix_(kept, kept)]
    if len(out):
        precision = np.concatenate([1.0 / np.square(t.prior_sd) for t in change.nuisances])
        pull = total[np.ix_(out, kept)]
        gram = gram - pull.T @ np.linalg.solve(total[np.ix_(out, out)] + np.diag(precision), pull)
    return share[:, None] * gram * share


def expecting(known: FittedSet, flights: Sequence[tuple[SimulatedFlight, CompetingModel]]) -> FittedSet:
    """The set with its normal equations as the engine would have them once flights are joined to it.

    The engine learns its filters from what the whole catalogue leaves; of a calm set that is next to nothing in a
    channel where the noise of the regressors explains the noise of the reading, and such filters would promise too
    much of a quick flight, in which it cannot. What the model leaves of the set is what it will leave of the flight,
    but no less than the share of the flight's own forces and moments below which the engine distinguishes nothing.
    """
    model, prepared = known.model, known.prepared
    regression, segments = model.search.regression, list(model.segments)
    for number, (flight, world) in enumerate(flights):
        segments += _stretches_of(known, prepared, flight, world, f"planned {number}")
    floor, remains = channel_floor(segments, prepared.vehicle), after_residual(model)
    # What is steady in a run is no noise: a filter that takes it out would see nothing slow.
    filters = {c: autoregression([r[:, c] - r[:, c].mean() for r in remains], floor[c]) for c in regression.filters}
    noisy = model.contributions.noisy
    again = whitened(prepared, model.rows, model.terms, filters, model.segments, noisy).without_winds()
    again.limit = regression.limit
    return replace(known, whitened=again)


def _own_rate_hz(known: FittedSet) -> float:
    """Rate of the recordings."""
    return 1.0 / float(np.median(np.diff(known.recordings.runs[0].time_s)))


def squares_left(
    regression: Regression, gram: np.ndarray, own: Sequence[str], others: Sequence[str], theta: np.ndarray
) -> np.ndarray:
    """λ (D,): whitened squares that remain of terms with coefficients `theta` (D, k) once others take what they can.

    `gram` (K, K) are the normal equations. The others are fitted as the engine fits them: each with its prior, and no
    believed value further off than its limit (`Regression.limit`). The squares are those of the rows alone, as those
    that `Regression.explained` compares: what a prior asks of the others is no misfit.
    """
    a, b = regression.columns(own), regression.columns([k for k in others if k not in own])
    normal = gram[np.ix_(b, b)] + np.diag(regression.precision[b])
    pull = theta @ gram[np.ix_(a, b)]
    limit = regression.limit[b]
    taken = within(normal, pull, limit)
    left = np.einsum("dk,kl,dl->d", theta, gram[np.ix_(a, a)], theta)
    left += np.einsum("dk,kl,dl->d", taken, gram[np.ix_(b, b)], taken) - 2 * np.einsum("dk,dk->d", taken, pull)
    return np.maximum(left, 0.0)


def within(normal: np.ndarray, right: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Solutions (D, n) of normal equations (n, n) for many right sides (D, n), each coefficient within `limit` (n,).

    As the engine's own fit (`rotorid.mismatch.evidence.regression.bounded`): what is furthest out is held at its limit,
    until nothing is out.
    """
    free = ridge_inverse(normal)
    solution = right @ free
    held = np.zeros(right.shape, bool)
    for _ in range(int(np.isfinite(limit).sum())):
        out = np.where(held, 0.0, np.abs(solution) / limit)
        worst = out.argmax(axis=1) if out.shape[1] else np.zeros(0, int)
        beyond = np.flatnonzero(out[np.arange(len(out)), worst] > 1.0) if out.shape[1] else worst
        if not len(beyond):
            break
        worst = worst[beyond]
        held[beyond, worst] = True
        solution[beyond, worst] = np.sign(solution[beyond, worst]) * limit[worst]
        # The same coefficients are held in many of them: solved together.
        patterns, which = np.unique(held[beyond], axis=0, return_inverse=True)
        for number, pattern in enumerate(patterns):
            at, rest = beyond[which.ravel() == number], np.flatnonzero(~pattern)
            known = np.where(pattern, solution[at], 0.0)
            moved = (right[at] - known @ normal)[:, rest] @ ridge_inverse(normal[np.ix_(rest, rest)])
            solution[at[:, None], rest] = moved
    return solution


def _apart(known: FittedSet, question: Question, true: Hypothesis, gram: np.ndarray) -> dict[str, np.ndarray]:
    """√λ (n,) of a true model against every rival, the best of its forms in each draw of the coefficients.

    Which form of the true model it is the set may not know either: each has draws by its probability.
    """
    regression, forms = known.regression, (true, *true.others)
    keys_of_true = tuple(dict.fromkeys(k for h in forms for k in h.keys))
    columns, whole = regression.columns(keys_of_true), sum(h.weight for h in forms)
    places, parts = {c: i for i, c in enumerate(columns)}, []
    for form in forms:
        own = regression.columns(form.keys)
        draws = drawn(form, gram[np.ix_(own, own)], max(1, round(_DRAWS * form.weight / whole)))
        parts.append(np.zeros((len(draws), len(columns))))
        parts[-1][:, [places[c] for c in own]] = draws
    theta = np.concatenate(parts)
    out = {}
    for rival in question.ids:
        squares = []
        for keys in question.rivals[rival] if rival != true.id else ():
            # Where the rival shares a term with the true model, only what is the true model's own counts.
            if own := [k for k in keys_of_true if k not in keys]:
                counting = theta[:, np.isin(columns, regression.columns(own))]
                squares.append(squares_left(regression, gram, own, [*question.shared, *keys], counting))
        if squares:
            out[rival] = np.sqrt(np.min(squares, axis=0))
    return out


def drawn(true: Hypothesis, gram: np.ndarray, count: int = _DRAWS) -> np.ndarray:
    """Draws of a model's coefficients, `count` of DRAWS, (count, k).

    What the set does not know of them is not as large as its doubt: the columns of one model are taken to contribute
    alike, so the coefficients, in units of their columns' length in the normal equations `gram` (k, k), are normal
    about zero with one size, the most probable for what the set found.
    """
    unit = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    found, doubt = true.beta / unit, true.covariance / np.outer(unit, unit)
    values, vectors = np.linalg.eigh(doubt)
    values, along = np.maximum(values, 1e-12 * max(values.max(), 1e-300)), vectors.T @ found
    variances = np.square(_SIZES * max(float(np.abs(found).max()), 1e-300))
    fits = [-(np.log(values + v) + along**2 / (values + v)).sum() for v in variances]
    variance = variances[int(np.argmax(fits))]
    kept = variance / (values + variance)
    normal = np.random.default_rng(0).standard_normal((_DRAWS, len(unit)))[:count]
    return (kept * along + normal * np.sqrt(kept * values)) @ vectors.T * unit


def log_odds(sigma: np.ndarray, seconds: float) -> float:
    """Expected log odds, nats, of separations √λ (n,) of a true model from its rival in so many seconds.

    λ/2 for a form that is right. An effect's contribution may be wrong by a share of it (`Prior.form_error`), anew in
    every environment: of N of them that adds f² λ/N to the variance of what separates the two, 1 from the noise.
    """
    environments = max(seconds / ENVIRONMENT_S, 1.0)
    return float(np.mean(sigma**2 / (1.0 + Prior().form_error ** 2 * sigma**2 / environments)) / 2)


def separations(known: FittedSet, question: Question, before: Information, after: Information) -> list[Separation]:
    """Every model of a question against its nearest rival.

    Which rival is nearest hangs on the model's coefficients, of which the set knows no more than their interval: the
    separation is the median over draws from it of the smallest over all rivals.
    """
    every = (separation_of(known, question, true, before, after) for true in question.hypotheses)
    return [s for s in every if s is not None]


def separation_of(
    known: FittedSet, question: Question, true: Hypothesis, before: Information, after: Information
) -> Separation | None:
    """One model of a question against its nearest rival, as `separations`; None where there is nothing to compare."""
    found = [_apart(known, question, true, gram) for gram in after.each] if true.keys else []
    if not any(found):
        return None
    nearest = [np.min(list(f.values()), axis=0) for f in found]
    worst = int(np.argmin([np.median(n) for n in nearest]))
    rival = min(found[worst], key=lambda r: float(np.median(found[worst][r])))
    so_far = _apart(known, question, true, before.each[0])[rival]
    every = np.concatenate(nearest)
    noise = np.random.default_rng(1).standard_normal(len(every))
    low, high = np.quantile(np.maximum(every + noise, 0.0), [0.025, 0.975])
    return Separation(
        true.id,
        rival,
        float(np.median(nearest[worst])),
        (float(low), float(high)),
        float(np.median(so_far)),
        log_odds(nearest[worst], after.seconds),
    )


def chain_separations(
    known: FittedSet, information: Information
) -> list[tuple[tuple[str, ...], tuple[Separation, ...]]]:
    """Every chain of every question between command and speed against its nearest rival."""
    out, at = [], 0
    for models in known.chains:
        found: dict[str, Separation] = {}
        for true, rival in permutations(models, 2):
            every = np.sqrt(information.squares[..., at].ravel()) if np.ndim(information.squares) else np.zeros(1)
            at += 1
            sigma, most = float(every.min()), float(every.max())
            if true.id not in found or sigma < found[true.id].sigma:
                ends = (chain_interval(sigma, true.doubt)[0], chain_interval(most, true.doubt)[1])
                found[true.id] = Separation(
                    true.id, rival.id, sigma, ends, 0.0, log_odds(np.array([sigma]), information.seconds)
                )
        out.append((tuple(m.id for m in models), tuple(found.values())))
    return out


Questions = tuple[tuple[tuple[str, ...], tuple[Separation, ...]], ...]
"""Ids of each open question, and how far apart their models will be."""
