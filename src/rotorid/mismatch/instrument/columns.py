"""Rows of the regression for an instrument: reading less load, and what every candidate would add to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.effects.catalogue import before_the_rotors, catalogue
from rotorid.effects.contract import Form, not_testable_reason
from rotorid.effects.loading import NO_ROTORS, Loading, forms_of, weight
from rotorid.mismatch.instrument.setup import PreparedInstrument, averaged, has_weight, pieces_of, rotor_wrench
from rotorid.mismatch.model.prepare import form_terms
from rotorid.mismatch.plant.readings import form_reading
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS
from rotorid.recordings import Vehicle

_DEFAULT_TRUST = {"thrust": 0.1, "torque": 0.2, "mass": 0.05, "arm": 0.03, "gain": 0.03}
VALUE_NAMES = {
    "thrust": "thrust_coefficient_n_s2",
    "torque": "torque_coefficient_n_m_s2",
    "mass": "mass_kg",
    "arm": "arm_scale",
    "gain": "reading_gain",
    "gain_x": "reading_gain_x",
    "gain_y": "reading_gain_y",
    "gain_z": "reading_gain_z",
}
_STILL = "the vehicle does not move on a stand"
OFFSET = "offset:load-reading"
_AtWork = Sequence[tuple[Form, np.ndarray]]
"""Forms with their parameter values."""
_DISPLACED = ("velocity", "angular_velocity", "angular_acceleration", "specific_force", "accelerometer", "gyroscope")


def value_keys(setup: PreparedInstrument) -> list[str]:
    """Believed values that this set can contradict."""
    vehicle, channels = setup.vehicle, setup.instrument.channels
    if vehicle.kind == "bench":
        loaded = [k for k in setup.instrument.loaded if k < 3]
        return ["gain"] + ([f"gain_{'xyz'[k]}" for k in loaded] if len(loaded) > 1 else [])
    keys = []
    commanded = not all(x.measured for x in setup.loadings)
    if not (commanded and setup.estimated_full_speed):
        keys.append("thrust")
    if 5 in channels and vehicle.torque_coefficients_n_m_s2().any():
        keys.append("torque")
    if has_weight(vehicle) and any(k < 3 for k in channels):
        keys.append("mass")
    if any(k in (3, 4) for k in channels) and np.abs(vehicle.rotor_positions_m()).max() > 0:
        keys.append("arm")
    return keys


def make_terms(setup: PreparedInstrument) -> tuple[list[Term], dict[str, str]]:
    """Every term that this set can test, and the ids that it cannot, with the reason."""
    trust = setup.vehicle.trust
    sd = {k: max(trust.get(VALUE_NAMES[k], _DEFAULT_TRUST[k.split("_")[0]]), 1e-6) for k in value_keys(setup)}
    terms = [Term(key, "value", prior_sd=(relative,)) for key, relative in sd.items()]
    reasons: dict[str, str] = {}
    if not setup.steady_points and not setup.instrument.by_hand:
        terms.append(Term(OFFSET, "nuisance", prior_sd=(0.5 / setup.instrument.rate_hz,)))
    empirical = [e for e in UNKNOWNS.values() if e.reading_forms]
    for effect in (*catalogue().values(), *empirical):
        if effect.id in before_the_rotors() or not effect.fitted:
            continue
        if setup.instrument.by_hand and effect.shows == "after a change of load":
            reasons[effect.id] = "loads were put on by hand: their first moments are not known"
            continue
        if setup.steady_points and effect.shows:
            reasons[effect.id] = "the recordings are steady points: nothing that takes time shows in them"
            continue
        if effect.shows_in_moments and not any(c >= 3 for c in setup.instrument.channels):
            reasons[effect.id] = "only forces are read: what each rotor gives shows in the moments"
            continue
        found, why = [], None
        for form in forms_of(effect, setup.instrument):
            if not effect.reading_forms:
                lacking = lacks(form, setup)
                if lacking:
                    why = why or lacking
                    continue
            found += form_terms(effect.id, form)
        terms += found
        if not found and effect.id not in UNKNOWNS:
            of_kind = NO_ROTORS if setup.instrument.bench else _STILL
            reasons[effect.id] = why or (of_kind if effect.lack_on is None else effect.lack_on(setup.instrument))
    return terms, reasons


def lacks(form: Form, setup: PreparedInstrument) -> str | None:
    """Why a form for a flight cannot be tested on this stand."""
    if any(name in _DISPLACED for name in form.requires):
        return _STILL
    return next((r for x in setup.loadings if (r := not_testable_reason(form, x.motion, setup.vehicle))), None)


def value_column(key: str, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading of a relative change of one believed value, (n, 6)."""
    if key == "gain":
        return loading.load
    if key.startswith("gain_"):
        out = np.zeros_like(loading.load)
        axis = "xyz".index(key[-1])
        out[:, axis] = loading.load[:, axis]
        return out
    if key == "mass":
        return weight(loading.motion, vehicle)
    if key == "torque":
        still = vehicle.model_copy(update={"thrust_coefficient_n_s2": 1e-300})
        return rotor_wrench(loading.motion, still)
    still = vehicle.model_copy(update={"torque_coefficient_n_m_s2": None})
    if key == "thrust":
        return rotor_wrench(loading.motion, still)
    flat = still.model_copy(
        update={"rotors": tuple(r.model_copy(update={"x_m": 0.0, "y_m": 0.0}) for r in vehicle.rotors)}
    )
    return rotor_wrench(loading.motion, still) - rotor_wrench(loading.motion, flat)


def _term_columns(term: Term, loading: Loading, vehicle: Vehicle, at_work: _AtWork = ()) -> list[np.ndarray]:
    """Columns of a term, (n, 6) each; the offset in time moves the load with what is `at_work` on its reading."""
    if term.kind == "value":
        return [value_column(term.key, loading, vehicle)]
    if term.kind == "nuisance":
        predicted = sum((form_reading(form, values, loading, vehicle) for form, values in at_work), loading.load)
        return [np.gradient(predicted, loading.dt_s, axis=0)]
    form, values = term.form, np.asarray(term.values, float)
    if term.slope_of is not None:
        step = 1e-3 * max(abs(values[term.slope_of]), 1e-6)
        up, down = values.copy(), values.copy()
        up[term.slope_of] += step
        down[term.slope_of] -= step
        return [(form_reading(form, up, loading, vehicle) - form_reading(form, down, loading, vehicle)) / (2 * step)]
    if not form.linear:
        return [form_reading(form, values, loading, vehicle)]
    columns = []
    for index in form.linear:
        unit = values.copy()
        unit[list(form.linear)] = 0.0
        unit[index] = 1.0
        columns.append(form_reading(form, unit, loading, vehicle))
    return columns


def rows_of(setup: PreparedInstrument, terms: list[Term], loadings=None, at_work: _AtWork = ()) -> list[Rows]:
    """Rows of every stretch's parts, averaged; a channel that is not compared is NaN in y and zero in x.

    `at_work` are the effects known so far: what a reading's clock is off moves their part of it as well.
    """
    out = []
    channels = list(setup.instrument.channels)
    for loading in setup.loadings if loadings is None else loadings:
        pieces = pieces_of(loading, setup.average)
        if not pieces:
            continue
        y = np.full((loading.size, 6), np.nan)
        y[:, channels] = (loading.reading - loading.load)[:, channels]
        small, times = averaged(y, setup.average), averaged(loading.time_s, setup.average)
        x = np.zeros((len(small), 6, sum(t.size for t in terms)))
        at = 0
        for term in terms:
            for column in _term_columns(term, loading, setup.vehicle, at_work):
                x[:, channels, at] = averaged(column[:, channels], setup.average)
                at += 1
        out += [Rows(loading.run, times[p], small[p], x[p]) for p in pieces]
    return out


__all__ = ["OFFSET", "VALUE_NAMES", "make_terms", "rows_of", "value_keys"]
