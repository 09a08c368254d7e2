"""What changed between two sets of flights: statements, and limits of all that did not.

A payload that swings below the vehicle in the second set alone is read from the sideways force that the first set's
model leaves there: how it swings depends on the length of its cable and on how it hung, and the first set tells
neither. A larger residual, or flight that the first set has not, keeps two sets from being compared fully.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of
from rotorid.errors import InputError
from rotorid.mismatch.changes.chain import (
    ChainOption,
    ChainTerms,
    options_of,
    others_in_place,
    remembering,
    speed_evidence,
    speed_filters,
    speed_rows,
    squares_of_speeds,
)
from rotorid.mismatch.changes.joint import (
    FARTHER,
    Effects,
    FittedReference,
    Joint,
    joined_at,
    joints_of,
    moved_by,
    on_columns,
    reference_of,
)
from rotorid.mismatch.changes.level_one import CAUSES, LevelOne, of_one_vehicle, seen_by
from rotorid.mismatch.changes.of_instruments import (
    InstrumentReference,
    instrument_reference_of,
    joint_of_instruments,
)
from rotorid.mismatch.changes.problem import (
    MOST_CHANGE,
    NAMES,
    PRIOR,
    change_of,
    feigned,
    form_spread,
    left_by_all,
    spread_of_flights,
    usual_spread,
)
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.posterior import Found, scored
from rotorid.mismatch.decide.selected import relative_change
from rotorid.mismatch.decide.statements import (
    FORM_SD,
    Statement,
    UpperLimit,
    limits_of,
    parameters,
    statements_of,
    widened,
)
from rotorid.mismatch.decide.status import CLAIMED, Estimate, Status
from rotorid.mismatch.decide.values import believed_value
from rotorid.mismatch.decide.words import (
    capital,
    channel_words,
    listed,
    name_words,
    number,
    regime_words,
)
from rotorid.mismatch.evidence.comparison import CHANNELS_OF_WRENCH
from rotorid.mismatch.evidence.gram import TINY, Evidence
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.rows import CHANNELS, Rows
from rotorid.mismatch.flight.fitted import Fitted
from rotorid.mismatch.flight.prepare import guesses
from rotorid.mismatch.flight.swinging import (
    Cable,
    as_effect,
    hanging,
    hanging_stretches,
    hung_by,
    likely_cable,
    on_cable,
    price,
    share_left,
)
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.steps import one_thread, step

_LARGER = 2.0
"""How many times the residual of the first set that of the second must be, in some force or moment, to be noted."""
_KEYS = {name: key for key, name in NAMES.items() if key != "lifted"}  # of one set alone


@dataclass(frozen=True)
class Change:
    """Something that the second set has otherwise than the first."""

    id: str
    """Of an effect or of a mistake in the recordings, or the contract's name of a value."""
    status: Status
    alternatives: tuple[str, ...]
    """The whole class, itself included, where the recordings cannot show which of them changed."""
    probability: float | None
    """That it, or one of its class, changed; None of a mistake, which is found before."""
    parameters: tuple[Estimate, ...]
    """By how much; of a value relative."""


@dataclass(frozen=True)
class _Residual:
    """What a believed vehicle leaves of one force (N) or moment (N m) in a stretch."""

    time_s: np.ndarray
    """(n,)."""
    values: np.ndarray
    """(n,)."""


@dataclass(frozen=True)
class Changes:
    """What changed between two sets of flights of one vehicle."""

    base: str
    new: str
    changes: tuple[Change, ...]
    """The most probable first."""
    limits: tuple[UpperLimit, ...]
    """By how much everything else may have changed at most, with 95 % probability; of a value relative."""
    values: tuple[Estimate, ...]
    """Of every believed value its relative change with 95 % interval, changed or not."""
    residuals: tuple[Mapping[str, _Residual], Mapping[str, _Residual]]
    """Of the longest stretch of each set, by channel."""
    notes: tuple[str, ...] = ()
    """What keeps the two sets from being compared fully, in sentences."""
    kind: str = "flight"
    """Of both sets: `flight`, `stand` or `bench`."""
    level_1: LevelOne | None = None
    """What differs, without a cause; None of a stand or a bench."""
    explained: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Key of a quantity that level 1 states to the ids that predict its difference."""


@one_thread()
def changes_between(
    base: RecordingSet,
    new: RecordingSet,
    seen: LevelOne | None = None,
) -> Changes:
    """What changed from the first set of flights to the second; `seen` as in `changes_from`."""
    base, new = of_one_vehicle((base, new))
    reference = reference_of(base) if base.vehicle.kind == "flight" else instrument_reference_of(base)
    return changes_from(reference, new, seen)


@one_thread()
def changes_from(
    reference: FittedReference | InstrumentReference,
    new: RecordingSet,
    seen: LevelOne | None = None,
) -> Changes:
    """What changed from the flights of a reference to another set of flights; `seen` is what differs without a cause.

    A name that predicts other trims, shares or thrust than what differs is not stated.
    """
    base = reference.recordings
    if seen is None and isinstance(reference, FittedReference):
        seen = seen_by(reference.as_recorded, new)
    if new.vehicle.kind != base.vehicle.kind:
        raise InputError(
            f"{new.name}/vehicle.yaml: kind is {new.vehicle.kind}, expected {base.vehicle.kind} as in {base.name}"
        )
    if isinstance(reference, FittedReference):
        joint, options = _most_alike(reference, new)
        stretches = reference.recorded, _stretches_of_commands(reference, joint)
        found, of_speeds = options[0].found, decided_of_speeds(reference.found, reference.chain, stretches)
        stated, notes = changes_in(options), command_notes(*stretches, base.name, new.name)
    else:
        joint, of_speeds = joint_of_instruments(reference, new), None
        # A bench's runs load different axes: none can be compared with the others.
        found = joint.decide(joint.base, joint.new, _yardstick(joint, ()))
        stated, notes = statements_of(found, of_change=True), ()
    limits = limits_of(found, joint.squares)
    if of_speeds:
        stated = (*stated, *changes_in(of_speeds[0]))
        limits = (*limits, *limits_of(of_speeds[0][0].found, of_speeds[1]))
    vehicles = base.vehicle, new.vehicle
    changes = [
        Change(s.id, s.status, s.alternatives, s.probability, in_percent(s.id, s.parameters, *vehicles))
        for s in stated
        if s.status != "not_established"
    ]
    refused: list[Change] = []
    explained: dict[str, tuple[str, ...]] = {}
    if seen is not None:
        changes, refused, explained = explaining(changes, seen, new.vehicle)
    changed = {i for c in changes for i in (c.id, *c.alternatives)}
    # What level 1 states has a cause, found or not: none of those that it may have is limited.
    changed |= {i for d in (seen.stated if seen else ()) for i in CAUSES[d.quantity.kind]}
    return Changes(
        base=base.name,
        new=new.name,
        changes=(*mistakes_that_differ(reference.mistakes, joint.mistakes_of_new), *changes),
        limits=tuple(sorted((x for x in limits if x.id not in changed), key=lambda x: -x.share)),
        values=_values_of(found, *vehicles),
        residuals=(_residuals_of(reference.rows), _residuals_of(joint.rows_of_new)),
        notes=(
            *_refused_notes(refused),
            *_residual_notes(joint, base.name, new.name),
            *regime_notes(joint.flown_by_base, joint.flown_by_new, base.name, new.name),
            *notes,
            *(f"{own.name}: {text}" for own in (base, new) for text in dict.fromkeys(own.left_out)),
        ),
        kind=new.vehicle.kind,
        level_1=seen,
        explained=explained,
    )


def _most_alike(reference: FittedReference, new: RecordingSet) -> tuple[Joint, list[ChainOption]]:
    """Two sets of flights and what changed, the second set corrected for its mistakes or as recorded.

    A mistake is one change more: corrected for it the two sets must be alike by more than it costs, less what columns
    that contradict each other say for it by themselves. So must they be with a payload that swings in the second set.
    What changed is then known well enough to predict the accelerations in the columns with it.
    """
    both = [(joint, _flight_options(reference, joint)) for joint in joints_of(reference, new)]
    joint, options = max(both, key=lambda b: b[1][0].log_posterior - price_of(b[0].mistakes_of_new))
    if (swinging := _carrying(reference, joint)) is not None:
        other, with_it, nats = swinging
        own = _flight_options(other, with_it)
        if own[0].log_posterior - nats > options[0].log_posterior:
            reference, joint, options = other, with_it, own
    if changed := _changed_effects(reference, options[0].found):
        joint = moved_by(reference, joint, changed)
        options = _flight_options(reference, joint)
    return joint, options


def price_of(mistakes: Sequence[Finding]) -> float:
    """What mistakes in recordings cost, nats, less what their own columns say for them."""
    contradictions = ids_of("contradiction")
    # What columns that contradict each other say for a mistake at least: an axis is named from eight standard errors.
    contradiction_nats = 32.0
    return PRIOR.effect_nats * len(mistakes) - contradiction_nats * sum(m.id in contradictions for m in mistakes)


def _changed_effects(reference: FittedReference, found: Found) -> Effects:
    """Effects that changed, by as much as they did, without those that swing: how that hangs is known before."""
    forms = {t.key: t for t in reference.terms if t.kind == "effect" and not t.form.swings}
    change, out = change_of(found) * found.problem.unit, []
    for key in found.model:
        if key in forms:
            values = np.array(forms[key].values, float)
            values[list(forms[key].form.linear)] = change[found.problem.columns_of[key]]
            out.append((forms[key].form, values))
    return out


@step("what changed")
def _flight_options(reference: FittedReference, joint: Joint) -> list[ChainOption]:
    """The most probable changes of force, moment and sensors, and where the chain changed those without; best first."""
    first = reference.chain if reference.found.commanded else None

    @remembering
    def products_at(chain: ChainTerms | None) -> tuple[Evidence, Evidence]:
        if chain is first:
            return joint.base, joint.new
        at = joined_at(reference, joint.recordings, joint.recorded, chain, joint.mistakes_of_new, joint.own_effects)
        return at.base, at.new

    def base_at(chain: ChainTerms) -> Evidence:
        return on_columns(reference, reference.terms, chain).evidence

    spread = _yardstick(joint, reference.runs)
    options = options_of(first, products_at, spread, base_at)
    found = options[0].found
    if first is not None and found.model:
        own = slice(-len(first.values), None)
        loop = feigned(*products_at(options[0].chain), joint.inertia)
        spread[own] = np.hypot(spread[own], loop[own])
        options = options_of(first, products_at, spread, base_at)
        found = options[0].found
    if len(found.model) > 1:
        # What changed is known by its form, too, and what its form is wrong by is no second change.
        change = change_of(found) * found.problem.unit
        spread = np.hypot(spread, form_spread(joint.new, change, joint.form_sd))
        options = options_of(first, products_at, spread, base_at)
    return options


def _yardstick(joint: Joint, runs: Sequence[Evidence]) -> np.ndarray:
    """One-sigma (K,) by which each coefficient differs where nothing changed; `runs` are those of the first set."""
    usual = usual_spread(joint.base, joint.new, joint.known, joint.inertia, joint.form_sd)
    usual = np.hypot(usual, joint.more_usual)
    return np.hypot(usual, spread_of_flights(runs, partial(joint.decide, spread=usual)))


def _stretches_of_commands(reference: FittedReference, joint: Joint) -> Sequence[Segment]:
    """Stretches of the second set from which its chain is estimated: corrected, or as recorded.

    Where the clock of the rotor speeds was late and is corrected, commands that it stamped, too, would seem early.
    """
    if not joint.uncorrected or reference.chain is None or reference.found.commanded:
        return joint.recorded
    return most_like(reference.found, reference.chain, (joint.recorded, joint.uncorrected))


def most_like(found: Fitted, chain: ChainTerms, variants: Sequence[Sequence[Segment]]) -> Sequence[Segment]:
    """The variant of some stretches in which rotor speeds follow commands most as a chain has it."""
    known = [own for own in variants if own and all(s.command is not None for s in own)]

    def left(own: Sequence[Segment]) -> float:
        return float(np.mean(np.concatenate([r.y.ravel() for r in speed_rows(own, found, chain, chain)]) ** 2))

    return min(known, key=left, default=variants[0])


@step("what changed between command and speed")
def decided_of_speeds(
    found: Fitted, first: ChainTerms | None, both: tuple[Sequence[Segment], Sequence[Segment]]
) -> tuple[list[ChainOption], Mapping[str, np.ndarray]] | None:
    """The changes between command and measured rotor speed, and what the columns amount to; None without both.

    `first` is the chain of the first set's model, `both` the stretches of each set as recorded.
    """
    if first is None or found.commanded or any(s.command is None for own in both for s in own):
        return None
    base, now = speed_rows(both[0], found, first, first), first
    for at_first in (True, False, False):
        # Whitened by what the chains leave in both sets: what no lag of first order explains is large in the second. At
        # first by the first set alone: a change that is still to be found is no noise.
        filters = speed_filters([*base, *([] if at_first else speed_rows(both[1], found, now, now))])
        own = speed_evidence(base, filters, first, first)

        @remembering
        def products_at(chain: ChainTerms, filters=filters, own=own) -> tuple[Evidence, Evidence]:
            return own, speed_evidence(speed_rows(both[1], found, chain, first), filters, chain, first)

        def base_at(chain: ChainTerms, filters=filters) -> Evidence:
            return speed_evidence(speed_rows(both[0], found, chain, first), filters, chain, first)

        options = options_of(first, products_at, first.spread, base_at)
        now = options[0].chain
    return options, squares_of_speeds(speed_rows(both[1], found, now, first), both[1], now)


def changes_in(options: Sequence[ChainOption]) -> tuple[Statement, ...]:
    """What is stated of the best option; a part of the chain in whose place another would do is one of a class."""
    out = []
    for stated in statements_of(options[0].found, of_change=True, form_sd=FORM_SD):
        others = others_in_place(options, stated.id)
        if others and stated.status in CLAIMED:
            members = tuple(sorted({stated.id, *stated.alternatives, *others}))
            stated = replace(stated, status="ambiguous", alternatives=members)
        out.append(stated)
    return tuple(out)


def _residuals_of(rows: Sequence[Rows]) -> dict[str, _Residual]:
    """What is left in the longest stretch, by channel that the set has."""
    longest = max(rows, key=lambda own: len(own.time_s))
    known = [c for c in range(CHANNELS_OF_WRENCH) if np.isfinite(longest.y[:, c]).all()]
    return {CHANNELS[c]: _Residual(longest.time_s, longest.y[:, c]) for c in known}


def _values_of(found: Found, base: Vehicle, new: Vehicle) -> tuple[Estimate, ...]:
    """By how much each believed value changed, relative, with its 95 % interval, changed or not.

    One that did not change is known by the prior that its limit is of (`limits_of`), so that both agree.
    """
    out = []
    for key, term in found.problem.terms.items():
        if term.effect not in _KEYS or not found.problem.unit[found.problem.columns_of[key]].all():
            continue
        problem = widened(found.problem) if key in found.model else found.problem
        at = scored(problem, tuple(sorted({*found.model, key})))
        if at.mode is not None:
            out += in_percent(term.effect, parameters(problem, at, key, FORM_SD), base, new)
    return tuple(out)


def in_percent(name: str, changes: tuple[Estimate, ...], base: Vehicle, new: Vehicle) -> tuple[Estimate, ...]:
    """Changes of an id's parameters as stated: those of a value relative to what the second vehicle.yaml says.

    An interval ends where the prior does: beyond, the coefficient of a mass is that of an infinite one, or a negative.
    """
    key = _KEYS.get(name)
    if key is None:
        return changes
    scale, flown = _believed_over(key, base, new), new.kind == "flight"

    def relative(coefficient: float) -> float:
        coefficient = float(np.clip(coefficient, -MOST_CHANGE, MOST_CHANGE))
        # Nothing accelerates on a stand: there a coefficient is the change itself.
        return scale * (relative_change(key, coefficient, 0.0)[0] if flown else coefficient)

    ends = ("value", "low", "high")
    return tuple(replace(p, **{end: relative(getattr(p, end)) for end in ends}) for p in changes)


def _believed_over(key: str, base: Vehicle, new: Vehicle) -> float:
    """The first vehicle's number over the second's, of a value whose column is in units of the first.

    The column of a mass or an inertia is in flight the force or moment itself, whatever was believed.
    """
    if key == "arm":
        size = [float(np.linalg.norm(v.rotor_positions_m()[:, :2])) for v in (base, new)]
        return size[0] / size[1] if size[1] > 0 else 1.0
    if key in ("thrust", "torque") or (key == "mass" and new.kind != "flight"):
        return believed_value(base, key) / believed_value(new, key)
    return 1.0


def mistakes_that_differ(base: tuple[Finding, ...], new: tuple[Finding, ...]) -> tuple[Change, ...]:
    """Mistakes in the recordings of the second set that the first has not, or clocks that it has late by another time.

    Where both have one of those the difference is stated, if their 95 % intervals exclude zero.
    """
    known, out = {f.which: f for f in base}, []
    for found in new:
        first = known.get(found.which)
        if first is None:
            out.append(Change(found.id, found.status, found.alternatives, None, found.parameters))
        elif later := _later_by(first, found):
            out.append(Change(found.id, found.status, found.alternatives, None, (later,)))
    return tuple(out)


def _later_by(first: Finding, second: Finding) -> Estimate | None:
    """By how much more a clock is late in the second set; None of other mistakes, or where intervals allow zero."""
    if first.late_s is None or second.late_s is None:
        return None
    (old,), (new,) = first.parameters, second.parameters
    away, reach = second.late_s - first.late_s, float(np.hypot(new.high - new.low, old.high - old.low)) / 2.0
    return replace(new, value=away, low=away - reach, high=away + reach) if abs(away) > reach else None


def explaining(
    changes: Sequence[Change], seen: LevelOne, vehicle: Vehicle
) -> tuple[list[Change], list[Change], dict[str, tuple[str, ...]]]:
    """Changes that agree with what differs, those that contradict it, and which differences the former predict.

    Together they predict; where that lies outside of a difference's interval, the change that predicts most of it goes,
    of those that are only suggested if there are any.
    """
    surely = 0.999  # Probability of the interval outside of which a prediction contradicts what differs.
    left, refused = list(changes), []
    known = {d.quantity.key: d for d in seen.differences}
    while True:
        parts = [(c, key, size) for c in left for key, size in predicted(c, vehicle).items() if key in known]
        sums = {key: sum(size for _, k, size in parts if k == key) for _, key, _ in parts}
        wrong = [
            (abs(size) / known[key].sd, c)
            for c, key, size in parts
            for low, high in [known[key].interval(surely)]
            if not low <= sums[key] <= high and size * (sums[key] - known[key].value) > 0
        ]
        if not wrong:
            break
        gone = max(wrong, key=lambda w: (w[1].status == "suggested", w[0]))[1]
        left.remove(gone)
        refused.append(gone)
    explained = {
        key: tuple(dict.fromkeys(c.id for c, k, size in parts if k == key and size * known[key].value > 0))
        for key in sums
        if known[key].stated and abs(sums[key]) > 0.5 * abs(known[key].value)
    }
    return left, refused, explained


def predicted(change: Change, vehicle: Vehicle) -> dict[str, float]:
    """Key of a quantity of level 1 to by how much a change makes it differ, of those changes that make a trim differ.

    Rotors that weaken are asked for more, a centre of mass that moves takes the trims along, more weight asks for more.
    """
    size = {p.symbol: p.value for p in change.parameters}
    shows = catalogue()[change.id].shows_in if change.id in catalogue() else ()
    places, count = vehicle.rotor_positions_m(), vehicle.rotor_count
    arm = float(np.linalg.norm(places[:, :2], axis=1).max()) or 1.0
    more, roll, pitch, shares = 0.0, 0.0, 0.0, {}
    if change.id in ("mass_kg", "thrust_coefficient_n_s2") and change.id in size:
        more = float(np.log1p(size[change.id])) * (1.0 if change.id == "mass_kg" else -1.0)
    elif "trim" in shows and "m_p" not in size and {"r_x", "r_y"} & size.keys():
        roll, pitch = size.get("r_y", 0.0) / arm, -size.get("r_x", 0.0) / arm
    elif "trim" in shows and "m_p" in size:
        more = float(np.log1p(size["m_p"] / vehicle.mass_kg))
        roll, pitch = (
            sign * size.get(f"m_p {axis}", 0.0) / vehicle.mass_kg / arm for axis, sign in (("y", 1.0), ("x", -1.0))
        )
    elif "share" in shows and any(f"d_{i + 1}" in size for i in range(count)):
        given = np.array([size.get(f"d_{i + 1}", np.nan) for i in range(count)])
        given = np.where(np.isnan(given), -np.nansum(given) if np.isnan(given).sum() == 1 else 0.0, given)
        roll, pitch = -float(places[:, 1] @ given) / (arm * count), float(places[:, 0] @ given) / (arm * count)
        shares = {f"share/{i + 1}": float(given.mean() - d) for i, d in enumerate(given)}
    out = {"trim/roll": roll, "trim/pitch": pitch, **shares}
    out |= {f"{kind}/all": more for kind in ("lift", "lift_of_throttle", "lift_without_voltage")}
    return {key: value for key, value in out.items() if value}


def _carrying(reference: FittedReference, joint: Joint) -> tuple[FittedReference, Joint, float] | None:
    """Two sets with the columns of a payload on the cable that suits the second, hung as that set shows.

    With what the states of the payload cost, nats. None where nothing seems to swing, or where it swings in the first
    set already.
    """
    model, prepared = reference.found.model, reference.found.prepared
    swings = [t for t in reference.terms if t.form and t.form.swings]
    if not swings or any(t.key in model.selection.active for t in swings):
        return None
    width, vehicle = sum(t.size for t in reference.terms), prepared.vehicle
    left = [r.y[:, :3] - r.x[:, :3, :width] @ reference.known[:width] for r in joint.rows_of_new]
    times_s = [r.time_s for r in joint.rows_of_new]
    stretches = hanging_stretches(joint.segments_of_new, times_s, left, prepared.thinner.rate_hz)
    starts = guesses(swings[0].form, list(joint.segments_of_new), vehicle, prepared.groups)
    cables = [Cable(*start, vehicle.gravity_m_s2) for start in starts]
    best = min(cables, key=lambda c: share_left(stretches, c), default=None)
    cable = None if best is None else likely_cable(best, stretches)
    found = None if cable is None else hung_by(cable, joint.segments_of_new, stretches)
    if found is None:
        return None
    hung, mass_kg = found
    # One term of each form: the others keep the lengths that they have.
    first = {t.form.name: t.key for t in reversed(swings)}
    terms = [on_cable(t, cable) if t in swings and first[t.form.name] == t.key else t for t in reference.terms]
    other = on_columns(reference, terms, reference.chain)
    recorded = tuple(hanging(s, h.motion.hung) for s, h in zip(joint.recorded, hung, strict=True))
    both = moved_by(other, replace(joint, recorded=recorded), [as_effect(swings[0], cable, mass_kg)])
    keys = {t.key for t in swings}
    alone = tuple(replace(t, alone=t.key in keys) for t in both.new.terms)
    return other, replace(both, new=replace(both.new, terms=alone)), 0.5 * price(hung)


def command_notes(reference: Sequence[Segment], recorded: Sequence[Segment], base: str, new: str) -> tuple[str, ...]:
    """That one of two sets has no commands, so that the chain from command to rotor speed was not compared."""
    first, second = (any(s.command is not None for s in own) for own in (reference, recorded))
    if first == second:
        return ()
    without = new if first else base
    return (f"{without} has no commands: the motors' lag, delay, throttle curve and battery were not compared.",)


def _residual_notes(joint: Joint, base: str, new: str) -> list[str]:
    """That more is left unexplained in the second set than in the first: something outside the catalogue changed."""
    per_block = [left_by_all(own) / own.blocks.sum() for own in (joint.base, joint.new)]
    ratio = np.sqrt(per_block[1] / joint.inertia**2 / np.maximum(per_block[0], TINY))
    larger = [
        (r, int(c)) for r, c in zip(ratio, joint.base.channels, strict=True) if r > _LARGER and c < CHANNELS_OF_WRENCH
    ]
    if not larger:
        return []
    most = max(r for r, _ in larger)
    where = listed([f"the {channel_words(CHANNELS[c])}" for _, c in larger])
    return [
        f"What no known effect explains is up to {most:.1f} times as large in {new} as in {base} ({where}): something "
        f"differs there that is outside the catalogue, or noise and vibration are larger."
    ]


def regime_notes(first: Mapping[str, float], second: Mapping[str, float], base: str, new: str) -> list[str]:
    """In what the second set goes farther than the first; one sentence or none."""
    farther = []
    for name, far in first.items():
        if name in second and second[name] > FARTHER * far > 0:
            words, unit = regime_words(name)
            farther.append(f"{words} {number(second[name])} {unit} where {base} has {number(far)} {unit}")
    if not farther:
        return []
    return [
        f"{new} goes farther ({listed(farther)}). Airspeeds more than {FARTHER} times as high are not compared; other "
        "flight is by the forms of the effects."
    ]


def _refused_notes(refused: Sequence[Change]) -> list[str]:
    """That a name was not stated because it contradicts what differs."""
    return [
        f"{capital(listed([name_words(i) for i in c.alternatives or (c.id,)], 'or'))} would explain the motion, but "
        "would change trims, shares or thrust by other amounts than they differ by: not stated."
        for c in refused
    ]
