"""How far apart two competing models are on recordings not made yet, by the comparison that the engine decides with.

The engine compares models by what they leave in whitened squares (`rotorid.mismatch.comparison`). If model h is true
with coefficients θ, the best that its rival can do leaves λ = θᵀ S θ more of them, where S is what is left of the
normal equations of h's columns once everything that the rival and all believed values (within their trust) could take
over is projected out. The loss difference that the engine will then find is about λ with a standard deviation of 2 √λ:
in standard errors of the data the models are √λ apart, give or take one. The normal equations are those of the set as
recorded plus those of the simulated flight, through the same filters (the instruments' noise and what the model left).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch.motion import Segment
from rotorid.mismatch.prepare import assemble_rows, prepare_like, training_rule
from rotorid.mismatch.regression import Regression, autoregression, build, ridge_inverse
from rotorid.mismatch.rows import Term
from rotorid.mismatch.wrench import after_residual, block_seconds, channel_floor, chosen, path_segments
from rotorid.plan.between import interval as chain_interval
from rotorid.plan.between import squares
from rotorid.plan.candidates import Reference
from rotorid.plan.limits import Limits
from rotorid.plan.questions import Hypothesis, Known, Question
from rotorid.plan.simulate import Flown, World, commands, fly, recorded
from rotorid.recordings import RecordingSet

DRAWS = 400
LEAST_RATE_HZ = 400.0
"""Flights are simulated at least this finely."""


@dataclass(frozen=True)
class Information:
    """What some recordings hold about the open questions."""

    gram: np.ndarray
    """Normal equations (K, K) of the set's terms, in the columns of the set's regression."""
    squares: np.ndarray | None = None
    """λ of every pair of competing chains; None for nothing."""

    def __add__(self, other: Information) -> Information:
        known = [i.squares for i in (self, other) if i.squares is not None]
        return Information(self.gram + other.gram, np.sum(known, axis=0) if known else None)


@dataclass(frozen=True)
class Separation:
    """How far apart a model is from its nearest rival if it is the true one."""

    true: str
    rival: str
    sigma: float
    interval_95: tuple[float, float]
    """Of the separation that will be found: the model's own doubt about its size, and the noise of the flight."""
    so_far: float
    """What the set at hand separates them by."""


def asked_terms(known: Known) -> list[Term]:
    """Terms that any open question needs, in the order of the regression."""
    wanted = set()
    for question in known.questions:
        wanted |= set(question.shared)
        wanted |= {k for choices in question.rivals.values() for keys in choices for k in keys}
        wanted |= {k for h in question.hypotheses for k in h.keys}
    wanted |= set(known.fitted.model.search.always) | set(known.fitted.model.selection.active)
    return [t for t in known.regression.terms if t.key in wanted]


def of_set(known: Known) -> Information:
    """What the fitted runs of the set hold."""
    regression = known.regression
    gram, _, bias, _ = regression._normal(np.arange(len(regression.precision)), regression.training)
    return Information(gram - bias)


def world_of(known: Known, question: Question | None, hypothesis: Hypothesis | None) -> World:
    """The model of a hypothesis, to fly; the model as fitted where none is given."""
    model, regression = known.fitted.model, known.regression
    if question is None or hypothesis is None:
        effects = chosen(model)
    else:
        keys = [k for k in (*question.shared, *hypothesis.keys) if model.search.terms.get(k) is not None]
        keys = [k for k in keys if model.search.terms[k].kind == "effect"]
        fit = regression.fit([*question.shared, *hypothesis.keys])
        effects = []
        for key in keys:
            term = model.search.terms[key]
            values = np.array(term.values, float)
            if term.form.linear:
                values[list(term.form.linear)] = fit.beta[fit.places(regression.columns([key]))]
            effects.append((term.form, values))
    from rotorid.mismatch.unknowns import UNKNOWNS

    unnamed = {t.form.name for t in regression.terms if t.kind == "effect" and t.effect in UNKNOWNS}
    effects = tuple(e for e in effects if e[0].name not in unnamed)
    chain, full, volt = (), full_speed_of(known), None
    if known.fitted.chain is not None:
        result, full, volt = known.fitted.chain
        chain = tuple((form, result.fit.of(key)[1]) for key, form in result.fit.chain)
    voltages = [s.motion.voltage.mean() for s in known.prepared.segments if s.motion.voltage is not None]
    return World(
        known.prepared.vehicle,
        effects,
        chain,
        full,
        float(np.mean(voltages)) if voltages else None,
        volt,
        None if model.wind is None else np.array([*model.wind, 0.0]),
    )


def full_speed_of(known: Known) -> float:
    """Rotor speed, rad/s, of full throttle."""
    limits = known.prepared.vehicle.rotor_speed_limits_rad_s
    commands = [float(s.command.max()) for s in known.prepared.segments if s.command is not None]
    return limits[1] if limits else max(commands, default=1.0)


def step_of(known: Known) -> float:
    """Step of the simulation, s: the recording's own, or a whole part of it."""
    rate = own_rate_hz(known)
    return 1.0 / (rate * int(np.ceil(LEAST_RATE_HZ / rate)))


def columns_of(known: Known) -> tuple[str, ...]:
    """Columns that every run of the set has."""
    runs = known.recordings.runs
    return tuple(n for n in runs[0].table.columns if all(r.has(n) for r in runs))


def flown(known: Known, world: World, reference: Reference, limits: Limits) -> Flown:
    """A reference flown by a competing model."""
    return fly(world, reference, limits.attitude_bandwidth_rad_s, limits.middle_m, limits.position_bandwidth_rad_s)


def of_flight(known: Known, flight: Flown, world: World, terms: Sequence[Term]) -> Information:
    """What a flight would hold, in the columns of the set's regression."""
    rate = own_rate_hz(known)
    model, prepared = known.fitted.model, known.prepared

    def segments_of(flight: Flown) -> list[Segment]:
        run = recorded(flight, world, columns_of(known), rate, "planned")
        return prepare_like(prepared, RecordingSet("planned", prepared.vehicle, (run,), ()))[0]

    segments = segments_of(flight)
    apart = []
    for question in known.chains:
        for true, rival in question.pairs:
            at, chain = 0, []
            for _, form in true.chain:
                chain.append((form, true.values[at : at + len(form.parameters)]))
                at += len(form.parameters)
            asked = commands(replace(world, chain=tuple(chain)), flight.motion)
            apart.append(squares(known.fitted, segments_of(replace(flight, command_rad_s=asked)), true, rival))
    if known.fitted.commanded:
        segments = path_segments(segments, *known.fitted.chain, prepared.thinner.cutoff_hz)
    effects = model.effects if model.effects is not None else chosen(model)
    rows = assemble_rows(prepared, list(terms), segments, effects)
    rate_hz = prepared.thinner.rate_hz
    own = build(rows, list(terms), known.regression.filters, lambda run, t: True, block_seconds(rows, rate_hz), rate_hz)
    every = known.regression.columns([t.key for t in terms])
    gram = np.zeros_like(known.regression.gram[0])
    gram[np.ix_(every, every)] = own.gram.sum(axis=0)
    return Information(gram, np.array(apart) if apart else None)


def expecting(known: Known, flights: Sequence[tuple[Flown, World]]) -> Known:
    """The set with its normal equations as the engine would have them once flights are joined to it.

    The engine learns its filters from what the whole catalogue leaves; of a calm set that is next to nothing in a
    channel where the noise of the regressors explains the noise of the reading, and such filters would promise too
    much of a quick flight, in which it cannot. What the model leaves of the set is what it will leave of the flight,
    but no less than the share of the flight's own forces and moments below which the engine distinguishes nothing.
    """
    model, prepared = known.fitted.model, known.prepared
    rate, regression = own_rate_hz(known), model.search.regression
    segments = list(model.segments)
    for number, (flight, world) in enumerate(flights):
        run = recorded(flight, world, columns_of(known), rate, f"planned {number}")
        segments += prepare_like(prepared, RecordingSet("planned", prepared.vehicle, (run,), ()))[0]
    floor, remains = channel_floor(segments, prepared.vehicle), after_residual(model)
    filters = {c: autoregression([r[:, c] for r in remains], floor[c]) for c in regression.filters}
    rule, rate_hz = training_rule(prepared.split, model.segments), prepared.thinner.rate_hz
    again = build(
        model.rows, model.terms, filters, rule, block_seconds(model.rows, rate_hz), rate_hz, model.contributions.noisy
    )
    return replace(known, whitened=again.without_winds())


def own_rate_hz(known: Known) -> float:
    """Rate of the recordings."""
    return 1.0 / float(np.median(np.diff(known.recordings.runs[0].time_s)))


def left_over(
    regression: Regression, information: Information, own: Sequence[str], others: Sequence[str]
) -> np.ndarray:
    """What is left of the normal equations of terms (k, k) once others could take over what they can."""
    a, b = regression.columns(own), regression.columns([k for k in others if k not in own])
    gram, prior = information.gram, np.diag(regression.precision[b])
    inner = ridge_inverse(gram[np.ix_(b, b)] + prior)
    pull = gram[np.ix_(b, a)]
    left = gram[np.ix_(a, a)] - pull.T @ inner @ pull
    return (left + left.T) / 2


def rivals_left(known: Known, question: Question, true: Hypothesis, rival: str, information: Information):
    """S of every form of a rival, and which of the true model's coefficients it is of."""
    out = []
    for keys in question.rivals[rival]:
        own = [k for k in true.keys if k not in keys]
        if own:
            # Where the rival shares a term with the true model, only what is the true model's own counts.
            at = np.flatnonzero(np.isin(known.regression.columns(true.keys), known.regression.columns(own)))
            out.append((left_over(known.regression, information, own, [*question.shared, *keys]), at))
    return out


def against(known: Known, question: Question, true: Hypothesis, rival: str, information: Information):
    """λ of a true model against the best form of a rival, S of that form, and of which coefficients it is."""
    forms = rivals_left(known, question, true, rival, information)
    if not forms:
        return None
    left, at = min(forms, key=lambda f: size_of(true.beta, *f))
    return size_of(true.beta, left, at), left, at


def separations(known: Known, question: Question, before: Information, after: Information) -> list[Separation]:
    """Every model of a question against its nearest rival.

    Which rival is nearest hangs on the model's coefficients, of which the set knows no more than their interval: the
    separation is the median over draws from it of the smallest over all rivals.
    """
    out = []
    for true in question.hypotheses:
        if not true.keys:
            continue
        found = []
        for rival in question.ids:
            if rival == true.id:
                continue
            forms = rivals_left(known, question, true, rival, after)
            if forms:
                found.append((min(size_of(true.beta, *f) for f in forms), rival, forms))
        if not found:
            continue
        _, rival, _ = min(found, key=lambda f: f[0])
        sigma, interval_95 = spread(true, [f for _, _, forms in found for f in forms])
        so_far, _ = spread(true, rivals_left(known, question, true, rival, before))
        out.append(Separation(true.id, rival, sigma, interval_95, so_far))
    return out


def size_of(beta: np.ndarray, left: np.ndarray, at: np.ndarray) -> float:
    """λ of coefficients (k,)."""
    return float(max(beta[at] @ left @ beta[at], 0.0))


def spread(true: Hypothesis, forms: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[float, tuple[float, float]]:
    """Median and 95 % interval of the separation that will be found, over the model's own doubt and the flight's noise.

    `forms` hold S of every form of every rival, and which of the model's coefficients it is of.
    """
    rng = np.random.default_rng(0)
    unit = np.sqrt(np.maximum(np.diag(true.covariance), 1e-300))
    values, vectors = np.linalg.eigh(true.covariance / np.outer(unit, unit))
    draws = (rng.standard_normal((DRAWS, len(unit))) * np.sqrt(np.maximum(values, 0))) @ vectors.T * unit + true.beta
    squares = [np.einsum("dk,kl,dl->d", draws[:, at], left, draws[:, at]) for left, at in forms]
    size = np.sqrt(np.maximum(np.min(squares, axis=0), 0.0))
    low, high = np.quantile(np.maximum(size + rng.standard_normal(DRAWS), 0.0), [0.025, 0.975])
    return float(np.median(size)), (float(low), float(high))


def left_overs(known: Known, question: Question, information: Information) -> list[float]:
    """√λ of every model of a question against every rival."""
    found = [
        against(known, question, true, rival, information)
        for true in question.hypotheses
        for rival in question.ids
        if true.keys and rival != true.id
    ]
    return [float(np.sqrt(best[0])) for best in found if best is not None]


def chain_separations(known: Known, information: Information) -> list[tuple[tuple[str, ...], tuple[Separation, ...]]]:
    """Every chain of every question between command and speed against its nearest rival."""
    out, at = [], 0
    for question in known.chains:
        found: dict[str, Separation] = {}
        for true, rival in question.pairs:
            sigma = 0.0 if information.squares is None else float(np.sqrt(information.squares[at]))
            at += 1
            if true.id not in found or sigma < found[true.id].sigma:
                found[true.id] = Separation(true.id, rival.id, sigma, chain_interval(sigma, true.doubt), 0.0)
        out.append((question.ids, tuple(found.values())))
    return out


Questions = tuple[tuple[tuple[str, ...], tuple[Separation, ...]], ...]
"""Ids of each open question, and how far apart their models will be."""


def smallest_separation(questions: Questions) -> float | None:
    """Smallest separation expected over all questions; None where nothing is compared."""
    return min((s.sigma for _, found in questions for s in found), default=None)
