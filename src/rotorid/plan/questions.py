"""What a set leaves open, with the competing models ready to be compared: fitted once more by the engine itself.

Between command and rotor speed a chain (lag, delay, throttle curve, sag, limit) is no linear term, so its rival is
fitted: to what the set's columns would hold if the other were true, by least squares over the rival's parameters with
the shared linear terms free, in whitened squares as the engine has them. What the best rival leaves more than the true
chain is λ of `rotorid.plan.separation`. Fitted to each manoeuvre apart the rival is freer than over all of them: the
sum is a lower bound.

Later sets of the vehicle are judged together with it: values of the vehicle and effects are held equal in all sets;
each run keeps what belongs to a run (a scale of its thrust where runs differ beyond doubt, gusts, offsets in time).
Runs are named by their set, so that `2-hover` is of the second. What the first holds out stays held out; of each other
a third is held out. One of fewer than three runs is cut for that: runs held out of calm flights say nothing of what a
planned flight excites.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.errors import InputError
from rotorid.mismatch.analyse import decided, findings_outside
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.select import COST_PER_PARAMETER
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.decide.ways import ways
from rotorid.mismatch.deliver.derivatives import learn
from rotorid.mismatch.evidence.comparison import ENVIRONMENT_S
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import Regression, autoregression
from rotorid.mismatch.evidence.rows import Term, residual
from rotorid.mismatch.evidence.speedpath import starts_of, steps_of
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.flight.fitted import Fitted, fitted
from rotorid.mismatch.flight.prepare import Prepared, assemble_rows, prepare
from rotorid.mismatch.flight.wrench import WrenchModel, chosen, path_segments
from rotorid.mismatch.instrument.model import ReadingModel
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.recordings import RecordingSet
from rotorid.recordings.signal.kernels import causal
from rotorid.recordings.sufficient import sufficient
from rotorid.vehicle.derivatives import derivative_form, own_controls, quantities

_MOST_EVALUATIONS = 40
_EDGE_S = 0.5
"""Left out at both ends of a flight: a command that leads has nothing to lead from there."""
_MAY_DIFFER = ("name", "noise", "effects", "ground_z_m")
"""Keys of vehicle.yaml that say nothing of the vehicle itself."""


@dataclass(frozen=True)
class _ChainModel:
    """A chain that may be the true one, with its parameters on the set at hand."""

    id: str
    chain: tuple[tuple[str, SpeedForm], ...]
    values: np.ndarray
    doubt: float
    """Relative one-sigma of the id's own parameters."""

    @property
    def steps(self) -> tuple[tuple[SpeedForm, np.ndarray], ...]:
        """Speed forms with their values, in the order of the chain."""
        return tuple((form, own) for _, form, own in steps_of(self.chain, self.values))


def _leftover(found: Fitted, segments: Sequence[Segment]) -> Callable[[tuple, np.ndarray], np.ndarray]:
    """A function of chain and values: what these leave of segments, whitened (m,), the shared linear terms free."""
    prepared, search, path = found.prepared, found.model.search, found.chain.speeds

    if found.measured:
        raws = [s.motion.rotor_speed - path(s) for s in prepared.segments]
        by_rotor = [autoregression([r[:, j] for r in raws]) for j in range(raws[0].shape[1])]

        def white_speeds(segment: Segment, chain, values) -> np.ndarray:
            raw = segment.motion.rotor_speed - path(segment, chain, values)
            edge = max(max(len(f) for f in by_rotor), int(_EDGE_S * segment.rate_hz))
            return np.concatenate([causal(f, raw[:, j])[edge : len(raw) - edge] for j, f in enumerate(by_rotor)])

        return lambda chain, values: np.concatenate([white_speeds(s, chain, values) for s in segments])

    keys, filters = [*search.always, *found.model.selection.active], search.regression.filters
    effects = chosen(found.model)
    turned = path_segments(list(segments), found.chain, prepared.thinner.cutoff_hz)
    rows = assemble_rows(prepared, [search.terms[k] for k in keys], turned, effects)
    channels = [c for c in filters if c < 6 and np.isfinite(rows[0].y[:, c]).all()]
    edge = max(*(len(filters[c]) for c in channels), int(_EDGE_S * prepared.thinner.rate_hz))

    def white(values: np.ndarray) -> np.ndarray:
        """Channels (n, c, k) whitened and stacked, (m, k)."""
        return np.concatenate([causal(filters[c], values[:, c])[edge : len(values) - edge] for c in channels])

    columns = np.concatenate([white(r.x) for r in rows])
    precision = search.regression.precision[search.regression.columns(keys)]
    stacked = np.concatenate([columns, np.diag(np.sqrt(precision))])
    unit = np.sqrt((stacked**2).sum(axis=0)) + 1e-30
    basis = np.linalg.qr(stacked / unit)[0]

    def left(chain, values):
        parts = []
        for segment in segments:
            moved = replace(segment, motion=replace(segment.motion, rotor_speed=path(segment, chain, values)))
            own = residual(moved, prepared.vehicle)
            for form, at in effects:
                extra = form.contribution(moved.motion, prepared.vehicle, at)
                for name in ("force", "moment"):
                    if name in own and getattr(extra, name) is not None:
                        own[name] = own[name] - getattr(extra, name)
            nothing = np.zeros((moved.motion.size, 3))
            y = np.concatenate([prepared.thinner(own.get(g, nothing)) for g in ("force", "moment")], axis=1)
            parts.append(white(y[:, :, None])[:, 0])
        y = np.concatenate([*parts, np.zeros(len(unit))])
        return y - basis @ (basis.T @ y)

    return left


def _fitted_values(left, chain, starts: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Parameters of a chain that leave least, from the best of several starts, and the whitened squares left."""
    low = np.concatenate([[p.low for p in form.parameters] for _, form in chain])
    high = np.concatenate([[p.high for p in form.parameters] for _, form in chain])
    best = min(starts, key=lambda s: float((left(chain, s) ** 2).sum()))
    inside = np.clip(best, low + 1e-9, high - 1e-9)
    scale = np.maximum(np.abs(inside), 1e-3)
    done = least_squares(
        lambda v: left(chain, v), inside, bounds=(low, high), x_scale=scale, max_nfev=_MOST_EVALUATIONS
    )
    return done.x, float(2 * done.cost)


def _chain_question(found: Fitted, finding: Finding, ids: Sequence[str]) -> tuple[_ChainModel, ...]:
    """The competing chains of a class; none where fewer than two can be fitted to the set."""
    result = found.chain[0]
    own, rest = finding.id, [(k, f) for k, f in result.fit.chain if k != finding.id]
    where = result.fit.slice_of(own)
    kept = np.delete(result.fit.values, np.arange(where.start, where.stop))
    spread = np.sqrt(np.diag(result.fit.covariance)[where]) / np.maximum(np.abs(result.fit.values[where]), 1e-12)
    models = [_ChainModel(own, result.fit.chain, result.fit.values, float(spread.min()))]
    left = _leftover(found, [s for s in found.prepared.segments if s.run in found.prepared.split.training])
    for other in ids:
        forms = catalogue()[other].speed_forms if other in catalogue() else ()
        volts = all(s.motion.voltage is not None for s in found.prepared.segments)
        tries = []
        for form in forms:
            if other == own or ("voltage" in form.requires and not volts):
                continue
            chain = (*rest, (other, form))
            values, square = _fitted_values(left, chain, [np.append(kept, s) for s in starts_of(form)])
            tries.append((square, _ChainModel(other, chain, values, models[0].doubt)))
        if tries:
            models.append(min(tries, key=lambda t: t[0])[1])
    return tuple(models) if len(models) > 1 else ()


def chain_squares(found: Fitted, segments: Sequence[Segment], true: _ChainModel, rival: _ChainModel) -> float:
    """λ of a true chain against its rival on segments that the true one made."""
    left = _leftover(found, segments)
    own = float((left(true.chain, true.values) ** 2).sum())
    _, other = _fitted_values(left, rival.chain, [rival.values])
    return max(other - own, 0.0)


def chain_interval(sigma: float, doubt: float) -> tuple[float, float]:
    """95 % interval of a separation: the noise of the flight, and the doubt about the size of what is true."""
    reach = 1.96 * float(np.hypot(1.0, sigma * doubt))
    return max(sigma - reach, 0.0), sigma + reach


@dataclass(frozen=True)
class Hypothesis:
    """One competing model: the terms of its id, given what all of them share, and their coefficients on this set."""

    id: str
    keys: tuple[str, ...]
    """Terms of its own, of the regression; empty where nothing stands in the id's place."""
    beta: np.ndarray
    """Coefficients of these, (k,)."""
    covariance: np.ndarray
    """Theirs, (k, k)."""
    weight: float = 1.0
    """Probability of this form on the set, relative to the most probable one of its id."""
    others: tuple[Hypothesis, ...] = ()
    """Other forms of the id that the set does not distinguish from this one."""


@dataclass(frozen=True)
class Question:
    """Ids of which one is at work, as a model each; `shared` are the keys that all models hold."""

    ids: tuple[str, ...]
    hypotheses: tuple[Hypothesis, ...]
    shared: tuple[str, ...]
    rivals: dict[str, tuple[tuple[str, ...], ...]]
    """To an id every set of terms that may stand for it when it is the other's rival."""


@dataclass(frozen=True)
class FittedSet:
    """A set as the engine fitted it, and what it leaves open."""

    recordings: RecordingSet
    fitted: Fitted
    questions: tuple[Question, ...]
    chains: tuple[tuple[_ChainModel, ...], ...]
    """The same of what lies between command and rotor speed."""
    unanswerable: tuple[tuple[tuple[str, ...], str], ...]
    """Classes that no flight with these columns can settle, with what it takes."""
    whitened: Regression | None = None
    """The set's normal equations through the filters that the engine would learn from it and a flight together."""
    derivatives: tuple[tuple[Form, np.ndarray], ...] = ()
    """Of what the fitted model leaves, as a form with its values; none where they do not predict."""

    @property
    def prepared(self) -> Prepared:
        """What was fitted, with what commands alone cannot determine left out."""
        return self.fitted.prepared

    @property
    def model(self) -> WrenchModel:
        """The model of the set."""
        return self.fitted.model

    @property
    def regression(self) -> Regression:
        """The engine's normal equations of the set."""
        return self.model.search.regression if self.whitened is None else self.whitened


def known(
    recordings: RecordingSet,
    suggested: Sequence[str] = (),
    claimed: Collection[str] | None = None,
) -> FittedSet:
    """The set fitted, and its open questions: classes left open, and ids in `suggested` that may as well be nothing.

    Of ids that the verdict on the set does not claim (`claimed`, all members of its classes) nothing is asked: they are
    too small to matter.

    Raises InputError: the set is no flight.
    """
    if recordings.vehicle.kind != "flight":
        raise InputError(f"set {recordings.name}: a plan is made for flights; this is a {recordings.vehicle.kind}")
    recordings, mistakes, _ = find_mistakes(recordings)
    split = split_runs(recordings)
    fit_part, unseen = parts_of(recordings, split)
    prepared = prepare(fit_part, unseen=tuple(r.name for r in unseen.runs))
    found = fitted(prepared)
    way = ways(found.model, found.values, found.model.selection.active)[0]
    findings, *_ = decided(found, (*mistakes, *findings_outside(found, prepared)), way.fit, way.moved)
    chain = () if found.chain is None else tuple(k for k, _ in found.chain[0].fit.chain)
    if claimed is not None:
        findings = tuple(f for f in findings if f.id in claimed or f.id in suggested)
    questions, chains, unanswerable, seen = [], [], [], set()
    for finding in findings:
        ids = tuple(finding.alternatives) if finding.status == "ambiguous" else ()
        if not ids and finding.id in suggested and finding.status in ("established", "suggested"):
            ids = (finding.id,)
        if not ids or frozenset(ids) in seen:
            continue
        seen.add(frozenset(ids))
        if finding.id in chain:
            if between := _chain_question(found, finding, ids):
                chains.append(between)
            else:
                needed = "these columns give no chain of the others to compare with"
                more = "" if found.measured else "; record the rotor speeds next to the commands"
                unanswerable.append((ids, needed + more))
        elif (question := question_of(found.model, finding, ids)) is not None:
            questions.append(question)
        else:
            unanswerable.append((ids, "these columns give no model of the others to compare with"))
    model, vehicle, thinner = found.model, found.prepared.vehicle, found.prepared.thinner
    x = np.concatenate([thinner(quantities(s.motion, vehicle)) for s in model.segments])
    folds = np.concatenate(model.regression.of_rows(model.regression.folds()))
    learnt = learn(x, np.concatenate(way.left)[:, :6], folds, own_controls(vehicle))
    form = derivative_form(vehicle.model_copy(update={"derivatives": learnt.derivatives}))
    own = () if form is None else (form,)
    asked = tuple(questions), tuple(chains), tuple(unanswerable)
    return FittedSet(recordings, found, *asked, derivatives=own)


def known_from(recordings: RecordingSet, verdict: dict) -> FittedSet:
    """A set fitted, with the questions that its verdict leaves open; `verdict` is the content of its verdict.json.

    Raises InputError: the set is no flight, or does not suffice.
    """
    suggested = [e["id"] for e in verdict["effects"] if e["status"] == "suggested"]
    return known(sufficient(recordings), suggested, claimed_in(verdict))


def claimed_in(verdict: dict) -> set[str]:
    """Ids that a verdict (the content of its verdict.json) claims, and the members of its classes."""
    claims = [e for e in verdict["effects"] if e["status"] in ("established", "ambiguous")]
    return {i for e in claims for i in (e["id"], *e["alternatives"])}


def question_of(model: WrenchModel | ReadingModel, finding: Finding, ids: tuple[str, ...]) -> Question | None:
    """The competing models of a class of which `finding` is the one in the model; None with fewer than two models."""
    search, selection = model.search, model.selection
    own = next((k for k in selection.active if search.terms[k].effect == finding.id), None)
    if own is None:
        return None
    rest = [k for k in selection.active if k != own]
    shared = tuple([*search.always, *rest])
    forms = {i: [t for t in search.terms.values() if t.effect == i and not t.run] for i in ids}
    forms[finding.id] = sorted(forms[finding.id], key=lambda t: t.key != own)
    hypotheses, rivals = [], {}
    for i in ids:
        choices = [(t.key,) for t in forms[i]]
        if not choices:
            continue
        rivals[i] = tuple(choices)
        hypotheses.append(_hypothesis_of(search.regression, shared, i, choices, search.terms, own))
    if len(ids) == 1:
        hypotheses.append(Hypothesis("nothing", (), np.zeros(0), np.zeros((0, 0))))
        rivals["nothing"] = ((),)
    if len(hypotheses) < 2:
        return None
    return Question(tuple(h.id for h in hypotheses), tuple(hypotheses), shared, rivals)


def _worth(regression: Regression, shared: Sequence[str], terms: dict[str, Term], keys: tuple[str, ...]) -> float:
    """What terms explain next to the shared ones, less the cost of their parameters."""
    return regression.explained([*shared, *keys]) - COST_PER_PARAMETER * sum(terms[k].size for k in keys)


def best_of(regression: Regression, shared: Sequence[str], choices, terms: dict[str, Term]) -> tuple[str, ...]:
    """The terms that explain most for their parameters."""
    return max(choices, key=partial(_worth, regression, shared, terms))


def _hypothesis_of(
    regression: Regression, shared: Sequence[str], name: str, choices, terms: dict[str, Term], own: str
) -> Hypothesis:
    """The model of an id in its best form, `own` where that is one of its `choices`, with the forms nearly as good.

    Each has its coefficients as this set has them.
    """
    least_weight = 0.05  # Relative probability from which a form may as well be the true one.
    worth = partial(_worth, regression, shared, terms)
    best = (own,) if (own,) in choices else best_of(regression, shared, choices, terms)
    weights = {keys: float(np.exp(min(worth(keys) - worth(best), 0.0) / 2)) for keys in choices if keys != best}

    def with_terms(keys: tuple[str, ...], weight: float = 1.0, others: tuple[Hypothesis, ...] = ()) -> Hypothesis:
        fit = regression.fit([*shared, *keys])
        where = fit.places(regression.columns(keys))
        return Hypothesis(name, keys, fit.beta[where], fit.covariance[np.ix_(where, where)], weight, others)

    return with_terms(best, others=tuple(with_terms(k, w) for k, w in weights.items() if w > least_weight))


def joined_sets(first: RecordingSet, *others: RecordingSet) -> tuple[RecordingSet, tuple[str, ...]]:
    """All sets as one, and what a reader must know about it.

    Raises InputError: the sets are not of one vehicle as believed, or share no columns but the time.
    """
    others = tuple(in_thirds(s) for s in others)
    sets = (first, *others)
    beliefs = [s.vehicle.model_dump(exclude=set(_MAY_DIFFER)) for s in sets]
    for other, belief in zip(others, beliefs[1:], strict=True):
        for key, value in beliefs[0].items():
            if value != belief[key]:
                raise InputError(
                    f"sets {first.name} and {other.name} differ in {key} of vehicle.yaml ({_brief(value)} and "
                    f"{_brief(belief[key])}); judged together they must be of one vehicle as believed"
                )
    split = split_runs(first)
    held = [] if split.held_out == split.training else [f"1-{n}" for n in split.held_out]
    notes = ["Values and effects are held equal in all sets; thrust may differ from run to run."]
    for number, other in enumerate(others, 2):
        if len(other.runs) >= 3:
            held += [f"{number}-{n}" for n in split_runs(other).held_out]
    columns = [set.intersection(*({n for n in r.table.columns if r.has(n)} for r in s.runs)) for s in sets]
    shared = set.intersection(*columns)
    name = "+".join(s.name for s in sets)
    if shared <= {"time_s"}:
        raise InputError(f"sets {' and '.join(s.name for s in sets)} have no column in common but the time")
    for number, own in enumerate(columns, 1):
        if extra := sorted(own - shared):
            notes.append(f"Not all sets have {', '.join(extra[:4])}{' …' if len(extra) > 4 else ''} of set {number}.")
    runs = [replace(r, name=f"{number}-{r.name}") for number, s in enumerate(sets, 1) for r in s.runs]
    runs = [replace(r, table=r.table[[n for n in r.table.columns if n in shared]]) for r in runs]
    return RecordingSet(name, first.vehicle, tuple(runs), tuple(held) or None), tuple(notes)


def in_thirds(recordings: RecordingSet) -> RecordingSet:
    """A set of one or two runs with each in three parts, as far as these are as long as an environment."""
    if len(recordings.runs) >= 3 or recordings.held_out is not None:
        return recordings
    runs = []
    for run in recordings.runs:
        edges = np.linspace(0, len(run.table), 4).astype(int)
        parts = [run.table.iloc[a:b].reset_index(drop=True) for a, b in zip(edges, edges[1:], strict=False)]
        long = run.time_s[-1] - run.time_s[0] >= 3 * ENVIRONMENT_S
        runs += [replace(run, name=f"{run.name}-{i}", table=t) for i, t in enumerate(parts, 1)] if long else [run]
    return replace(recordings, runs=tuple(runs))


def _brief(value) -> str:
    """A value of vehicle.yaml, short."""
    text = str(value)
    return text if len(text) < 40 else text[:37] + "…"


def answers(open_before: Sequence[tuple[str, ...]], findings: Sequence[Finding]) -> list[dict]:
    """What the findings of all sets together say of each class that was left open: its `ids`, a `sentence`, and as
    `answer` the id that is established now (empty where the question is still open)."""
    out = []
    for ids in open_before:
        answer, sure = "", [f.id for f in findings if f.status == "established" and f.id in ids]
        still = [f for f in findings if f.status == "ambiguous" and set(f.alternatives) & set(ids)]
        if sure and not still:
            answer, said = sure[0], f"all sets together say {' and '.join(sure)}"
        elif still:
            left = still[0].alternatives
            said = f"{'narrowed to' if set(left) < set(ids) else 'still'} {' or '.join(left)}"
        else:
            weaker = [f.id for f in findings if f.status == "suggested" and f.id in ids]
            said = f"suggested is {weaker[0]}" if weaker else "neither is established"
        out.append({"ids": list(ids), "answer": answer, "sentence": f"{' or '.join(ids)}: {said}"})
    return out


def open_classes(analysis: Analysis) -> list[tuple[str, ...]]:
    """Classes that an analysis left open, each once."""
    found = [tuple(f.alternatives) for f in analysis.findings if f.status in CLAIMED and f.alternatives]
    return list(dict.fromkeys(found))
