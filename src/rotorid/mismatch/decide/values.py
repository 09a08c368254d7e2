"""Believed values as the contract states them: their numbers, a vehicle with them changed, and what they take back of
effects, and open classes of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.ways import FittedModel
from rotorid.mismatch.decide.words import effect_words, listed
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.recordings import Vehicle


def believed_value(vehicle: Vehicle, key: str) -> float:
    """The number that a value's name stands for (the mean over rotors of coefficients)."""
    if key in ("mass", "lifted"):
        return vehicle.mass_kg
    if key == "thrust":
        return float(vehicle.thrust_coefficients_n_s2().mean())
    if key == "torque":
        return float(vehicle.torque_coefficients_n_m_s2().mean())
    if key == "speed":
        return vehicle.rotor_speed_limits_rad_s[1]
    if key.startswith("inertia"):
        return getattr(vehicle.inertia_kg_m2, key[-2:])
    return 1.0  # an arm's or a reading's factor


def changed_vehicle(vehicle: Vehicle, relative: dict[str, float]) -> Vehicle:
    """The vehicle with values changed by relative amounts; of a mass that commands lift its rotors' thrust, too."""
    change = {}
    for key, name in (("thrust", "thrust_coefficient_n_s2"), ("torque", "torque_coefficient_n_m_s2")):
        if key in relative or "lifted" in relative:
            old = getattr(vehicle, name)
            factor = (1 + relative.get(key, 0.0)) * (1 + relative.get("lifted", 0.0))
            change[name] = tuple(v * factor for v in old) if isinstance(old, tuple) else old * factor
    for key in {"mass", "lifted"} & relative.keys():
        change["mass_kg"] = vehicle.mass_kg * (1 + relative[key])
    inertia = {k[-2:]: 1 + v for k, v in relative.items() if k.startswith("inertia")}
    if inertia:
        old = vehicle.inertia_kg_m2
        change["inertia_kg_m2"] = old.model_copy(update={k: getattr(old, k) * f for k, f in inertia.items()})
    if "speed" in relative:
        low, high = vehicle.rotor_speed_limits_rad_s
        change["rotor_speed_limits_rad_s"] = (low, high * (1 + relative["speed"]))
    if "arm" in relative:
        f = 1 + relative["arm"]
        change["rotors"] = tuple(r.model_copy(update={"x_m": r.x_m * f, "y_m": r.y_m * f}) for r in vehicle.rotors)
    return vehicle.model_copy(update=change)


def contract_values(
    vehicle: Vehicle, values: Values, names: Mapping[str, str] = PARAMETER_NAMES
) -> dict[str, tuple[float, float, float, float]]:
    """Wrong values under their names in the contract: believed, refitted and its interval."""
    out = {}
    for key, (relative, sd) in values.items():
        believed = believed_value(vehicle, key)
        out[names[key]] = tuple(
            float(believed * (1 + x)) for x in (0.0, relative, relative - 1.96 * sd, relative + 1.96 * sd)
        )
    return out


def with_values_in_question(analysis: Analysis) -> Analysis:
    """The analysis with those wrong values only suggested that a member of an open class would change.

    Where it is a payload that is at work, the believed mass is right.

    Asked once the words are final: a class that is only suggested questions nothing.
    """
    members = {i for f in analysis.findings if f.status == "ambiguous" for i in f.alternatives}
    changing: dict[str, list[str]] = {}
    for effect_id in sorted(members & set(catalogue())):
        for name in catalogue()[effect_id].would_change:
            if name in analysis.wrong_values:
                changing.setdefault(name, []).append(effect_id)
    if not rules.VALUE_IN_QUESTION(bool(changing)):
        return analysis
    names = {name: listed([effect_words(i) for i in ids], "or") for name, ids in changing.items()}
    doubtful = {
        name: (analysis.values[name], f"{words}, which is not excluded, would change it")
        for name, words in names.items()
    }
    kept = {k: v for k, v in analysis.values.items() if k not in changing}
    return replace(analysis, values=kept, suggested_values={**analysis.suggested_values, **doubtful})


def absorbed_findings(model: FittedModel, values: Values, findings: list[Finding]) -> list[Finding]:
    """A finding for every such effect that `findings` do not hold; none where no value is wrong."""
    if not values:
        return []
    search, regression, active = model.search, model.search.regression, model.selection.active
    held = [k for k in search.always if k not in values]
    base = regression.fit(held + active)
    taken, out = {f.id for f in findings}, {}
    absorbed_p = 1e-6  # About fifty terms are looked at.
    absorbed_gain = 50.0  # Whitened squares: what a reader would have taken for an effect.
    for term in regression.terms:
        if term.kind != "effect" or term.effect in taken or term.effect in out or term.effect in UNKNOWNS:
            continue
        fit = regression.fit([*held, *active, term.key])
        p = regression.wald(fit, regression.columns([term.key]), search.blocks)
        if p < absorbed_p and fit.gain - base.gain > absorbed_gain:
            name = catalogue()[term.effect].name
            text = f"{name} looked significant with the believed values; the refitted values explain it"
            out[term.effect] = Finding(id=term.effect, status="absorbed", sentence=text, p_value=p)
    return list(out.values())
