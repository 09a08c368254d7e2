"""Two sets of a stand or of a bench on the same columns, ready to be weighed against each other as two flights are.

Model, noise, whitening and the chain from command to rotor speed are the first set's. A stand is not quite the same on
two days even where nothing changed: the zero is only as good as the few samples it was taken from, it wanders within a
run, and a load is put on a little otherwise each time. How much is learnt from the runs of the first set, one by one,
and is no change (`Wander`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.loading import AXES, CHANNELS, Loading
from rotorid.errors import InputError
from rotorid.mismatch.changes.joint import Joint, by_run, coefficients_on
from rotorid.mismatch.changes.problem import PRIOR, change_of, joined, pair_of
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.posterior import Found, Model, Posterior
from rotorid.mismatch.evidence.gram import TINY, Evidence, evidence_from
from rotorid.mismatch.evidence.regression import Regression, ridge_inverse
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.flight.absent import mean_squares
from rotorid.mismatch.instrument.analyse import first_model
from rotorid.mismatch.instrument.chain import ChainResult, unseen_loadings
from rotorid.mismatch.instrument.mistakes import find_mistakes
from rotorid.mismatch.instrument.model import (
    ReadingModel,
    ReadingSearch,
    make_terms,
    refined,
    rows_of,
    whole_reading,
)
from rotorid.mismatch.instrument.sampling import quantisation
from rotorid.mismatch.instrument.setup import (
    PreparedInstrument,
    compared_channels,
    loaded_by,
    pieces_of,
    session_of,
    set_up,
)
from rotorid.recordings import RecordingSet, Vehicle

_WANDERS = {"zero": ("constant", "b_{own}"), "drift": ("linear in time", "b_{own}")}
"""To what differs from run to run (`Effect.differs_between_runs`) how the names of its forms begin, and its symbol."""
_OF_OTHER_AXES = "of other axes", ("", "C_{own},{load}")
"""The same of a load on another axis."""
_FORM_SD_OF_READING = 0.1
"""Share of what the first set's effects add to a reading that their forms are wrong by: loops and creep hang on what
was loaded before. Also the share of what effects that take time do together up to which the others may be the form of
one of them."""


@dataclass(frozen=True)
class Wander:
    """By how much readings differ from run to run where nothing changed."""

    columns: tuple[tuple[list[int], ...], ...]
    """In each channel of a constant, of the time within the run, of the channel's own load and of each other load: the
    columns that are this in that channel."""
    variance: tuple[np.ndarray, ...]
    """In each channel (k,) their coefficients' variances, in their units."""


@dataclass(frozen=True)
class _OnColumns:
    """A set on some columns."""

    rows: tuple[Rows, ...]
    regression: Regression
    evidence: Evidence
    by_run: tuple[Evidence, ...]
    """The same run by run."""


@dataclass(frozen=True)
class InstrumentReference:
    """The first set, fitted once: what other sets are compared with."""

    recordings: RecordingSet
    model: ReadingModel
    chain: ChainResult | None
    """What lies between command and rotor speed, where speeds are not measured."""
    terms: tuple[Term, ...]
    own: _OnColumns
    known: np.ndarray
    """(K,) coefficients of its model on the columns of the terms, 0 of what is not at work."""
    wander: Wander
    mistakes: tuple[Finding, ...]
    """Mistakes in its recordings, corrected."""

    @property
    def rows(self) -> tuple[Rows, ...]:
        """Rows of all stretches."""
        return self.own.rows


def instrument_reference_of(base: RecordingSet) -> InstrumentReference:
    """The first set of a stand or bench as a verdict fits it, all of its runs."""
    base, mistakes, _ = find_mistakes(replace(base, held_out=()))
    setup = set_up(base)
    model, chain, loadings = first_model(setup, make_terms(setup)[0])
    terms = _compared_terms(model.terms, setup)
    own = _on_columns(model, terms, model.loadings)
    known = coefficients_on(terms, model, model.regression.start)
    return InstrumentReference(
        recordings=base,
        model=model,
        chain=None if loadings is None else chain,
        terms=tuple(terms),
        own=own,
        known=known,
        wander=_wander_of(terms, own, known, model),
        mistakes=(*mistakes, *_steps_of(setup, model)),
    )


def joint_of_instruments(reference: InstrumentReference, new: RecordingSet) -> Joint:
    """Two sets of one stand or bench on the same columns.

    Raises
    ------
    InputError
        They have not the same channels, columns or rate.
    """
    # Runs that each set must have for its runs to be the environments in which a coefficient must be the same.
    fewest_runs = 3
    _must_compare(reference.recordings, new)
    new, mistakes, _ = find_mistakes(replace(new, held_out=()))
    model = reference.model
    setup = replace(model.setup, recordings=new, loadings=_loadings_of(reference, new))
    if not any(pieces_of(x, setup.average) for x in setup.loadings):
        raise InputError(f"set {new.name}: no stretch is long enough to be compared with {reference.recordings.name}")
    terms, base = list(reference.terms), reference.own
    second = _on_columns(model, terms, setup.loadings, new.vehicle)
    if more_terms := _refined_on(second, setup, reference):
        terms += more_terms
        base = _on_columns(model, terms, model.loadings)
        second = _on_columns(model, terms, setup.loadings, new.vehicle)
    count, more = (len(base.by_run), len(second.by_run)), _mounted_anew(terms, setup)
    both: Sequence[Sequence[Evidence]] = (base.by_run, second.by_run)
    if min(count) >= fewest_runs:
        both = [[wandering(_as_one_environment(run), reference.wander) for run in own] for own in both]
    else:
        more = np.hypot(more, _between_sets(reference.wander, len(more), sum(1.0 / n for n in count)))
    channels, compared = setup.instrument.channels, [t for t in terms if t.kind in ("effect", "value")]
    return Joint(
        base=joined(both[0]),
        new=joined(both[1]),
        known=np.concatenate([reference.known, np.zeros(sum(t.size for t in terms) - len(reference.known))]),
        inertia=np.ones(len(channels)),
        flown_by_base=_how_large(model.loadings, channels),
        flown_by_new=_how_large(setup.loadings, channels),
        recordings=new,
        recorded=(),
        rows_of_new=second.rows,
        mistakes_of_new=(*mistakes, *_steps_of(setup, model)),
        squares=mean_squares(second.rows, second.regression, compared, _scales(setup.instrument.largest)),
        more_usual=more,
        form_sd=_FORM_SD_OF_READING,
        decide=partial(_decide_instrument_changes, sizes=second.evidence.gram.sum(axis=1)),
    )


def _on_columns(
    model: ReadingModel, terms: Sequence[Term], loadings: Sequence[Loading], vehicle: Vehicle | None = None
) -> _OnColumns:
    """What stretches hold on the columns of `terms`, whitened as the model's, with its products by channel.

    What is at work in the model is moved by its clock. The rows of another set have what its own `vehicle` leaves of
    every channel; the columns stay the first's.
    """
    setup = model.setup
    rows = rows_of(setup, list(terms), loadings, whole_reading(model.terms, model.selection.active))
    if vehicle not in (None, setup.vehicle):
        own = rows_of(setup, [], [loaded_by(x, vehicle) for x in loadings])
        rows = [replace(r, y=o.y) for r, o in zip(rows, own, strict=True)]
    regression = model.regression.again(rows, terms)
    evidence = evidence_from(regression)
    return _OnColumns(tuple(rows), regression, evidence, by_run(evidence, regression))


def _refined_on(second: _OnColumns, setup: PreparedInstrument, reference: InstrumentReference) -> list[Term]:
    """The forms that say most of a change by one id alone, with nonlinear parameters as the second set has them.

    A filter or a resonance at the first set's values, or at those a search starts from, would leave much of itself,
    and several others would be needed to make up for it. `setup` holds the second set's stretches.
    """
    most_refined = 4  # Ids whose nonlinear parameters are refined on the second set, the most promising first.
    model, terms = reference.model, {t.key: t for t in reference.terms}
    # All that no change explains is white noise here.
    pair = pair_of(reference.own.evidence, second.evidence, np.zeros(len(reference.known)))
    problem = pair.problem(np.zeros(len(pair.new.channels)))
    posterior, best = Posterior(problem), {}
    for key, effect in problem.effects.items():
        if key in terms and terms[key].form is not None and terms[key].form.nonlinear:
            gain = posterior((key,)) - posterior(())
            if gain > best.get(effect, ("", 0.0))[1]:
                best[effect] = key, gain
    chosen = sorted(best.values(), key=lambda of: -of[1])[:most_refined]
    at_work = [k for k in model.selection.active if k in terms]
    own = replace(
        model,
        setup=setup,
        loadings=setup.loadings,
        terms=list(reference.terms),
        rows=list(second.rows),
        regression=second.regression,
        search=ReadingSearch(second.regression, model.search.ask),
    )
    out = []
    for key, _ in chosen:
        active = list(dict.fromkeys([*at_work, key]))
        found, _ = refined(replace(own, selection=replace(model.selection, active=active)))
        values = next(t.values for t in found if t.key == key)
        out.append(replace(terms[key], key=f"{key} as changed", values=values))
    return out


def _decide_instrument_changes(base: Evidence, new: Evidence, spread: np.ndarray, sizes: np.ndarray) -> Found:
    """The most probable changes between two sets on the same columns.

    As `problem.decide_changes`, but with one effect that takes time in place of several where it explains nearly as
    much, and a leftover is learnt, too, from what the most promising of these leaves: `sizes` (C, K, K) are products
    that sizes of contributions are taken from.
    """
    # One-sigmas between days in which nothing changed that a change is believed to have at least: narrower, its
    # estimate would be drawn to nothing by as much as the two differ.
    wide = 20.0
    plain = pair_of(base, new, spread, replace(PRIOR, value_reach=wide, change_reach=0.0))
    starts, white = [np.zeros(len(plain.unit)), plain.difference()], plain.at((), np.zeros(len(new.channels)))
    if of_time := [k for k, effect in white.problem.effects.items() if _takes_time(effect)]:
        best = max(of_time, key=lambda k: white.posterior((k,)))
        starts.append(change_of(Found(white.posterior, (best,), white.posterior((best,)))))
    pair = replace(plain, sizes=sizes)
    best, *others = (pair.settled(pair.leftover(d)) for d in starts)
    for found in others:
        if pair.joint(found) - pair.joint(best) > PRIOR.leftover_nats:
            best = found
    return _with_one_of_time(best)


def _with_one_of_time(found: Found) -> Found:
    """The same with one effect that takes time in place of several, where what it leaves may be its form's error.

    A filter of the fourth order is one of the second and a delay to the catalogue, at thousands of nats.
    """
    problem, posterior = found.problem, _OneOfTime(found.problem)
    of_time = [k for k in found.model if _takes_time(problem.terms[k].effect)]
    if len(of_time) < 2:
        return found
    rest = tuple(k for k in found.model if k not in of_time)
    plainer = [tuple(sorted((*rest, k))) for k, term in problem.terms.items() if _takes_time(term.effect)]
    best, none = max(plainer, key=posterior), posterior(rest)
    if posterior(best) - none < (1.0 - _FORM_SD_OF_READING) * (found.log_posterior - none):
        return found
    return Found(posterior, best, posterior(best))


class _OneOfTime(Posterior):
    """The log posterior of models with one effect that takes time at most."""

    def __call__(self, model: Model) -> float:
        """Log posterior of a model, nats; −∞ of one with several such effects."""
        of_time = [k for k in model if _takes_time(self.problem.terms[k].effect)]
        return -np.inf if len(of_time) > 1 else super().__call__(model)


def _takes_time(effect: str) -> bool:
    """Whether an effect shows in what takes time alone: a filter, a delay, a resonance, a clock, creep."""
    return effect in catalogue() and bool(catalogue()[effect].shows)


def _steps_of(setup: PreparedInstrument, model: ReadingModel) -> tuple[Finding, ...]:
    """That a set's readings are rounded to steps that are coarse next to the noise: one finding or none."""
    found, _ = quantisation(setup, model.noise)
    return () if found is None else (found,)


def _must_compare(base: RecordingSet, new: RecordingSet) -> None:
    """InputError unless both sets are of the same kind, with the same channels, rotors, columns and rate."""
    other_rate = 0.3  # Relative difference of two sampling rates from which one set's columns are not the other's.
    first, second = base.vehicle, new.vehicle
    alike = {
        "kind": (first.kind, second.kind),
        "number of rotors": (first.rotor_count, second.rotor_count),
        "tared": (first.tared, second.tared),
        "sensor_mount": (first.sensor_mount, second.sensor_mount),
    }
    for name, (own, other) in alike.items():
        if own != other:
            raise InputError(f"{new.name}/vehicle.yaml: {name} is {other}, expected {own} as in {base.name}")
    lost = sorted(_columns_of(base) - _columns_of(new))
    if lost:
        raise InputError(f"set {new.name}: {', '.join(lost)} is not in every run, expected as in {base.name}")
    if compared_channels(base) != compared_channels(new):
        raise InputError(f"set {new.name}: other forces or moments are read in every run than in {base.name}")
    step_s = [float(np.median(np.concatenate([np.diff(r.time_s) for r in own.runs]))) for own in (base, new)]
    if abs(step_s[1] / step_s[0] - 1.0) > other_rate:
        raise InputError(
            f"set {new.name}: recorded at {1 / step_s[1]:.3g} Hz, expected {1 / step_s[0]:.3g} Hz as {base.name}"
        )


def _columns_of(recordings: RecordingSet) -> set[str]:
    """Columns that every run of a set has values in."""
    return set.intersection(*({n for n in r.table.columns if r.has(n)} for r in recordings.runs))


def _compared_terms(terms: Sequence[Term], setup: PreparedInstrument) -> list[Term]:
    """The terms that both sets have: less numbers of single runs, and on a stand with the gains of the reading.

    A stand's gain is as good as its last calibration; a verdict takes it as it is, and asks of the rotors alone.
    """
    endings = tuple(f"({run})" for run in setup.instrument.runs)
    kept = [t for t in terms if t.form is None or not any(p.symbol.endswith(endings) for p in t.form.parameters)]
    there = {t.key for t in kept}
    loaded = [k for k in setup.instrument.loaded if k < 3]
    gains = ["gain", *(f"gain_{'xyz'[k]}" for k in loaded if len(loaded) > 1)]
    return [*(Term(key, "value", prior_sd=(1.0,)) for key in gains if key not in there), *kept]


def _loadings_of(reference: InstrumentReference, new: RecordingSet) -> tuple[Loading, ...]:
    """Stretches of another set, prepared and loaded as the first set's, its rotors turning by the same chain."""
    setup = replace(reference.model.setup, session=session_of(new))
    return unseen_loadings(setup, replace(new, vehicle=setup.vehicle), reference.chain)[1]


def _wander_of(terms: Sequence[Term], own: _OnColumns, known: np.ndarray, model: ReadingModel) -> Wander:
    """How readings differ from run to run of the first set, by the estimates of each run given the set's model.

    The variance between runs is the moment estimate of DerSimonian and Laird (Controlled Clinical Trials 7, 1986). A
    variance of n runs is widened by (n + 1)/(n − 1).
    """
    tare_noise = 0.5  # One-sigma of a zero over that of a row's noise, at least: it is the mean of a few samples.
    columns, variances = [], []
    for place, channel in enumerate(own.evidence.channels):
        alike = _wandering_columns(terms, own.evidence, model.setup.instrument.loaded, int(channel))
        at = np.array([of_one[0] for of_one in alike])
        every = own.evidence.gram[place].sum(axis=0)[at, at]
        found = [_estimate_of_run(run, place, at, known, every) for run in own.by_run]
        variance = between(*(np.array(part) for part in zip(*found, strict=True)))
        variance[0] = max(variance[0], (tare_noise * model.noise[channel]) ** 2)
        columns.append(tuple(alike))
        variances.append(variance)
    return Wander(tuple(columns), tuple(variances))


def _estimate_of_run(
    run: Evidence, place: int, at: np.ndarray, known: np.ndarray, every: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the columns `at` in one run and channel given those known of all, and their weights, (k,) each.

    A column that a run hardly excites next to all runs, whose squares are `every` (k,), has weight 0.
    """
    hardly = 1e-3  # Share of all runs' squares of a column below which one run says nothing of it.
    gram, cross = run.gram[place].sum(axis=0), run.cross[place].sum(axis=0)
    estimate, weight = np.zeros(len(at)), np.zeros(len(at))
    shown = np.flatnonzero(gram[at, at] > hardly * every)
    if len(shown):
        of_shown = at[shown]
        inverse = ridge_inverse(gram[np.ix_(of_shown, of_shown)])
        estimate[shown] = inverse @ (cross - gram @ known)[of_shown]
        weight[shown] = 1.0 / np.maximum(np.diag(inverse), TINY)
    return estimate, weight


def between(estimates: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Variance (k,) between n estimates (n, k) of weights (n, k), widened for their number; 0 of one alone."""
    number = (weights > 0).sum(axis=0)
    total = np.maximum(weights.sum(axis=0), TINY)
    mean = (weights * estimates).sum(axis=0) / total
    squares = (weights * (estimates - mean) ** 2).sum(axis=0)
    scale = np.maximum(total - (weights**2).sum(axis=0) / total, TINY)
    found = np.maximum(squares - (number - 1), 0.0) / scale * (number + 1) / np.maximum(number - 1, 1)
    return np.where(number > 1, found, 0.0)


def _role_of(effect: str) -> str:
    """What of a reading an id says that differs from run to run; empty for nothing, and for what is no id."""
    return catalogue()[effect].differs_between_runs if effect in catalogue() else ""


def _wandering_columns(
    terms: Sequence[Term], evidence: Evidence, loaded: Sequence[int], channel: int
) -> list[list[int]]:
    """Columns of a constant, of time, of the channel's own load and of each other load, all forms of each together."""
    own = AXES[channel]
    wanted = [(role, form, symbol.format(own=own)) for role, (form, symbol) in _WANDERS.items()]
    wanted.append(("", "", f"gain_{'xyz'[channel % 3]}"))
    role, (form, symbol) = _OF_OTHER_AXES
    wanted += [(role, form, symbol.format(own=own, load=AXES[source])) for source in loaded if source != channel]
    out = []
    for role, form, symbol in wanted:
        found = []
        for term in terms:
            if term.kind == "value" and not role and term.key in ("gain", symbol):
                found.append(evidence.start[term.key])
            elif term.kind == "effect" and role and _role_of(term.effect) == role and term.form.name.startswith(form):
                names = [term.form.parameters[i].symbol for i in term.form.linear]
                found += [evidence.start[term.key] + k for k, name in enumerate(names) if name == symbol]
        if found:
            out.append(found)
    return out


def wandering(evidence: Evidence, wander: Wander) -> Evidence:
    """Evidence in which coefficients of each environment, with the variances of `wander`, are integrated out."""
    gram, cross, square = evidence.gram.copy(), evidence.cross.copy(), evidence.square.copy()
    for place, (alike, variance) in enumerate(zip(wander.columns, wander.variance, strict=True)):
        at, prior = np.array([of_one[0] for of_one in alike]), np.diag(variance)
        for e in range(gram.shape[1]):
            pulls, read = gram[place, e][:, at].copy(), cross[place, e, at].copy()
            inverse = np.linalg.solve(np.eye(len(at)) + prior @ pulls[at], prior)
            gram[place, e] -= pulls @ inverse @ pulls.T
            cross[place, e] -= pulls @ (inverse @ read)
            square[place, e] -= read @ inverse @ read
    return replace(evidence, gram=gram, cross=cross, square=square)


def _between_sets(wander: Wander, columns: int, shares: float) -> np.ndarray:
    """One-sigma (K,) by which coefficients differ between two sets; `shares` is 1/n + 1/m of their runs."""
    out = np.zeros(columns)
    for alike, variance in zip(wander.columns, wander.variance, strict=True):
        for of_one, own in zip(alike, variance, strict=True):
            out[of_one] = np.maximum(out[of_one], np.sqrt(own * shares / len(of_one)))
    return out


def _mounted_anew(terms: Sequence[Term], setup: PreparedInstrument) -> np.ndarray:
    """One-sigma (K,) by which crosstalk differs between two days, as a load is not put on quite alike.

    The forms in which a coefficient stands have it in equal shares, so that their sum has it once.
    """
    # One-sigma of the angle by which a load, or the vehicle, stands otherwise on another day: a twentieth of a degree.
    mounted_rad = 0.001
    scale = dict(zip(AXES, _scales(setup.instrument.largest), strict=True))
    role, _ = _OF_OTHER_AXES
    symbols = [
        [t.form.parameters[i].symbol for i in t.form.linear] if _role_of(t.effect) == role else [""] * t.size
        for t in terms
    ]
    every = [symbol for own in symbols for symbol in own]
    out = np.zeros(len(every))
    for k, symbol in enumerate(every):
        if symbol:
            target, source = symbol.removeprefix("C_").split(",")
            out[k] = mounted_rad * scale[target] / scale[source] / np.sqrt(every.count(symbol))
    return np.nan_to_num(out)


def _as_one_environment(evidence: Evidence) -> Evidence:
    """Evidence of a run as that of one environment."""
    parts = {name: getattr(evidence, name).sum(axis=1, keepdims=True) for name in ("gram", "cross", "square")}
    return replace(evidence, **parts, blocks=evidence.blocks.sum(keepdims=True))


def _how_large(loadings: Sequence[Loading], channels: Sequence[int]) -> dict[str, float]:
    """95th percentile of the magnitude of the load on each channel, N and N m, by regime variable."""
    load = np.abs(np.concatenate([x.load for x in loadings]))
    return {f"load_{CHANNELS[c]}": float(np.quantile(load[:, c], 0.95)) for c in channels}


def _scales(largest: Sequence[float]) -> np.ndarray:
    """The largest force, N, and the largest moment, N m, of each channel's kind, (6,)."""
    least_moment_n_m = 1e-6  # Largest moment of the load below which none is put on.
    force, moment = max(largest[:3]), max(largest[3:])
    return np.repeat([force, moment if moment > least_moment_n_m else np.inf], 3)
