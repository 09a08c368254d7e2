"""Two sets of flights on the same columns: the sums of products of each, ready to be weighed against each other.

Model, sensors' noise, whitening and the chain from command to rotor speed are the first set's. What they are wrong by
is the same in both sets, and cancels between them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.absent import squares_of
from rotorid.mismatch.changes.problem import decide_changes
from rotorid.mismatch.changes.usual import FORM_SD, of_environments
from rotorid.mismatch.findings import Finding
from rotorid.mismatch.fitted import Fitted, fitted
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.mismatch.motion import Segment
from rotorid.mismatch.posterior.evidence import Evidence, evidence_from
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.prepare import Prepared, assemble_rows, prepare, prepare_like
from rotorid.mismatch.regime import regime_variables
from rotorid.mismatch.regression import Regression, build
from rotorid.mismatch.report_runs import as_flown, comparable
from rotorid.mismatch.rows import Rows, Term
from rotorid.mismatch.wrench import WrenchModel, block_seconds, model_filters
from rotorid.recordings import RecordingSet, Vehicle

FORCES = (0, 1, 2)
"""Channels of the forces."""
REGIMES = ("airspeed_m_s", "rotor_speed_rad_s", "body_rate_rad_s", "tilt_rad")
"""Regime variables by which two sets are compared."""
INERTIA_OF = {3: "inertia_xx", 4: "inertia_yy", 5: "inertia_zz"}
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
    rows_of_new: tuple[Rows, ...]
    mistakes_of_new: tuple[Finding, ...]
    """Mistakes in the recordings of the second set, corrected."""
    squares: dict[str, np.ndarray]
    """To the key of each effect and believed value what its columns amount to in the second set
    (`absent.squares_of`)."""
    more_usual: np.ndarray | float = 0.0
    """(K,) one-sigma of each coefficient between sets in which nothing changed, beyond `usual.usual_spread`."""
    form_sd: float = FORM_SD
    """Share of what effects contribute that their forms are wrong by."""
    decide: Callable[[Evidence, Evidence, np.ndarray, Prior], Found] = decide_changes
    """The most probable changes from one set's evidence to another's, given the usual spread (K,)."""


@dataclass(frozen=True)
class Reference:
    """The first set, fitted once: what other sets are compared with."""

    recordings: RecordingSet
    found: Fitted
    terms: tuple[Term, ...]
    segments: tuple[Segment, ...]
    rows: tuple[Rows, ...]
    block_s: float
    """Length of a block of rows in both sets."""
    known: np.ndarray
    """(K,) coefficients of the effects that its model holds, 0 of all others."""
    evidence: Evidence
    runs: tuple[Evidence, ...]
    """The same run by run."""
    mistakes: tuple[Finding, ...]
    """Mistakes in its recordings, corrected."""

    @property
    def keys(self) -> list[str]:
        """Keys of the terms."""
        return [t.key for t in self.terms]


def reference_of(base: RecordingSet, cutoff_hz: float = 20.0) -> Reference:
    """The first set as a verdict fits it, all of its runs."""
    base, mistakes, _ = find_mistakes(replace(base, held_out=()))
    found = fitted(prepare(base, cutoff_hz))
    model = found.model
    terms = [t for t in model.terms if not t.run]
    keys = [t.key for t in terms]
    # As another set's stretches are made: what making them leaves out is left out of both.
    segments = stretches_of(found, base)
    rows = as_seen(assemble_rows(model.prepared, terms, segments, model.effects), model, keys)
    block_s, known = block_seconds(rows, model.prepared.thinner.rate_hz), known_effects(model, keys)
    regression = regression_of(rows, terms, model, block_s)
    evidence = with_known_effects(evidence_from(regression), known)
    return Reference(
        recordings=base,
        found=found,
        terms=tuple(terms),
        segments=tuple(segments),
        rows=tuple(rows),
        block_s=block_s,
        known=known,
        evidence=evidence,
        runs=by_run(evidence, regression),
        mistakes=mistakes,
    )


def joint_of(reference: Reference, new: RecordingSet) -> Joint:
    """Two sets of flights on the same columns.

    Each is compared with its own vehicle.yaml: what was changed on purpose and is written there is no change.
    """
    new, mistakes, _ = find_mistakes(replace(new, held_out=()))
    found, terms, model = reference.found, list(reference.terms), reference.found.model
    segments = stretches_of(found, new)
    if not segments:
        raise InputError(
            f"set {new.name}: no stretch has all that {reference.recordings.name} was fitted by; "
            "expected the same columns in both"
        )
    rows = against_own(assemble_rows(model.prepared, terms, segments, model.effects), model, segments, new)
    rows = as_seen(rows, model, reference.keys)
    of_new = regression_of(rows, terms, model, reference.block_s)
    held = replace(model, rows=rows, regression=of_new)
    inertia, inertia_of_base = (
        inertia_of(v, reference.evidence.channels) for v in (new.vehicle, reference.recordings.vehicle)
    )
    return Joint(
        base=reference.evidence,
        new=with_known_effects(evidence_from(of_new), reference.known),
        known=reference.known,
        inertia=inertia / inertia_of_base,
        flown_by_base=how_far(reference.segments, model.prepared),
        flown_by_new=how_far(segments, model.prepared),
        rows_of_new=tuple(rows),
        mistakes_of_new=mistakes,
        squares=squares_of(held, [t for t in terms if t.kind in ("effect", "value")]),
    )


def how_far(segments: Sequence[Segment], prepared: Prepared) -> dict[str, float]:
    """95th percentile of the magnitude of each variable in REGIMES that some stretches have."""
    known = [regime_variables(s, prepared) for s in segments]
    names = [n for n in REGIMES if all(n in k for k in known)]
    return {n: float(np.nanquantile(np.abs(np.concatenate([k[n] for k in known])), 0.95)) for n in names}


def inertia_of(vehicle: Vehicle, channels: np.ndarray) -> np.ndarray:
    """What turns each channel's acceleration into a force (kg) or a moment (kg m²), (C,); 1 for sensors' channels."""
    of_moment = {channel: getattr(vehicle.inertia_kg_m2, name[-2:]) for channel, name in INERTIA_OF.items()}
    return np.array([vehicle.mass_kg if c in FORCES else of_moment.get(int(c), 1.0) for c in channels])


def by_run(evidence: Evidence, regression: Regression) -> tuple[Evidence, ...]:
    """Evidence run by run: that of the environments in each."""
    environment, run = regression.by_channel.environment, np.asarray(regression.run)
    seen = environment >= 0
    first = {e: r for e, r in zip(environment[seen][::-1], run[seen][::-1], strict=True)}
    runs = np.array([first[e] for e in range(evidence.gram.shape[1])])
    return tuple(of_environments(evidence, runs == r) for r in dict.fromkeys(runs.tolist()))


def known_effects(model: WrenchModel, keys: list[str]) -> np.ndarray:
    """Coefficients (K,) of the effects that the first set's model holds, on the columns of `keys`."""
    columns, fit = model.regression.columns(keys), model.selection.fit
    active = set(model.regression.columns(model.selection.active))
    found = {c: b for c, b in zip(fit.columns, fit.beta, strict=True) if c in active}
    return np.array([found.get(c, 0.0) for c in columns])


def with_known_effects(evidence: Evidence, known: np.ndarray) -> Evidence:
    """Evidence in which another mass or inertia turns all that is known of force and moment into motion.

    Its columns hold the rotors' part alone; a vehicle that is heavier is moved less by its drag, too.
    """
    gram, cross = evidence.gram.copy(), evidence.cross.copy()
    for place, channel in enumerate(evidence.channels):
        key = "mass" if channel in FORCES else INERTIA_OF.get(int(channel))
        if key is None or key not in evidence.start:
            continue
        turn = np.eye(len(known))
        turn[:, evidence.start[key]] -= known
        gram[place] = np.einsum("ki,ekl,lj->eij", turn, gram[place], turn, optimize=True)
        cross[place] = cross[place] @ turn
    return replace(evidence, gram=gram, cross=cross)


def against_own(rows: list[Rows], model: WrenchModel, segments: list[Segment], new: RecordingSet) -> list[Rows]:
    """Rows of the second set with what its own vehicle leaves of every channel.

    The columns stay those of the first set's vehicle: columns that differ between the sets could be combined into
    differences that no vehicle has.
    """
    if new.vehicle == model.prepared.vehicle:
        return rows
    own = assemble_rows(replace(model.prepared, vehicle=new.vehicle), [], segments)
    return [replace(r, y=o.y) for r, o in zip(rows, own, strict=True)]


def stretches_of(found: Fitted, new: RecordingSet) -> list[Segment]:
    """Stretches of another set with the rotors turning as the first set's chain makes of their commands."""
    prepared = replace(found.prepared, vehicle=new.vehicle)
    own, _ = prepare_like(prepared, new)
    return as_flown([s for s in own if comparable(s, found.model)], found)


def as_seen(rows: list[Rows], model: WrenchModel, keys: list[str]) -> list[Rows]:
    """Rows in which a column says something only in channels where it does in the model's own rows."""
    columns = model.regression.columns(keys)
    seen = np.any([np.any(r.x[:, :, columns] != 0.0, axis=0) for r in model.rows], axis=0)
    return [replace(r, x=r.x * seen) for r in rows]


def regression_of(rows: list[Rows], terms: list[Term], model: WrenchModel, block_s: float) -> Regression:
    """The regression that some rows make, whitened as the model's, with its products by channel."""
    rate_hz = model.prepared.thinner.rate_hz
    return build(
        rows,
        terms,
        model_filters(model),
        lambda run, time_s: True,
        block_s,
        rate_hz,
        by_channel=True,
    )
