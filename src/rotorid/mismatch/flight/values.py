"""Believed values as the contract states them: their numbers, a vehicle with them changed, and what a curve leaves of
what is said about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of
from rotorid.effects.thrust_curve import SQUARE
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.words import effect_words, listed
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES
from rotorid.mismatch.flight.delivered import Values
from rotorid.mismatch.flight.wrench import WrenchModel
from rotorid.recordings import RecordingSet, Vehicle, columns


def believed_value(vehicle: Vehicle, key: str) -> float:
    """The number that a value's name stands for (the mean over rotors of coefficients)."""
    if key == "mass":
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
    """The vehicle with values changed by relative amounts."""
    change = {}
    for key, name in (("thrust", "thrust_coefficient_n_s2"), ("torque", "torque_coefficient_n_m_s2")):
        if key in relative:
            old = getattr(vehicle, name)
            factor = 1 + relative[key]
            change[name] = tuple(v * factor for v in old) if isinstance(old, tuple) else old * factor
    if "mass" in relative:
        change["mass_kg"] = vehicle.mass_kg * (1 + relative["mass"])
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


def only_throttle(recordings: RecordingSet) -> bool:
    """Whether rotor speeds are known from the throttle and a believed full speed alone."""
    count = recordings.vehicle.rotor_count
    return all(
        run.has(*columns.rotor_columns("throttle", count))
        and not run.has(*columns.rotor_columns("rotor_command", count))
        and not run.has(*columns.rotor_columns("rotor_speed", count))
        for run in recordings.runs
    )


def with_thrust_per_command(vehicle: Vehicle, scale: float, full_rad_s: float | None) -> Vehicle:
    """The vehicle whose rotors turn `scale` times as fast at every command, with the believed C_F.

    Of a throttle (`full_rad_s`, the speed that a full one was taken for) that is another full speed; where speeds are
    commanded, another C_F and C_Q.
    """
    if full_rad_s is not None:
        low = (vehicle.rotor_speed_limits_rad_s or (0.0, 0.0))[0]
        return vehicle.model_copy(update={"rotor_speed_limits_rad_s": (low, full_rad_s * scale)})
    return changed_vehicle(vehicle, dict.fromkeys(("thrust", "torque"), scale**2 - 1.0))


def with_square_term(findings: list[Finding], values: dict, model: WrenchModel) -> tuple[list[Finding], dict]:
    """Given a thrust curve the coefficient of its square is the curve's own parameter c_2, and no wrong value.

    C_F and what the curve adds to it trade off against each other; their sum is what the recording knows.
    """
    curves = ids_of("curves_thrust")
    curve = next((f for f in findings if f.id in curves and f.status in CLAIMED), None)
    key = next((k for k in model.selection.active if model.search.terms[k].effect in curves), None)
    if curve is None or key is None or "thrust" not in model.regression.start:
        return findings, values
    fit, coefficient = model.selection.fit, believed_value(model.prepared.vehicle, "thrust")
    share = np.zeros(len(fit.columns))
    share[fit.columns == model.regression.start["thrust"]] = coefficient
    symbols = [curve.form.parameters[i].symbol for i in curve.form.linear]
    if SQUARE in symbols:
        share[fit.columns == model.regression.start[key] + symbols.index(SQUARE)] = 1.0
    elif "thrust" not in values:
        return findings, values
    value, sd = coefficient + share @ fit.beta, np.sqrt(share @ fit.covariance @ share)
    square = Estimate("c_2", float(value), "N s2/rad2", float(value - 1.96 * sd), float(value + 1.96 * sd))
    with_square = replace(curve, parameters=(*(p for p in curve.parameters if p.symbol != SQUARE), square))
    return [with_square if f is curve else f for f in findings], {k: v for k, v in values.items() if k != "thrust"}


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
