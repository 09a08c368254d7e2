"""One audit of the whole catalogue: every effect is there, stated in full, zero when not excited, recovered from
its own simulation, and the same in the simulator as in the regression's columns.

It takes the effects from the catalogue itself: a new file of `rotorid.effects` is audited without a change here.
"""

import re
import sys
from dataclasses import fields, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

import rotorid.effects
from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import COLUMNS_OF, LACK, Contribution, Motion, SpeedPath, not_testable_reason
from rotorid.effects.describe import EXCITATION, instrument_forms
from rotorid.effects.gust import window_form
from rotorid.errors import InputError
from rotorid.mismatch.evidence.rows import form_columns, project, residual
from rotorid.mismatch.evidence.speedpath import commanded_path
from rotorid.mismatch.flight.prepare import make_terms
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.recordings import RecordingSet
from rotorid.vehicle.improved import (
    active_forms,
    active_speed_forms,
    all_forms,
    record_as_stated,
    simulate_as_stated,
    speeds_of_commands,
)
from rotorid.vehicle.simulator import recording, simulate
from tests.unit.mismatch.flights import recorded, with_table

from .flown import DURATION_S, STEP_S, audit_vehicle, commands, entry, fly, motions, segment, start, typical_values

CONTRACT = Path(__file__).parents[3] / "docs" / "recording-contract.md"
NOISE = {"force": 0.1, "moment": 2e-3, "accelerometer": 0.15, "gyroscope": 0.02}
EFFECTS = list(catalogue().values())


def each(forms_of) -> list:
    """Effect and form, of every form that `forms_of` gives of an effect."""
    return [pytest.param(e, form, id=f"{e.id}/{form.name}") for e in EFFECTS for form in forms_of(e)]


def wrench_forms() -> list:
    """Every form that adds a wrench or a reading; a gust stands for its windows with one of them."""
    return each(lambda e: (window_form(0.1, 0.5, 2),) if e.id == "gust" else e.forms(audit_vehicle()))


def speed_forms() -> list:
    return each(lambda e: e.speed_forms)


def set_forms() -> list:
    return each(lambda e: e.set_forms(audit_vehicle()))


def flown_with(effect, form) -> list[Motion]:
    """True flights with the typical values of a form switched on."""
    return motions(fly(effect.id, form))


# --- that it is there and stated in full


def ids_of_the_contract() -> dict[str, set[str]]:
    """Ids that the recording contract lists for flights: physics, sensors, mistakes."""
    text = CONTRACT.read_text().split("## Effect ids")[1]
    starts = {"physics": "Physics, flight and stand:", "sensor": "Sensors and logging:"}
    starts["mistake"] = "Mistakes in the set itself:"
    lines = {kind: next(x for x in text.splitlines() if x.startswith(start)) for kind, start in starts.items()}
    return {kind: set(re.findall(r"`([a-z_]+)`", line)) for kind, line in lines.items()}


def test_every_id_of_the_contract_is_in_the_catalogue():
    ids = ids_of_the_contract()
    assert {kind: len(names) for kind, names in ids.items()} == {"physics": 23, "sensor": 7, "mistake": 4}
    for kind, names in ids.items():
        assert names == {e.id for e in EFFECTS if e.kind == kind and e.id in set().union(*ids.values())}


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_an_effect_is_stated_in_full(effect):
    for name in ("name", "sentence", "source", "sign", "validity", "separating_manoeuvre"):
        assert len(getattr(effect, name)) > 5, name
    assert set(effect.confusers) <= set(catalogue()) - {effect.id}
    vehicle = audit_vehicle()
    acting = (*effect.forms(vehicle), *effect.speed_forms, *effect.set_forms(vehicle))
    read = instrument_forms(effect)
    # The steps of a reading are recognised from the readings themselves, without a form.
    assert acting or read or effect.form_named is not type(effect).form_named or effect.id == "quantisation"
    assert len({form.name for form in read}) == len(read)
    assert len({form.name for form in acting}) == len(acting)
    # The file says nothing of where it is used: the id is the file's name.
    assert (Path(__file__).parents[3] / "src/rotorid/effects" / f"{effect.id}.py").is_file()


@pytest.mark.parametrize(("effect", "form"), [*wrench_forms(), *speed_forms(), *set_forms()])
def test_a_form_is_stated_in_full(effect, form):
    assert "=" in form.equation or "value" in form.equation
    assert len({p.symbol for p in form.parameters}) == len(form.parameters) > 0
    for p in form.parameters:
        assert p.unit and p.meaning, p.symbol
        assert np.isfinite([p.low, p.high]).all() and p.low < p.high, p.symbol
        assert all(p.low <= s <= p.high for s in p.starts), p.symbol
        assert bool(p.starts) or not p.nonlinear, p.symbol
    for value, p in zip(getattr(form, "neutral", ()), form.parameters, strict=False):
        assert p.low <= value <= p.high


@pytest.mark.parametrize(("effect", "form"), each(instrument_forms))
def test_a_form_of_an_instrument_is_stated_in_full(effect, form):
    """What it adds is held by `tests/unit/mismatch/instrument`."""
    assert "=" in form.equation and form.on_loading
    assert len({p.symbol for p in form.parameters}) == len(form.parameters) > 0
    for p in form.parameters:
        assert p.unit and p.meaning, p.symbol
        assert p.low < p.high and all(p.low <= s <= p.high for s in p.starts), p.symbol
        # A gain of a reading may be anything; what is searched for needs an end and a start.
        assert not p.nonlinear or (p.starts and np.isfinite([p.low, p.high]).all()), p.symbol
    excitation = effect.excitation(form)
    assert excitation and set(excitation) <= set(EXCITATION)


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_a_wrench_form_names_its_columns_and_what_excites_it(effect, form):
    assert form.requires and set(form.requires) <= set(COLUMNS_OF) & set(LACK)
    excitation = effect.excitation(form)
    assert excitation and set(excitation) <= {f.name for f in fields(Motion)} | {"always"}


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_the_columns_named_are_enough_and_needed(effect, form):
    motion, vehicle = flown_with(effect, form)[0], audit_vehicle()
    kept = {"time_s", *form.requires}
    bare = replace(motion, **{f.name: None for f in fields(Motion) if f.name not in kept})
    added = form.contribution(bare, vehicle, typical_values(effect.id, form))
    parts = [part for f in fields(added) if (part := getattr(added, f.name)) is not None]
    assert parts and all(part.shape == (motion.size, 3) and np.isfinite(part).all() for part in parts)
    assert not_testable_reason(form, motion, vehicle) is None
    for name in form.requires:
        assert not_testable_reason(form, replace(motion, **{name: None}), vehicle) == LACK[name]


NEW_EFFECT = """
from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench

def buoyancy(m, v, p, w):
    for j in range(3):
        w.force[j] -= p[0] * m.rotation[2, j]

def forms(vehicle):
    return (Form("balloon", "F = -b e_down", (Parameter("b", "N", 0.0, 10.0),), Wrench(buoyancy), ("rotation",)),)

EFFECT = Effect(id="buoyancy", name="a balloon", sentence="it is lifted", forms=forms, source="Archimedes")
"""


def test_an_effect_that_states_no_kernel_does_not_fly():
    form = replace(window_form(0.0, 1.0, 1), contribution=lambda m, v, values: Contribution(force=m.velocity))
    with pytest.raises(InputError, match="does not fly: it states no kernel"):
        simulate(audit_vehicle(), commands(), 0.1, STEP_S, start(), effects=[(form, [1.0, 1.0])])


def test_adding_an_effect_is_adding_one_file(tmp_path, monkeypatch):
    """A file beside the others is in the catalogue, is a term of the search, and flies from a vehicle file."""
    (tmp_path / "buoyancy.py").write_text(NEW_EFFECT)
    monkeypatch.setattr(rotorid.effects, "__path__", [*rotorid.effects.__path__, str(tmp_path)])
    catalogue.cache_clear()
    try:
        assert set(catalogue()) - {e.id for e in EFFECTS} == {"buoyancy"}
        terms, _ = make_terms(audit_vehicle(), [segment(motions(fly())[0])], ("force", "moment"))
        assert "buoyancy/balloon" in {t.key for t in terms}
        lifted = {"id": "buoyancy", "form": "balloon", "parameters": {"b": 0.652}}
        trace = simulate_as_stated(audit_vehicle(effects=(lifted,)), commands(), DURATION_S, STEP_S, start=start())
        # One metre per second squared less of gravity.
        expected = fly().velocity[:, -1, 2] - trace.time_s[-1]
        np.testing.assert_allclose(trace.velocity[:, -1, 2], expected, rtol=1e-6, atol=1e-9)
    finally:
        catalogue.cache_clear()
        sys.modules.pop("rotorid.effects.buoyancy", None)


# --- zero when not excited


def size_of(added) -> float:
    return max([0.0] + [np.abs(v).max() for f in fields(added) if (v := getattr(added, f.name)) is not None])


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_a_wrench_form_is_zero_when_not_excited(effect, form):
    vehicle, values = audit_vehicle(), typical_values(effect.id, form)
    flights = flown_with(effect, form)
    sizes = [size_of(form.contribution(m, vehicle, values)) for m in flights]
    motion, active = flights[int(np.argmax(sizes))], max(sizes)
    gone = values.copy()
    # A gain of zero is no effect; what is nonlinear is a time, a length or a gain of its own.
    gone[list(form.linear) or [0]] = 0.0
    assert size_of(form.contribution(motion, vehicle, gone)) < 1e-12
    excitation = effect.excitation(form)
    if excitation == ("always",):
        assert active > 0
        return
    none = {n: np.full(motion.size, 1e6) if n == "height" else np.zeros_like(getattr(motion, n)) for n in excitation}
    still = replace(motion, **none)
    assert active > 1e-4
    assert size_of(form.contribution(still, vehicle, values)) < 1e-9 * active


def lively_path() -> SpeedPath:
    """Commands over most of the range, up and down, with a voltage that falls: excites every speed form."""
    time_s = 0.01 * np.arange(200)
    speed = 1250 + 600 * np.sin(3 * time_s)[:, None] + 250 * np.sin(11 * time_s[:, None] + np.arange(4))
    return SpeedPath(speed, time_s, 2500.0, np.linspace(12.0, 10.0, 200), 12.0)


def path_of(excitation: str) -> SpeedPath:
    """A series of commands that does not excite a speed form."""
    count = 200
    time_s = 0.01 * np.arange(count)
    speed = np.full((count, 4), 1250.0)
    if excitation == "limit":
        speed = np.full((count, 4), 1575.0)
    if excitation != "change":
        speed = speed + 60.0 * np.sin(7 * time_s + np.arange(4)[:, None]).T
    voltage = np.full(count, 12.0) if excitation == "voltage" else np.linspace(12.0, 10.0, count)
    if excitation == "time":
        time_s = np.zeros(count)
    return SpeedPath(speed, time_s, 2500.0, voltage, 12.0)


@pytest.mark.parametrize(("effect", "form"), list(speed_forms()))
def test_a_speed_form_is_nothing_when_neutral_or_not_excited(effect, form):
    lively = lively_path()
    np.testing.assert_allclose(form.apply(lively, np.array(form.neutral)), lively.speed, rtol=1e-9)
    values = speed_values(form)
    assert np.abs(form.apply(lively, values) - lively.speed).max() > 1.0
    if form.excited_by == "command":
        return  # a static map acts on any command
    path = path_of(form.excited_by)
    gain = 1.0 + (values[1] if form.name == "power of voltage, own reference" else 0.0)
    np.testing.assert_allclose(form.apply(path, values), gain * path.speed, rtol=1e-9)


# --- the same in the simulator as in the regression


def rows(effect, form) -> list:
    """Flights with a form switched on: each stretch, and what is left of it over the baseline by channel group.

    A stretch is as sensors with the form's errors read it, the truth from position and attitude beside it. For an
    effect of a sensor only what its error adds is kept: its flights have drag.
    """
    values, vehicle, out = typical_values(effect.id, form), audit_vehicle(), []
    for motion in flown_with(effect, form):
        added = form.contribution(motion, audit_vehicle(), values)
        read, sources = motion, {}
        if added.specific_force is not None:
            reading = motion.specific_force + added.specific_force
            read = replace(read, specific_force=reading, accelerometer=reading)
            sources["kinematic_specific_force"] = motion.specific_force
        if added.angular_velocity is not None:
            read = replace(read, angular_velocity=motion.angular_velocity + added.angular_velocity)
            sources["kinematic_angular_velocity"] = motion.angular_velocity
        if added.angular_acceleration is not None:
            read = replace(read, angular_acceleration=motion.angular_acceleration + added.angular_acceleration)
        one = segment(read, **sources)
        left = residual(one, vehicle)
        if effect.kind == "sensor":
            own = residual(segment(motion), vehicle)
            left = {group: rest - own.get(group, 0.0) for group, rest in left.items()}
        else:
            # Columns read the acceleration that a model predicts: that of the centre of mass.
            one = replace(one, motion=replace(one.motion, specific_force=motion.specific_force))
        out.append((one, left))
    return out


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_the_simulator_adds_what_the_regression_expects(effect, form):
    """What a simulated flight with the effect leaves over the baseline is the form's columns times its values."""
    vehicle, values = audit_vehicle(), typical_values(effect.id, form)
    worst = largest = 0.0
    for one, left in rows(effect, form):
        columns = form_columns(form, values, one, vehicle, tuple(left))
        gains = values[list(form.linear)] if form.linear else [1.0]
        for group, rest in left.items():
            expected = sum(g * c.get(group, 0.0) for g, c in zip(gains, columns, strict=True))
            largest = max(largest, np.abs(expected).max() / NOISE[group])
            worst = max(worst, np.abs(rest - expected).max() / NOISE[group])
    assert largest > 0.3
    # An error of a sensor is in its own regressor too: the columns are right to first order in it.
    assert worst < (0.05 if effect.kind == "sensor" else 1e-6) * largest


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_switching_it_on_changes_the_flight_or_the_reading(effect, form):
    values = typical_values(effect.id, form)
    stated = audit_vehicle(effects=(entry(effect.id, form, values),))
    ((found, given),) = active_forms(stated)
    assert found.name == form.name and np.array_equal(given, values)
    plain, trace = fly(), fly(effect.id, form)
    moved = 0.0 if effect.kind == "sensor" else np.abs(plain.velocity - trace.velocity).max()
    read = record_as_stated(trace, stated, "r").runs[0].table
    misread = np.abs(read - recording(trace, audit_vehicle(), "r").table).max().max()
    assert moved > 1e-3 or misread > 1e-3
    assert (misread == 0) == (added_reading(form, values, motions(plain)[0]) == 0)


def added_reading(form, values, motion) -> float:
    """Largest error of a reading that a form makes."""
    added = form.contribution(motion, audit_vehicle(), values)
    return max(0.0 if v is None else np.abs(v).max() for v in (added.specific_force, added.angular_velocity))


def speed_values(form) -> np.ndarray:
    """Plain values of a speed form's parameters."""
    if form.name == "lower limit":
        return np.array([0.58])
    plain = typical_values("", form)
    return np.array([0.97 * p.starts[-1] if p.nonlinear else v for p, v in zip(form.parameters, plain, strict=True)])


@pytest.mark.parametrize(("effect", "form"), list(speed_forms()))
def test_the_simulator_turns_the_rotors_as_the_speed_path_says(effect, form):
    values = speed_values(form)
    stated = audit_vehicle(rotor_speed_limits_rad_s=(0, 1500), effects=(entry(effect.id, form, values),))
    assert [(f.name, tuple(v)) for f, v in active_speed_forms(stated)] == [(form.name, tuple(values))]
    voltage = np.linspace(12.0, 10.0, len(commands().time_s))
    trace = simulate_as_stated(stated, commands(), DURATION_S, STEP_S, voltage, start=start())
    one = segment(replace(motions(trace)[0], voltage=voltage), command=commands().rotor_speed)
    expected = commanded_path(one, ((effect.id, form),), values, 0.0, 1500.0, 12.0)
    np.testing.assert_allclose(trace.rotor_speed[0], np.clip(expected, 0, 1500), rtol=1e-9)
    assert np.abs(trace.rotor_speed[0] - commands().rotor_speed).max() > 5.0 or form.excited_by == "time"
    np.testing.assert_array_equal(speeds_of_commands(stated, commands().rotor_speed, trace.time_s, voltage), expected)


# --- that it recovers its own parameters


def fitted(function, form, suggested=()) -> tuple[np.ndarray, np.ndarray]:
    """Least squares of `function(values)`, in units of its noise: estimate and one-sigma.

    It starts at the best of the form's own starting values, or of those `suggested` by the recording.
    """
    low, high = (np.array([getattr(p, side) for p in form.parameters]) for side in ("low", "high"))
    count = max(len(p.starts) for p in form.parameters) or 1
    starts = [
        np.array([p.starts[min(k, len(p.starts) - 1)] if p.starts else 0.0 for p in form.parameters])
        for k in range(count)
    ]
    if suggested:
        starts = [np.zeros(len(form.parameters)) for _ in suggested]
        for start, values in zip(starts, suggested, strict=True):
            start[list(form.nonlinear)] = values
    best = min(starts, key=lambda v: np.sum(function(np.clip(v, low, high)) ** 2))
    inside = np.clip(best, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
    found = least_squares(
        function, inside, bounds=(low, high), x_scale=0.05 * (high - low), xtol=1e-13, ftol=1e-13, gtol=1e-13,
        max_nfev=40,
    )  # fmt: skip
    return found.x, np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))


@pytest.mark.parametrize(("effect", "form"), list(wrench_forms()))
def test_a_form_recovers_its_own_parameters(effect, form):
    """From simulated rows: exactly without noise, within four standard errors with it, and usefully well."""
    vehicle, values = audit_vehicle(), typical_values(effect.id, form)
    stretches, measured = zip(*rows(effect, form), strict=True)
    groups = tuple(measured[0])

    def model(trial):
        parts = [project(form.contribution(one.motion, vehicle, trial), one, vehicle, groups) for one in stretches]
        zero = np.zeros((stretches[0].motion.size, 3))
        return np.concatenate([p.get(g, zero).ravel() / NOISE[g] for p in parts for g in groups])

    truth = np.concatenate([m[g].ravel() / NOISE[g] for m in measured for g in groups])
    pairs = list(zip([s.motion for s in stretches], measured, strict=True))
    suggested = form.guess(pairs, vehicle) if form.guess else ()
    found, sd = fitted(lambda v: model(v) - truth, form, suggested)
    # First order in a sensor's own error, as above.
    allowed = 0.05 * np.abs(values).max() if effect.kind == "sensor" else 0.0
    np.testing.assert_allclose(found, values, rtol=1e-4, atol=max(allowed, 1e-9))
    noisy = truth + np.random.default_rng(7).standard_normal(len(truth))
    found, sd = fitted(lambda v: model(v) - noisy, form, suggested)
    assert (np.abs(found - values) < 4.0 * sd + allowed).all(), (found, values, sd)
    assert (sd / np.abs(values)).min() < 0.25


@pytest.mark.parametrize(("effect", "form"), list(speed_forms()))
def test_a_speed_form_recovers_its_own_parameters(effect, form):
    path = lively_path()
    values = speed_values(form)
    truth = form.apply(path, values)
    found, _ = fitted(lambda v: (form.apply(path, v) - truth).ravel(), form)
    np.testing.assert_allclose(found, values, rtol=1e-4)
    noisy = truth + 10.0 * np.random.default_rng(8).standard_normal(truth.shape)
    found, sd = fitted(lambda v: (form.apply(path, v) - noisy).ravel() / 10.0, form)
    assert (np.abs(found - values) < 4.0 * sd).all(), (found, values, sd)


# --- faults of the set


@pytest.fixture(scope="module")
def sound() -> RecordingSet:
    """Two sound runs with every column that a fault may spoil."""

    def whole(table: pd.DataFrame) -> None:
        for i in range(1, 5):
            table[f"rotor_command_{i}_rad_s"] = table[f"rotor_speed_{i}_rad_s"]
            table[f"throttle_{i}"] = table[f"rotor_speed_{i}_rad_s"] / 2500.0
        table["height_m"] = -table["position_z_m"]
        table["battery_voltage_v"] = 12.0 - 0.01 * table["time_s"]

    return with_table(recorded(1, 2), whole)


@pytest.mark.parametrize(("effect", "form"), list(set_forms()))
def test_a_fault_spoils_its_columns_and_no_other(sound, effect, form):
    same = form.apply(sound, np.array(form.neutral))
    bad = form.apply(sound, np.array(form.example))
    assert same.vehicle == sound.vehicle
    changed = set()
    for before, unchanged, after in zip(sound.runs, same.runs, bad.runs, strict=True):
        np.testing.assert_allclose(unchanged.table, before.table, rtol=1e-12, atol=1e-12)
        changed |= {n for n in before.table if not before.table[n].equals(after.table[n])}
    if effect.id == "spin_direction":
        assert not changed and bad.vehicle != sound.vehicle
    elif effect.id == "rotor_order":
        assert changed == {n for n in sound.runs[0].table if re.search(r"(rotor_.*|throttle)_[34]", n)}
    else:
        assert changed and changed <= set(form.columns)


@pytest.mark.parametrize(("effect", "form"), list(set_forms()))
def test_a_fault_of_the_vehicle_file_is_recorded(effect, form):
    stated = audit_vehicle(effects=(entry(effect.id, form, form.example),))
    assert [f.name for f, _ in all_forms(stated)] == [form.name] and not active_forms(stated)
    handed = record_as_stated(fly(), stated, "r")
    expected = form.apply(record_as_stated(fly(), audit_vehicle(), stated.name), np.array(form.example))
    assert handed.vehicle == expected.vehicle and not handed.vehicle.effects
    assert handed.runs[0].table.equals(expected.runs[0].table)


@pytest.mark.parametrize(("effect", "form"), each(lambda e: e.set_forms(audit_vehicle())[:1]))
def test_a_fault_is_recognised(effect, form):
    """By the first form of each, on a set that holds its columns."""
    _, findings, _ = find_mistakes(form.apply(recorded(1, 2), np.array(form.example)))
    assert [f.id for f in findings] == [effect.id]


@pytest.mark.parametrize("effect_id", [e.id for e in catalogue().values() if e.speed_forms])
def test_speeds_are_finite_at_the_bounds_of_every_form(effect_id):
    """From no command to the full one: the search goes to the bounds, and one that is no number ends it."""
    count = 200
    command = np.repeat(np.linspace(0.0, 2000.0, count)[:, None], 4, axis=1)
    path = SpeedPath(command, np.arange(count) / 100.0, 2000.0, np.linspace(16.8, 14.0, count), 16.8)
    for form in catalogue()[effect_id].speed_forms:
        for ends in product(*((p.low, p.high) for p in form.parameters)):
            assert np.isfinite(form.apply(path, np.array(ends))).all(), (form.name, ends)
