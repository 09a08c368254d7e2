"""Believed values as the contract states them: their numbers, a vehicle with them changed, and what throttle alone or a
curve leaves of what is said about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of, ids_of_stage
from rotorid.effects.contract import CURVE, SUPPLY
from rotorid.effects.throttle_curve import SLOPE
from rotorid.effects.thrust_curve import SQUARE
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Analysis, Finding
from rotorid.mismatch.decide.selected import SMALLEST_CHANGE, VALUE_Z
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


def speed_for_coefficients(values: dict, vehicle: Vehicle) -> dict:
    """Thrust and torque coefficients off by one factor are one speed at full throttle off by its root."""
    if not {"thrust", "torque"} <= set(values) or vehicle.rotor_speed_limits_rad_s is None:
        return values
    (thrust, thrust_sd), (torque, torque_sd) = values["thrust"], values["torque"]
    if abs(thrust - torque) > 2.0 * np.hypot(thrust_sd, torque_sd) + 0.005:
        return values
    weight = 1.0 / np.square([thrust_sd, torque_sd])
    change = float(weight @ [thrust, torque] / weight.sum())
    factor = np.sqrt(1.0 + change)
    rest = {k: v for k, v in values.items() if k not in ("thrust", "torque")}
    return {**rest, "speed": (float(factor - 1.0), float(0.5 / factor / np.sqrt(weight.sum())))}


def throttle_scale(values: Values, model: WrenchModel, full_rad_s: float):
    """Values less what only says how fast rotors turn at full throttle, and that speed, which nobody stated.

    The scale of the throttle rests on the believed thrust coefficient and mass: it is known as well as they are.
    """
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    full = full_rad_s * float(np.sqrt(1 + values.get("thrust", (0.0, 0.0))[0]))
    reach = 1.96 * full * 0.5 * float(np.hypot(trust.get("thrust", 0.0), trust.get("mass", 0.0)))
    return _without_common_scale(values), {PARAMETER_NAMES["speed"]: (float("nan"), full, full - reach, full + reach)}


def _without_common_scale(values: Values) -> Values:
    """Values where the scale of the rotors' speed is not known: no thrust, nor the mass that it carries, and a torque
    less its part in the scale."""
    (thrust, thrust_sd), (torque, torque_sd) = (values.get(k, (0.0, 0.0)) for k in ("thrust", "torque"))
    kept = {k: v for k, v in values.items() if k not in ("thrust", "torque", "speed", "mass")}
    change, sd = (1 + torque) / (1 + thrust) - 1, float(np.hypot(thrust_sd, torque_sd))
    if "torque" in values and abs(change) > max(VALUE_Z * sd, SMALLEST_CHANGE):
        kept["torque"] = (change, sd)
    return kept


def stated_of_commands(findings: list[Finding], values: Values) -> Values:
    """Wrong values to state where rotor speeds are known from commands alone: none that only says their scale.

    At which voltage the believed values hold is not stated (the largest in the set is only a guess), and a curve of the
    throttle has a slope of its own.
    """
    if any(f.id in ids_of_stage(SUPPLY) and f.status in CLAIMED for f in findings):
        values = _without_common_scale(values)
    return without_scale_of_curve(findings, values)


def without_scale_of_curve(findings: list[Finding], values: Values) -> Values:
    """Values without a thrust per mass given a throttle curve that has a scale of its own.

    Where rotor speeds are known from commands alone, a thrust coefficient larger by x is a scale larger by x/2.
    """
    curve = next((f for f in findings if f.id in ids_of_stage(CURVE) and f.status in CLAIMED), None)
    has_scale = curve is not None and SLOPE in [p.symbol for p in curve.parameters]
    return _without_common_scale(values) if has_scale else values


def with_square_term(findings: list[Finding], values: dict, model: WrenchModel) -> tuple[list[Finding], dict]:
    """Given a thrust curve the coefficient of its square is the curve's own parameter c_2, and no wrong value.

    C_F and what the curve adds to it trade off against each other; their sum is what the recording knows.
    """
    curves = ids_of("curves_thrust")
    curve = next((f for f in findings if f.id in curves and f.status in CLAIMED), None)
    key = next((k for k in model.selection.active if model.search.terms[k].effect in curves), None)
    if curve is None or key is None:
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
