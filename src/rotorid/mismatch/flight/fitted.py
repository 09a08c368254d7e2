"""What is fitted to a set: what lies between command and rotor speed, and the model of force, moment and sensors.

1. the chain from command to speed, 2. the grouped search over force, moment and sensor effects with the believed
values free, refined in its nonlinear parameters, the wind and the gusts, 3. the chain once more with the effects found
known, 4. less what may as well be nothing. Then what to do next about the first class that is left open; by how many
standard errors a flight would separate it, `rotorid plan` alone computes and states (`rotorid.plan.plan`): every
candidate is flown in simulation by every competing model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of, ids_of_stage
from rotorid.effects.contract import CURVE, Form
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.select import COST_PER_EFFECT, COST_PER_PARAMETER
from rotorid.mismatch.decide.selected import coefficients
from rotorid.mismatch.decide.words import TAKEN_UP
from rotorid.mismatch.evidence.rows import RUN_SCALE, Term
from rotorid.mismatch.evidence.speedpath import CommandChain
from rotorid.mismatch.flight.gains import wrong_values_of
from rotorid.mismatch.flight.gusts import with_gusts
from rotorid.mismatch.flight.prepare import Prepared, value_term
from rotorid.mismatch.flight.swinging import (
    Windows,
    as_effect,
    cable_of,
    changes,
    hung,
    hung_by,
    like,
    loads,
    payload_windows_of,
    price,
    seems_to_swing,
    stretches_of,
    swinging_term,
    with_likely_length,
    with_payload_on_board,
)
from rotorid.mismatch.flight.wrench import (
    WrenchModel,
    after_residual,
    chosen,
    path_segments,
    refine_nonlinear,
    regression_of,
    speed_path,
    with_wind,
    wrench_model,
)
from rotorid.recordings.signal.kernels import causal

FOLLOWED = "in this recording commands follow roll and pitch, and not roll and pitch the commands"
"""Why what turns a vehicle is not asked for where its controller answers disturbances alone."""
_GAINS_OF_MOMENTS = frozenset({"lifted", "torque", "arm", "inertia_xx", "inertia_yy", "inertia_zz"})


@dataclass(frozen=True)
class Fitted:
    """The model of a set, the believed values it contradicts, and what lies between command and speed."""

    model: WrenchModel
    values: Values
    chain: CommandChain | None
    """None where no command is recorded."""
    measured: bool
    """Whether rotor speeds are measured."""
    instead: Mapping[str, Sequence[Values]] = field(default_factory=dict)
    """To each value called wrong what would explain as much in its place."""

    @property
    def prepared(self) -> Prepared:
        """What was fitted: the fitted runs alone."""
        return self.model.prepared

    @property
    def commanded(self) -> bool:
        """Whether rotor speeds are known from their commands alone."""
        return self.chain is not None and not self.measured


def fitted(prepared: Prepared) -> Fitted:
    """The model of a set."""
    measured = all(s.measured_speed for s in prepared.segments)
    chain = speed_path(prepared)
    if chain is None or measured:
        known, both = prepared, turning(prepared)
    else:
        known, both = known_by_commands(prepared, chain), turning(prepared, chain)
    model = refined_model(known, *both)
    values, instead = wrong_values_of(model)
    if held := values.keys() & set(model.regression.keys_of("held")):
        # A wrong mass has other effects make up for it: once more with it as free as any value.
        freed = [value_term(t.key, known.vehicle) if t.key in held else t for t in known.terms]
        model = refined_model(replace(known, terms=freed), *both)
        values, instead = wrong_values_of(model)
    return Fitted(model, values, chain, measured, instead)


def turning(prepared: Prepared, chain: CommandChain | None = None):
    """Segments and their noisy copies with the rotors turning as measured, or as a chain makes of their commands."""
    both = prepared.segments, prepared.noisy_segments
    if chain is None:
        return both
    return tuple(path_segments(segments, chain, prepared.thinner.cutoff_hz) for segments in both)


def known_by_commands(prepared: Prepared, chain: CommandChain) -> Prepared:
    """The set with what commands alone can determine: no curve of the thrust, which is one of the throttle.

    Where commands follow the motion, and not the motion the commands, moments show trims alone: neither their gains
    nor what turning adds to them.
    """
    same = {i for key in ids_of_stage(CURVE) for i in ids_of("same_on_commands", key)}
    taken = dict.fromkeys(sorted(same), TAKEN_UP)
    terms = [t for t in prepared.terms if t.effect not in same]
    if not chain.result.turned_by_commands:
        gone = {t.key: t.effect for t in terms if t.key in _GAINS_OF_MOMENTS or _of_turning(t, prepared)}
        terms = [t for t in terms if t.key not in gone]
        left = {t.effect for t in terms}
        taken |= {i: FOLLOWED for i in sorted(set(gone.values()) & set(catalogue()) - left)}
    return replace(prepared, terms=terms, not_testable={**prepared.not_testable, **taken})


def _of_turning(term: Term, prepared: Prepared) -> bool:
    """Whether a term is a moment alone that comes and goes as the vehicle turns, and no trim."""
    if term.kind != "effect":
        return False
    segment = max(prepared.segments, key=lambda s: s.motion.size)
    values = np.where(np.asarray(term.values) == 0.0, 1.0, term.values)
    made = term.form.contribution(segment.motion, prepared.vehicle, values)
    if made.moment is None or (made.force is not None and made.force.any()):
        return False
    return bool((made.moment.mean(axis=0) ** 2).sum() < made.moment.var(axis=0).sum())


def refined_model(prepared: Prepared, segments, noisy) -> WrenchModel:
    """The search, then nonlinear parameters refined and the search repeated from there."""
    model = _with_own_scales(prepared, segments, noisy)
    if rules.PAYLOAD_WINDOWS(bool(windows := payload_windows_of(model))):
        segments, noisy, model = _with_payload(prepared, model, windows)
    segments, noisy, model = _with_swing(prepared, model)
    terms = list(model.terms)
    rounds = 4
    for number in range(
        rounds if any(_changes_its_columns(model.search.terms[k].form) for k in model.selection.active) else 0
    ):
        refined = refine_nonlinear(prepared, model, segments, wide=number == 0)
        terms = [replace(t, values=tuple(refined[t.key])) if t.key in refined else t for t in terms]
        before = model
        if segments[0].motion.hung is not None:
            segments, noisy = _hung_anew(model, terms) or (segments, noisy)
        model = wrench_model(prepared, terms, chosen(model), model.selection.active, segments, noisy, model)
        if _converged(before, model):
            break
    model = with_wind(prepared, model, segments, noisy, terms)
    if model.wind is not None:
        terms = list(model.terms)
    return with_gusts(prepared, model, terms)


def _converged(before: WrenchModel, after: WrenchModel) -> bool:
    """Whether two rounds have the same terms at work, and no coefficient that moved by `moved` of its error."""
    if set(before.selection.active) != set(after.selection.active):
        return False
    # Standard errors by which coefficients may move between rounds: columns hang on accelerations that they predict.
    moved = 0.3
    for key in after.selection.active:
        (old, _), (new, covariance) = (coefficients(m.regression, m.selection.fit, key) for m in (before, after))
        if np.any(np.abs(new - old) > moved * np.sqrt(np.diag(covariance))):
            return False
    return True


def _with_own_scales(prepared: Prepared, segments, noisy, effects=None, start=None) -> WrenchModel:
    """The search over all terms, with a scale for each run where thrust differs between them.

    `effects` and `start` as of `wrench_model`.
    """
    model = wrench_model(prepared, prepared.terms, effects, start, segments, noisy)
    if not rules.OWN_SCALES(_thrust_differs(model)):
        return model
    terms = _with_run_scales(prepared.terms, prepared)
    return wrench_model(prepared, terms, effects, model.selection.active, segments, noisy, model)


def _with_payload(prepared: Prepared, model: WrenchModel, windows: list[Windows]):
    """Segments, their noisy copies and the model with a payload on board in some windows, where that explains more.

    Each taking up and dropping costs as much as an effect; without a payload in the model everything is as it was.
    """
    segments, noisy = model.segments, model.noisy_segments
    both = with_payload_on_board(segments, windows), with_payload_on_board(noisy, windows) if noisy else noisy
    with_it = _with_own_scales(prepared, *both)
    carries = any(t.key in with_it.selection.active for t in loads(with_it))
    filters, price = model.regression.filters, COST_PER_EFFECT * changes(both[0])
    if carries and _cost_of(with_it, filters) + price < _cost_of(model, filters):
        return *both, with_it
    return segments, noisy, model


def _with_swing(prepared: Prepared, model: WrenchModel):
    """Segments, their noisy copies and the model with a payload that hung as each run says, if that explains more."""
    same = model.segments, model.noisy_segments, model
    start = swinging_term(model)
    if start is None:
        return same
    stretches = stretches_of(model, model.segments, model.rows)
    if not seems_to_swing(stretches, cable_of(model, start)):
        return same

    def hangs(term: Term):
        cable = cable_of(model, term)
        found = hung_by(cable, model.segments, stretches)
        return None if found is None else (*found, [*chosen(model), as_effect(term, cable, found[1])])

    # The length is looked for near the start's alone: what does not ask for a swing there does not ask for one.
    first = hangs(start)
    if first is not None and not _asks_for_a_swing(prepared, model, start, first[0], first[2]):
        return same
    term = with_likely_length(model, start)
    found = None if term is None else hangs(term)
    if found is None or not _asks_for_a_swing(prepared, model, term, found[0], found[2]):
        return same
    segments, _, effects = found
    noisy = like(segments, model.noisy_segments)
    terms = [replace(t, values=term.values) if _is_like(t, start) else t for t in prepared.terms]
    with_it = _with_own_scales(replace(prepared, terms=terms), segments, noisy, effects, model.selection.active)
    swings = any(with_it.search.terms[k].form.swings for k in with_it.selection.active)
    filters = model.regression.filters
    if swings and _cost_of(with_it, filters) + price(segments) < _cost_of(model, filters):
        return segments, noisy, with_it
    return same


def _asks_for_a_swing(prepared: Prepared, model: WrenchModel, term: Term, segments, effects) -> bool:
    """Whether what swings, next to the model that stands, explains a good part of what it costs.

    A search anew may give it room, by what it makes needless, but takes seconds.
    """
    active = [model.search.terms[k] for k in model.selection.active]
    if any(t.form.swings for t in active):
        return True
    asked = [*(t for t in model.terms if t.kind != "effect"), *active, term]
    regression = regression_of(prepared, asked, effects, segments, model.regression.filters)
    keys = [t.key for t in asked]
    gain = regression.explained(keys) - regression.explained(keys[:-1])
    asking = 0.5  # Share of what a swing costs that it must explain next to the model that stands for a search with it.
    return gain > asking * price(segments)


def _is_like(term: Term, other: Term) -> bool:
    """Whether a term swings on the same cable as another."""
    return bool(term.form and term.form.swings) and term.values == other.values


def _hung_anew(model: WrenchModel, terms: Sequence[Term]):
    """Segments and their noisy copies with a payload that hung as a model with other lengths of the cable says."""
    active = {k for k in model.selection.active if model.search.terms[k].form.swings}
    term = next((t for t in terms if t.key in active), None)
    segments = None if term is None else hung(model, model.segments, model.rows, term)
    return None if segments is None else (segments, like(segments, model.noisy_segments))


def _changes_its_columns(form: Form) -> bool:
    """Whether a form's columns hang on what the model holds: nonlinear parameters, or the accelerations predicted."""
    return bool(form.nonlinear) or not {"angular_acceleration", "specific_force"}.isdisjoint(form.requires)


def _thrust_differs(model: WrenchModel) -> bool:
    """Whether the thrust coefficient is not the same in every run, beyond doubt and by more than `run_spread`."""
    if "thrust" not in model.search.terms or not all(s.measured_speed for s in model.prepared.segments):
        return False
    regression = model.search.regression
    fit = regression.fit(model.search.always + model.selection.active)
    spread, p = regression.between_runs(fit, "thrust")
    runs = len(np.unique(regression.run[regression.training]))
    run_p = 1e-6
    run_spread = 0.007  # Relative spread of the thrust coefficient between runs below which one number serves all.
    return p < run_p and float(np.sqrt(spread[0] * runs)) > run_spread


def _with_run_scales(terms: list[Term], prepared: Prepared) -> list[Term]:
    """Terms with a thrust scale for each run: air density, other propellers, a tachometer's own error."""
    runs = dict.fromkeys([*(s.run for s in prepared.segments), *prepared.unseen])
    run_trust = 0.02  # Relative one-sigma of a run's own thrust about the common one.
    return [*terms, *(Term(f"{RUN_SCALE}{r}", "nuisance", prior_sd=(run_trust,), run=r) for r in runs)]


def _cost_of(model: WrenchModel, filters: dict[int, np.ndarray]) -> float:
    """Whitened squares that a model leaves, and what its ids and parameters cost."""
    left = 0.0
    for part in after_residual(model):
        for channel, taps in filters.items():
            left += float((causal(taps, part[:, channel])[len(taps) :] ** 2).sum())
    terms = [model.search.terms[k] for k in model.selection.active]
    return left + sum(COST_PER_EFFECT + COST_PER_PARAMETER * t.size for t in terms)


@dataclass(frozen=True)
class Decided:
    """The model of a flight, and what is said of it by the fitted runs alone."""

    found: Fitted
    outside: tuple[Finding, ...]
    """Decided before the regression or outside of it of force and moment: mistakes, wind, gusts, the command chain."""
    findings: tuple[Finding, ...]
    """All of them, those that the regression selected or dropped included."""
    values: Mapping[str, tuple[float, float, float, float]]
    """Contract name of a value called wrong to the one believed, the one found and its 95 % interval."""


Watch = Callable[[Decided], None]


def unwatched(decided: Decided) -> None:
    """Nobody watches."""
