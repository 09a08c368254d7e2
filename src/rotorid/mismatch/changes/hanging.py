"""A payload that swings below the vehicle in the second set alone.

How it swings depends on the length of its cable and on how it hung, and the first set tells neither. Both are read from
the sideways force that the first set's model leaves in the second set.
"""

from __future__ import annotations

from dataclasses import replace

from rotorid.mismatch.changes.joint import Joint, Reference, joined_at, on_terms
from rotorid.mismatch.model.prepare import guesses
from rotorid.mismatch.model.swinging import (
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


def carrying(reference: Reference, joint: Joint) -> tuple[Reference, Joint, float] | None:
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
    other = on_terms(reference, terms)
    recorded = [hanging(s, h.motion.hung) for s, h in zip(joint.recorded, hung, strict=True)]
    own = (as_effect(swings[0], cable, mass_kg),)
    both = joined_at(other, joint.recordings, recorded, other.chain, joint.mistakes_of_new, own)
    keys = {t.key for t in swings}
    alone = tuple(replace(t, alone=t.key in keys) for t in both.new.terms)
    return other, replace(both, new=replace(both.new, terms=alone), uncorrected=joint.uncorrected), 0.5 * price(hung)
