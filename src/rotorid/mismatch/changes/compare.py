"""What changed between two sets of flights: statements, and limits of all that did not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.changes.joint import Reference, joint_of, reference_of
from rotorid.mismatch.changes.notes import notes_of
from rotorid.mismatch.changes.problem import decide_changes
from rotorid.mismatch.changes.usual import spread_of_flights, usual_spread
from rotorid.mismatch.channel_errors import CHANNELS_OF_WRENCH
from rotorid.mismatch.decide import relative_change
from rotorid.mismatch.findings import Estimate, Finding, Status
from rotorid.mismatch.posterior.evidence import Evidence
from rotorid.mismatch.posterior.limits import UpperLimit, limits_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.score import scored
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.posterior.statements import parameters, statements_of
from rotorid.mismatch.rows import CHANNELS, PARAMETER_NAMES, Rows
from rotorid.mismatch.values import believed_value
from rotorid.recordings import RecordingSet, Vehicle

KEYS = {name: key for key, name in PARAMETER_NAMES.items()}


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
class Residual:
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
    residuals: tuple[Mapping[str, Residual], Mapping[str, Residual]]
    """Of the longest stretch of each set, by channel."""
    notes: tuple[str, ...] = ()
    """What keeps the two sets from being compared fully, in sentences."""


def changes_between(base: RecordingSet, new: RecordingSet, prior: Prior = Prior()) -> Changes:  # noqa: B008
    """What changed from the first set of flights to the second."""
    return changes_from(reference_of(base), new, prior)


def changes_from(reference: Reference, new: RecordingSet, prior: Prior = Prior()) -> Changes:  # noqa: B008
    """What changed from the flights of a reference to another set of flights."""
    joint, base = joint_of(reference, new), reference.recordings
    usual = usual_spread(joint.base, joint.new, reference.known, joint.inertia)

    def decide(flights: Evidence, other: Evidence, more: np.ndarray | float = 0.0) -> Found:
        return decide_changes(flights, other, np.hypot(usual, more), prior)

    found = decide(joint.base, joint.new, spread_of_flights(reference.runs, decide))
    vehicles = base.vehicle, new.vehicle
    changes = [
        Change(s.id, s.status, s.alternatives, s.probability, in_percent(s.id, s.parameters, *vehicles))
        for s in statements_of(found)
        if s.status != "not_established"
    ]
    changed = {i for c in changes for i in (c.id, *c.alternatives)}
    return Changes(
        base=base.name,
        new=new.name,
        changes=(*mistakes_that_differ(reference.mistakes, joint.mistakes_of_new), *changes),
        limits=tuple(limit for limit in limits_of(found, joint.squares) if limit.id not in changed),
        values=values_of(found, *vehicles),
        residuals=(residuals_of(reference.rows), residuals_of(joint.rows_of_new)),
        notes=notes_of(joint, base.name, new.name),
    )


def as_one(sets: Sequence[RecordingSet]) -> RecordingSet:
    """Several sets of one vehicle as one, each run named after its set.

    Raises
    ------
    InputError
        Their vehicles are not believed to be the same.
    """
    first, *others = sets
    for other in others:
        if other.vehicle != first.vehicle:
            raise InputError(
                f"{other.name}/vehicle.yaml: differs from that of {first.name}; expected one vehicle in all good sets"
            )
    if not others:
        return first
    runs = tuple(replace(run, name=f"{own.name}-{run.name}") for own in sets for run in own.runs)
    return replace(first, name=" + ".join(own.name for own in sets), runs=runs, held_out=())


def residuals_of(rows: Sequence[Rows]) -> dict[str, Residual]:
    """What is left in the longest stretch, by channel that the set has."""
    longest = max(rows, key=lambda own: len(own.time_s))
    known = [c for c in range(CHANNELS_OF_WRENCH) if np.isfinite(longest.y[:, c]).all()]
    return {CHANNELS[c]: Residual(longest.time_s, longest.y[:, c]) for c in known}


def values_of(found: Found, base: Vehicle, new: Vehicle) -> tuple[Estimate, ...]:
    """By how much each believed value changed, relative, with its 95 % interval, changed or not."""
    out = []
    for key, term in found.problem.terms.items():
        if term.effect not in KEYS or not found.problem.unit[found.problem.columns_of[key]].all():
            continue
        at = scored(found.problem, tuple(sorted({*found.model, key})))
        if at.mode is not None:
            out += in_percent(term.effect, parameters(found, at, key), base, new)
    return tuple(out)


def in_percent(name: str, changes: tuple[Estimate, ...], base: Vehicle, new: Vehicle) -> tuple[Estimate, ...]:
    """Changes of an id's parameters as stated: those of a value relative to what the second vehicle.yaml says."""
    key = KEYS.get(name)
    if key is None:
        return changes
    scale = believed_over(key, base, new)
    ends = ("value", "low", "high")
    return tuple(
        replace(p, **{end: scale * relative_change(key, getattr(p, end), 0.0)[0] for end in ends}) for p in changes
    )


def believed_over(key: str, base: Vehicle, new: Vehicle) -> float:
    """The first vehicle's number over the second's, of a value whose column is in units of the first.

    The column of a mass or an inertia is the force or moment itself, whatever was believed.
    """
    if key == "arm":
        size = [float(np.linalg.norm(v.rotor_positions_m()[:, :2])) for v in (base, new)]
        return size[0] / size[1] if size[1] > 0 else 1.0
    if key in ("thrust", "torque"):
        return believed_value(base, key) / believed_value(new, key)
    return 1.0


def mistakes_that_differ(base: tuple[Finding, ...], new: tuple[Finding, ...]) -> tuple[Change, ...]:
    """Mistakes in the recordings of the second set that the first has not."""
    known = {f.id for f in base}
    return tuple(Change(f.id, f.status, f.alternatives, None, f.parameters) for f in new if f.id not in known)
