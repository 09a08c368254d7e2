"""To which file a finding belongs: the vehicle, the conditions of a flight, or the instruments.

Only what is established, or one member of a class, belongs anywhere. A wind blows on one afternoon and a gyroscope's
bias is no property of the airframe: a vehicle that held them would fly worse than the one believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.mismatch.decision.findings import Analysis, Finding, one_per_class
from rotorid.mismatch.posterior.status import CLAIMED
from rotorid.recordings import Vehicle

Place = Literal["vehicle", "conditions", "instruments"]


def form_of(finding: Finding) -> Form | SpeedForm | None:
    """The form of a finding; one between command and rotor speed is known by its equation."""
    if finding.form is not None or not finding.values or finding.id not in catalogue():
        return finding.form
    speed_forms = catalogue()[finding.id].speed_forms
    return next((f for f in speed_forms if f.equation == finding.equation), None)


def place_of(finding: Finding) -> Place | None:
    """The file that a finding belongs to; None for a mistake in the set, which is corrected in the recordings."""
    effect = catalogue()[finding.id]
    if effect.kind == "mistake":
        return None
    if effect.air_moves:
        return "conditions"
    form = form_of(finding)
    if isinstance(form, SpeedForm):
        return "vehicle"
    if effect.kind == "sensor" or effect.of_the_rig:
        return "instruments"
    return "conditions" if finding.windows else "vehicle"  # with a payload on board for a time, say


def claimed(findings: Sequence[Finding]) -> list[Finding]:
    """Established findings, and of each class of alternatives the most significant member."""
    by_p = sorted((f for f in findings if f.status in CLAIMED), key=lambda f: (f.status != "established", f.p_value))
    kept = {id(f) for f in one_per_class(by_p)}
    return [f for f in findings if id(f) in kept]


def delivered(analysis: Analysis, place: Place) -> list[Finding]:
    """Findings that go into one of the files, in the order of the analysis, less what the chosen vehicle lacks.

    A condition or an error of a sensor may have no form (a wind, a delay of stamps): its parameters describe it.
    """
    found = [f for f in claimed(analysis.findings) if f.delivered and place_of(f) == place]
    return [f for f in found if form_of(f) is not None] if place == "vehicle" else found


def with_effects(vehicle: Vehicle, findings: Sequence[Finding]) -> Vehicle:
    """A vehicle with an entry under `effects` for each finding that has a form."""
    return vehicle.model_copy(update={"effects": tuple(entry_of(f) for f in findings if form_of(f) is not None)})


def entry_of(finding: Finding) -> dict:
    """A finding as a vehicle file has it: id, form, parameters, and of a class the members it stands for."""
    form = form_of(finding)
    values = dict(zip((p.symbol for p in form.parameters), map(float, finding.values), strict=True))
    entry = {"id": finding.id, "form": form.name, "parameters": values}
    others = [i for i in finding.alternatives if i != finding.id]
    return {**entry, "one_of": [finding.id, *others]} if finding.status == "ambiguous" and others else entry


def improved_vehicle(analysis: Analysis) -> Vehicle:
    """The vehicle that is taken home: values re-estimated, and the effects of the vehicle that stand."""
    return with_effects(analysis.improved, delivered(analysis, "vehicle"))
