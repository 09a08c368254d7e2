"""Two sets of flights on the same columns: the sums of products of each, ready to be weighed against each other.

Model, sensors' noise and whitening are the first set's. What they are wrong by is the same in both sets, and cancels
between them. The chain from command to rotor speed is the first set's, too, with a column for each of its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.contract import Form
from rotorid.effects.scale import hover_inflow_m_s
from rotorid.errors import InputError
from rotorid.mismatch.changes.chain import ChainTerms, chain_columns, chain_terms, turning
from rotorid.mismatch.changes.problem import decide_changes, of_environments
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.posterior import Found
from rotorid.mismatch.decide.statements import FORM_SD
from rotorid.mismatch.evidence.gram import Evidence, EvidenceTerm, evidence_from
from rotorid.mismatch.evidence.motion import Segment, regime_variables
from rotorid.mismatch.evidence.regression import NEVER_EXCITED, Regression
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.flight.absent import squares_of
from rotorid.mismatch.flight.every_run import as_flown, comparable
from rotorid.mismatch.flight.fitted import Fitted, fitted
from rotorid.mismatch.flight.prepare import assemble_rows, prepare, prepare_like, value_terms
from rotorid.mismatch.flight.wrench import WrenchModel, chosen
from rotorid.mismatch.instrument.model import ReadingModel
from rotorid.mismatch.mistakes import find_mistakes, in_its_units
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.steps import step

Effects = Sequence[tuple[Form, np.ndarray]]
"""Forms with the values of their parameters."""
_FORCES = (0, 1, 2)
"""Channels of the forces."""
_AIRSPEED = "airspeed_m_s"
_REGIMES = (_AIRSPEED, "rotor_speed_rad_s", "body_rate_rad_s", "tilt_rad")
"""Regime variables by which two sets are compared."""
FARTHER = 1.5
"""How many times as far the second set must go in a regime variable to be noted. Airspeeds beyond that are not
compared: the aerodynamic forms that suit the first set are not known to hold there, and their error is no change."""
_INERTIA_OF = {3: "inertia_xx", 4: "inertia_yy", 5: "inertia_zz"}
"""Channel of each moment to the inertia that it turns."""


@dataclass(frozen=True)
class Joint:
    """Two sets on the same columns."""

    base: Evidence
    new: Evidence
    known: np.ndarray
    """(K,) coefficients of the effects that the first set's model holds, 0 of all others."""
    inertia: np.ndarray
    """(C,) mass, or inertia, of the second vehicle.yaml over that of the first, in each channel."""
    flown_by_base: Mapping[str, float]
    flown_by_new: Mapping[str, float]
    """How far each set goes: 95th percentile of the magnitude of some regime variables."""
    recordings: RecordingSet
    """The second set, corrected for its mistakes."""
    recorded: tuple[Segment, ...]
    """Its stretches of flight as recorded."""
    rows_of_new: tuple[Rows, ...]
    mistakes_of_new: tuple[Finding, ...]
    """Mistakes in the recordings of the second set, corrected."""
    squares: dict[str, np.ndarray]
    """To the key of each effect and believed value what its columns amount to in the second set
    (`absent.squares_of`)."""
    uncorrected: tuple[Segment, ...] = ()
    """The stretches before its mistakes were corrected; none where nothing was that the first set has not as well."""
    segments_of_new: tuple[Segment, ...] = ()
    """Its stretches of flight with the rotors turning; none of an instrument."""
    own_effects: Effects = ()
    """Forms at work in the second set alone, for the accelerations in its columns."""
    more_usual: np.ndarray | float = 0.0
    """(K,) one-sigma of each coefficient between sets in which nothing changed, beyond `usual_spread`."""
    form_sd: float = FORM_SD
    """Share of what effects contribute that their forms are wrong by."""
    decide: Callable[[Evidence, Evidence, np.ndarray], Found] = decide_changes
    """The most probable changes from one set's evidence to another's, given the usual spread (K,)."""


@dataclass(frozen=True)
class FittedReference:
    """The first set, fitted once: what other sets are compared with."""

    recordings: RecordingSet
    """Corrected for its mistakes."""
    as_recorded: RecordingSet
    found: Fitted
    chain: ChainTerms | None
    """From command to rotor speed; None where no commands are recorded."""
    terms: tuple[Term, ...]
    """Of force, moment and sensors, and where rotor speeds are known from commands alone of the chain."""
    rows: tuple[Rows, ...]
    known: np.ndarray
    """(K,) coefficients of the effects that its model holds, 0 of all others."""
    usual_of_chain: np.ndarray
    """(K,) one-sigma of the chain's parameters between flights in which nothing changed, 0 of all others."""
    noise: np.ndarray
    """(C, K, K) what the sensors' noise adds to the products in a block, in either set."""
    evidence: Evidence
    runs: tuple[Evidence, ...]
    """The same run by run."""
    flown: Mapping[str, float]
    """How far it goes: 95th percentile of the magnitude of some regime variables."""
    recorded: tuple[Segment, ...]
    """Its stretches as recorded."""
    mistakes: tuple[Finding, ...]
    """Mistakes in its recordings, corrected."""


@step("the first set")
def reference_of(base: RecordingSet) -> FittedReference:
    """The first set as a verdict fits it, all of its runs."""
    as_recorded = base
    base, mistakes, _ = find_mistakes(replace(base, held_out=()))
    found = fitted(prepare(base))
    model = found.model
    # What one set's commands cannot tell apart from their own scale changes all the same from set to set.
    values = value_terms(model.prepared.vehicle, model.prepared.groups)
    terms = [*values, *(t for t in model.terms if not t.run and t.kind not in ("value", "held"))]
    # As another set's stretches are made: what making them leaves out is left out of both.
    recorded, noisy = _recorded_stretches(found, base)
    chain = chain_terms(found, recorded)
    segments, rows = _rows_of(found, terms, chain, recorded)
    of_chain = chain.terms if found.commanded else []
    known = coefficients_on([*terms, *of_chain], model, model.selection.active)
    usual = np.zeros(len(known))
    if of_chain:
        usual[-len(chain.values) :] = chain.spread
    again = _rows_of(found, terms, chain, noisy)[1] if noisy else []
    alike = [len(r.y) for r in rows] == [len(r.y) for r in again]
    regression = model.regression.again(rows, [*terms, *of_chain], again if alike else None)
    found_noise = evidence_from(regression)
    noise = found_noise.bias_gram / found_noise.blocks.sum()
    evidence = _evidence_of(regression, noise, known, *((chain, chain) if of_chain else ()))
    return FittedReference(
        recordings=base,
        as_recorded=as_recorded,
        found=found,
        chain=chain,
        terms=tuple(terms),
        rows=tuple(rows),
        known=known,
        usual_of_chain=usual,
        noise=noise,
        evidence=evidence,
        runs=by_run(evidence, regression),
        flown=_how_far([regime_variables(s, model.prepared) for s in segments]),
        recorded=tuple(recorded),
        mistakes=mistakes,
    )


def on_columns(reference: FittedReference, terms: Sequence[Term], chain: ChainTerms | None) -> FittedReference:
    """The first set with its columns at other nonlinear parameters of `terms`, or at another chain than its own."""
    found, first = reference.found, reference.chain
    _, rows = _rows_of(found, terms, chain, reference.recorded, first)
    of_chain = chain.terms if found.commanded else []
    regression = found.model.regression.again(rows, [*terms, *of_chain])
    evidence = _evidence_of(regression, reference.noise, reference.known, *((chain, first) if of_chain else ()))
    runs = by_run(evidence, regression)
    return replace(reference, terms=tuple(terms), rows=tuple(rows), evidence=evidence, runs=runs)


def _evidence_of(
    regression: Regression,
    noise: np.ndarray,
    known: np.ndarray,
    chain: ChainTerms | None = None,
    first: ChainTerms | None = None,
) -> Evidence:
    """Evidence of a set's rows; `noise` and `known` as of FittedReference.

    `chain` is the one at which columns are taken, `first` the first set's; None where it has no columns.
    """
    evidence = evidence_from(regression)
    evidence = _with_known_effects(replace(evidence, bias_gram=noise * evidence.blocks.sum()), known)
    return evidence if chain is None else chain.named(evidence, first)


@step("the second set")
def joints_of(reference: FittedReference, new: RecordingSet) -> list[Joint]:
    """Two sets of flights on the same columns: corrected for the second set's mistakes, and as recorded.

    Each is compared with its own vehicle.yaml: what was changed on purpose and is written there is no change. Mistakes
    that the first set has as well are corrected in both, and so is a unit that is wrong.

    Raises
    ------
    InputError
        No stretch of the second set has all that the first was fitted by.
    """
    new, of_units = in_its_units(replace(new, held_out=()))
    corrected, found, _ = find_mistakes(new)
    known = {m.which for m in reference.mistakes}
    variants = [(corrected, (*of_units, *found))]
    if not all(m.which in known for m in found):
        variants.append((new, of_units))
    stretches = [(own, _recorded_stretches(reference.found, own)[0], found) for own, found in variants]
    joints = [
        joined_at(reference, own, recorded, reference.chain, found) for own, recorded, found in stretches if recorded
    ]
    if not joints:
        raise InputError(
            f"set {new.name}: no stretch has all that {reference.recordings.name} was fitted by; "
            "expected the same columns in both"
        )
    as_it_is = stretches[-1][1] if len(stretches) > 1 else ()
    return [replace(joint, uncorrected=tuple(as_it_is)) for joint in joints]


def joined_at(
    reference: FittedReference,
    new: RecordingSet,
    recorded: Sequence[Segment],
    chain: ChainTerms | None,
    mistakes: tuple[Finding, ...],
    own_effects: Effects = (),
) -> Joint:
    """Two sets on the same columns, those of the second taken at a chain of its own; `own_effects` as `_rows_of`."""
    found, model = reference.found, reference.found.model
    segments, rows = _rows_of(found, reference.terms, chain, recorded, reference.chain, new.vehicle, own_effects)
    # A column says something only in channels where it does in the first set.
    seen = np.any([np.any(r.x != 0.0, axis=0) for r in reference.rows], axis=0)
    rows = [replace(r, x=r.x * seen) for r in rows]
    terms = [*reference.terms, *(chain.terms if found.commanded else [])]
    regimes = [(s.run, regime_variables(s, model.prepared)) for s in segments]
    slow = slower(regimes, model.prepared.vehicle, model.regression.block_s, reference.flown)
    of_new = model.regression.again(rows, terms, within=slow)
    if (of_new.by_channel.environment < 0).all():
        raise InputError(
            f"set {new.name}: all of it is more than {FARTHER} times as fast as {reference.recordings.name}; "
            "expected some flight at the same airspeeds in both"
        )
    chains = (chain, reference.chain) if found.commanded else ()
    evidence = _evidence_of(of_new, reference.noise, reference.known, *chains)
    vehicles, channels = (new.vehicle, reference.recordings.vehicle), reference.evidence.channels
    inertia, inertia_of_base = (_inertia_of(v, channels) for v in vehicles)
    compared = [t for t in terms if t.kind in ("effect", "value")]
    return Joint(
        base=reference.evidence,
        new=within_bounds(evidence, reference),
        known=reference.known,
        more_usual=reference.usual_of_chain,
        inertia=inertia / inertia_of_base,
        flown_by_base=reference.flown,
        flown_by_new=_how_far([own for _, own in regimes]),
        recordings=new,
        recorded=tuple(recorded),
        segments_of_new=tuple(segments),
        rows_of_new=tuple(rows),
        mistakes_of_new=mistakes,
        own_effects=own_effects,
        squares=squares_of(replace(model, rows=rows, regression=of_new), compared),
    )


def moved_by(reference: FittedReference, joint: Joint, effects: Effects) -> Joint:
    """Two sets of which the second has some effects more, for the accelerations in its columns."""
    own = (*joint.own_effects, *effects)
    again = joined_at(reference, joint.recordings, joint.recorded, reference.chain, joint.mistakes_of_new, own)
    return replace(again, uncorrected=joint.uncorrected)


def _rows_of(
    found: Fitted,
    terms: Sequence[Term],
    chain: ChainTerms | None,
    recorded: Sequence[Segment],
    first: ChainTerms | None = None,
    vehicle: Vehicle | None = None,
    own_effects: Effects = (),
) -> tuple[list[Segment], list[Rows]]:
    """Stretches with the rotors turning, and their rows: columns of all terms and, known by commands, of the chain.

    Parameters
    ----------
    found, terms
        The first set's model, and the terms of its force, moment and sensors.
    chain, first
        The chain at which columns are taken, and that of the first set (the same where it is left out): what the rows
        leave is that of the latter.
    recorded
        Stretches as recorded.
    vehicle
        What the set itself believes, where that is not what the first set believes. The columns stay those of the
        first set's vehicle: columns that differ between the sets could be combined into differences
        that no vehicle has.
    own_effects
        Forms at work in this set alone, for the accelerations in columns.
    """
    model = found.model
    turned = found if chain is None else turning(found, chain)
    segments = as_flown(list(recorded), turned)
    # What lasts of the residual moment is what lasts of the rotors' own. Free coefficients of a column with that part
    # (arm) and of one without (inertia) would together explain it, whatever it is of.
    rows = assemble_rows(
        model.prepared, list(terms), segments, [*lasting_effects(model), *own_effects], for_comparison=True
    )
    columns = chain_columns(rows, recorded, found, chain) if found.commanded else None
    if vehicle not in (None, model.prepared.vehicle):
        own = assemble_rows(replace(model.prepared, vehicle=vehicle), [], segments)
        rows = [replace(r, y=o.y) for r, o in zip(rows, own, strict=True)]
    if columns is not None:
        away = chain.values - (first or chain).values
        rows = [
            replace(r, y=r.y + x @ away, x=np.concatenate([r.x, np.nan_to_num(x)], axis=2))
            for r, x in zip(rows, columns, strict=True)
        ]
    return segments, rows


def lasting_effects(model: WrenchModel) -> Effects:
    """Effects of a model that act in every run, for the accelerations in columns: what a mass or a lever arm does is
    proportional to all of an acceleration, not to the part that the believed vehicle predicts."""
    known = zip(model.selection.active, chosen(model), strict=True)
    return [effect for key, effect in known if not model.search.terms[key].run]


def slower(
    regimes: Sequence[tuple[str, Mapping[str, np.ndarray]]],
    vehicle: Vehicle,
    block_s: float,
    flown: Mapping[str, float],
) -> Callable[[str, float], bool | None]:
    """Of the middle of a block in the second set, (run, time in s): True where its airspeed is at most FARTHER times
    that `flown` by the first set or the induced velocity in hover, below which rotors work as in hover; else None.

    `regimes` are run and regime variables of each stretch of the second set.
    """
    if _AIRSPEED not in flown:
        return lambda run, time_s: True
    most = max(FARTHER * flown[_AIRSPEED], hover_inflow_m_s(vehicle))

    def within(run: str, time_s: float) -> bool | None:
        for own_run, own in regimes:
            near = np.abs(own["time_s"] - time_s) <= 0.5 * block_s
            if own_run == run and near.any() and np.median(own[_AIRSPEED][near]) > most:
                return None
        return True

    return within


def _how_far(known: Sequence[Mapping[str, np.ndarray]]) -> dict[str, float]:
    """95th percentile of the magnitude of each variable in REGIMES that all stretches have, from those of each."""
    names = [n for n in _REGIMES if all(n in k for k in known)]
    return {n: float(np.nanquantile(np.abs(np.concatenate([k[n] for k in known])), 0.95)) for n in names}


def _inertia_of(vehicle: Vehicle, channels: np.ndarray) -> np.ndarray:
    """What turns each channel's acceleration into a force (kg) or a moment (kg m²), (C,); 1 for sensors' channels."""
    of_moment = {channel: getattr(vehicle.inertia_kg_m2, name[-2:]) for channel, name in _INERTIA_OF.items()}
    return np.array([vehicle.mass_kg if c in _FORCES else of_moment.get(int(c), 1.0) for c in channels])


def by_run(evidence: Evidence, regression: Regression) -> tuple[Evidence, ...]:
    """Evidence run by run: that of the environments in each."""
    environment, run = regression.by_channel.environment, np.asarray(regression.run)
    seen = environment >= 0
    first = {e: r for e, r in zip(environment[seen][::-1], run[seen][::-1], strict=True)}
    runs = np.array([first[e] for e in range(evidence.gram.shape[1])])
    return tuple(of_environments(evidence, runs == r) for r in dict.fromkeys(runs.tolist()))


def coefficients_on(terms: Sequence[Term], model: WrenchModel | ReadingModel, keys: Container[str]) -> np.ndarray:
    """Coefficients (K,) of the terms `keys` in the first set's model, on the columns of `terms`; 0 of all others."""
    start, fit = model.regression.start, model.selection.fit
    found = dict(zip(fit.columns.tolist(), fit.beta, strict=True))
    columns = [(start[t.key] + i if t.key in keys else None) for t in terms for i in range(t.size)]
    return np.array([found.get(column, 0.0) for column in columns])


def _with_known_effects(evidence: Evidence, known: np.ndarray) -> Evidence:
    """Evidence in which another mass or inertia turns all that is known of force and moment into motion.

    Its columns hold the rotors' part alone; a vehicle that is heavier is moved less by its drag, too.
    """
    gram, cross, bias = evidence.gram.copy(), evidence.cross.copy(), evidence.bias_gram.copy()
    for place, channel in enumerate(evidence.channels):
        key = "mass" if channel in _FORCES else _INERTIA_OF.get(int(channel))
        if key is None or key not in evidence.start:
            continue
        turn = np.eye(len(known))
        turn[:, evidence.start[key]] -= known
        gram[place] = np.einsum("ki,ekl,lj->eij", turn, gram[place], turn, optimize=True)
        cross[place] = cross[place] @ turn
        bias[place] = turn.T @ bias[place] @ turn
    return replace(evidence, gram=gram, cross=cross, bias_gram=bias)


def within_bounds(evidence: Evidence, reference: FittedReference) -> Evidence:
    """Evidence of the second set whose effects stay physical: no drag may be lost that the first set has not.

    What the first set has is known to a few standard errors of its column; where it never excites one, not at all.
    """
    reach_of_known = 3.0  # Standard errors by which a coefficient of the first set may be other than its model has it.
    energy = np.einsum("cekk->k", reference.evidence.gram)
    reach = np.where(energy > NEVER_EXCITED, reach_of_known / np.sqrt(np.maximum(energy, NEVER_EXCITED)), np.inf)

    def bounded(term: EvidenceTerm) -> EvidenceTerm:
        if term.kind != "effect" or term.of_change:
            return term
        at = evidence.start[term.key] + np.arange(len(term.linear))
        linear = (
            replace(p, low=p.low - has - far, high=p.high - has + far)
            for p, has, far in zip(term.linear, reference.known[at], reach[at], strict=True)
        )
        return replace(term, linear=tuple(linear), of_change=True)

    return replace(evidence, terms=tuple(bounded(t) for t in evidence.terms))


def _recorded_stretches(found: Fitted, recordings: RecordingSet) -> tuple[list[Segment], list[Segment]]:
    """Stretches of a set with all that the first set's model needs: as recorded, and with noise added once more."""
    both = prepare_like(replace(found.prepared, vehicle=recordings.vehicle), recordings)
    as_it_is, noisy = ([s for s in own if comparable(s, found.model.segments[0])] for own in both)
    return as_it_is, noisy
