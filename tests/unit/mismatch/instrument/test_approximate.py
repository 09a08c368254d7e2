"""What another laboratory's equations leave: other forms inside one id, and nothing false beside them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.cable_stiffness import friction
from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.effects.loading import forms_of, rotation_of
from rotorid.mismatch.evidence.motion import is_noise
from rotorid.mismatch.evidence.rows import form_reading
from rotorid.mismatch.instrument.analyse import analyse_instrument, hats
from rotorid.mismatch.instrument.model import MOST_OFFSET, OFFSET, fitted_model, make_terms
from rotorid.mismatch.instrument.setup import set_up, without_voltmeter_noise
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from tests.unit.mismatch.instrument.stands import C_F, C_Q, HUBS, claimed, claims, stand_vehicle
from tests.unit.mismatch.instrument.test_instrument import instrument_for, stand_loading

RATE_HZ = 50.0
SIX = tuple((0.12 * np.cos(k * np.pi / 3), 0.12 * np.sin(k * np.pi / 3), ("ccw", "cw")[k % 2]) for k in range(6))
PLACES = {1: ((0.0, 0.0, "ccw"),), 4: HUBS, 6: SIX}


def form_named(key: str, name: str, vehicle: Vehicle):
    instrument = instrument_for(stand_loading(stand_vehicle()), stand_vehicle())
    return next(f for f in forms_of(catalogue()[key], replace(instrument, vehicle=vehicle)) if f.name == name)


def still(loading, **changes):
    """A loading whose motion has other constants."""
    return replace(loading, motion=replace(loading.motion, **changes))


def test_a_power_of_the_speed_by_hand() -> None:
    """Hover of 0.65 kg on four rotors is at ω_h² = 0.65 · 9.81/(4 · 1.4e-6); at twice that speed a rotor gives
    1.05 · 2^1.9 in place of 4 times its hover thrust of 1.594125 N."""
    vehicle = stand_vehicle(sensor_mount="tilting", mass_kg=0.65)
    loading = stand_loading(vehicle)
    hover = np.sqrt(0.65 * 9.81 / (4 * C_F))
    twice = still(loading, rotor_speed=np.full((loading.size, 4), 2 * hover))
    form = form_named("thrust_curve", "power of the speed", vehicle)
    found = form_reading(form, (-0.1, 0.05), twice, vehicle)
    assert found[0, 2] == pytest.approx(-4 * 1.594125 * (1.05 * 2**1.9 - 4.0))
    rest = still(loading, rotor_speed=np.zeros((loading.size, 4)))
    assert not form_reading(form, (-0.1, 0.05), rest, vehicle).any()


def test_each_rotor_leans_its_own_way() -> None:
    """Of two rotors at x = ±0.1 m the first leans by 0.02 to the right: 0.02 T_1 along y, 0.1 · 0.02 T_1 about z;
    its torque of 0.01 T_1 (ccw: positive) leans with it: −0.02 · 0.01 T_1 about y."""
    vehicle = stand_vehicle(
        sensor_mount="tilting",
        sensor_position_m=[0.0, 0.0, 0.0],
        rotors=[{"x_m": 0.1, "y_m": 0.0, "spin": "ccw"}, {"x_m": -0.1, "y_m": 0.0, "spin": "cw"}],
        torque_coefficient_n_m_s2=0.01 * C_F,
    )
    motion = Motion(np.arange(4.0), np.full((4, 2), 1000.0), rotation=rotation_of(np.zeros(4), np.zeros(4)))
    loading = replace(stand_loading(stand_vehicle()), motion=motion, time_s=np.arange(4.0))
    form = form_named("thrust_tilt", "each rotor its own way", vehicle)
    found = form_reading(form, (0.0, 0.0, 0.02, 0.0), loading, vehicle)[0]
    thrust = C_F * 1e6
    np.testing.assert_allclose(found, [0, 0.02 * thrust, 0, 0, -2e-4 * thrust, 2e-3 * thrust], atol=1e-12)


def test_air_of_a_room_goes_as_a_power_of_the_speed() -> None:
    """Rotors at half their largest speed for long: a quarter of the thrust, (1/4)^(1/2) of the air at n = 1."""
    vehicle = stand_vehicle(sensor_mount="tilting")
    loading = stand_loading(vehicle, seconds=200.0)
    instrument = instrument_for(loading, vehicle)
    largest_n = 4 * C_F * 1000.0**2
    instrument = replace(instrument, largest=(1.0, 1.0, largest_n, 1.0, 1.0, 1.0))
    forms = forms_of(catalogue()["wall_interference"], instrument)
    form = next(f for f in forms if f.name == "recirculation by a power of the speed")
    half = still(loading, rotor_speed=np.full((loading.size, 4), 500.0))
    found = form_reading(form, (0.06, 5.0, 1.0), half, vehicle)
    assert found[-1, 2] == pytest.approx(0.06 * 0.5 * largest_n / 4, rel=1e-6)
    assert abs(found[0, 2]) < 1e-9


def test_a_cable_rubs_as_the_tilt_turns_over() -> None:
    """Up to 0.2 rad and back to 0: the branch is 1 going up, −1 going down, and has turned over after 2 · 0.004 rad."""
    branch = friction(np.concatenate([np.linspace(0, 0.2, 201), np.linspace(0.2, 0, 201)[1:]]))
    assert branch[100] == pytest.approx(1.0) and branch[300] == pytest.approx(-1.0)
    assert branch[204] == pytest.approx(0.0, abs=1e-9)  # 0.004 rad below the top
    assert not friction(np.zeros(5)).any()


def test_a_cable_pulls_on_any_axis_by_any_tilt() -> None:
    vehicle = stand_vehicle()
    form = form_named("cable_stiffness", "full matrix", vehicle)
    symbols = [p.symbol for p in form.parameters]
    values = np.zeros(12)
    values[symbols.index("K_Fz,roll")], values[symbols.index("K_Mx,pitch")] = 0.5, -0.1
    found = form_reading(form, values, stand_loading(vehicle, tilt=(0.2, -0.1)), vehicle)[0]
    np.testing.assert_allclose(found, [0, 0, 0.5 * np.sin(0.2), -0.1 * np.sin(-0.1), 0, 0], atol=1e-12)


def test_a_structure_rings_under_a_part_of_the_load() -> None:
    vehicle = stand_vehicle()
    loading, form = stand_loading(vehicle), form_named("structural_resonance", "second order", vehicle)
    whole, part = (form_reading(form, (4.0, 0.05, p), loading, vehicle) for p in (1.0, 0.8))
    np.testing.assert_allclose(part, 0.8 * whole)
    assert np.abs(whole).max() > 0


def runs_of(change, rotors: int = 4, count: int = 3, seconds: float = 40.0, noise=(0.02, 0.002)) -> list[Run]:
    """Runs of a tared stand; `change(speed, wrench, time_s)` gives the true wrench (n, 6) from the believed one."""
    made = []
    hubs = np.array([h[:2] for h in PLACES[rotors]])
    spin = np.array([1.0 if h[2] == "ccw" else -1.0 for h in PLACES[rotors]])
    for number in range(count):
        rng = np.random.default_rng(number)
        t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
        knots = np.linspace(0, seconds, 17)
        level = np.interp(t, knots, np.r_[0, rng.uniform(200, 1800, 15), 0])
        own = np.stack([np.interp(t, knots, rng.uniform(0.8, 1.2, 17)) for _ in range(rotors)], axis=1)
        speed = level[:, None] * (own if rotors > 1 else 1.0)
        thrust = C_F * speed**2
        wrench = np.zeros((len(t), 6))
        wrench[:, 2] = -thrust.sum(axis=1)
        wrench[:, 3], wrench[:, 4] = -thrust @ hubs[:, 1], thrust @ hubs[:, 0]
        wrench[:, 5] = C_Q * speed**2 @ spin
        read = change(speed, wrench, t) + rng.standard_normal(wrench.shape) * np.repeat(noise, 3)
        table = {"time_s": t} | {f"rotor_speed_{i + 1}_rad_s": speed[:, i] for i in range(rotors)}
        table |= dict(zip((*c.FORCE, *c.MOMENT), read.T, strict=True))
        made.append(Run(f"run{number + 1}", pd.DataFrame(table)))
    return made


def stand_set(change, rotors: int = 4, **more) -> RecordingSet:
    vehicle = stand_vehicle(PLACES[rotors], sensor_position_m=[0.0, 0.0, 0.0], tared=True)
    return RecordingSet("stand", vehicle, tuple(runs_of(change, rotors, **more)))


def test_thrust_of_another_power_is_a_curve_alone() -> None:
    """T = C_F · 900² (ω/900)^1.88 of one rotor: its exponent is found, and nothing beside it."""

    def change(speed, wrench, t):
        wrench[:, 2] = -C_F * 900.0**2 * (speed[:, 0] / 900.0) ** 1.88
        return wrench

    analysis = analyse_instrument(stand_set(change, rotors=1))
    found = claims(analysis)
    assert set(found) == {"thrust_curve"} and not analysis.values
    excess = next(p for p in found["thrust_curve"].parameters if p.symbol == "e")
    assert excess.low < -0.12 < excess.high and excess.high - excess.low < 0.05


def test_a_slow_amplifier_is_no_offset_in_time() -> None:
    """A first-order lag of 1/(2π · 1.5 Hz) = 106 ms is its own derivative times 106 ms: five samples, not two."""

    def change(speed, wrench, t):
        keep = np.exp(-2 * np.pi * 1.5 / RATE_HZ)
        out, state = np.empty_like(wrench), wrench[0]
        for i, now in enumerate(wrench):
            state = keep * state + (1 - keep) * now
            out[i] = state
        return out

    setup = set_up(stand_set(change))
    model = fitted_model(setup, make_terms(setup)[0])
    assert {model.search.terms[k].effect for k in model.selection.active} == {"amplifier_filter"}
    offset = model.regression.columns([OFFSET])
    assert model.regression.limit[offset] == pytest.approx(MOST_OFFSET / RATE_HZ)
    fit = model.selection.fit
    # To the precision of the bounded solver.
    assert abs(fit.beta[list(fit.columns).index(offset[0])]) <= (1 + 1e-6) * MOST_OFFSET / RATE_HZ


def bowed(speed, wrench, t):
    """Thrust of a form that no equation of the catalogue has: 12 % more about 1000 rad/s than at either end."""
    wrench[:, 2] *= 1.0 + 0.12 * np.sin(np.pi * np.clip(speed.mean(axis=1) / 2000.0, 0, 1)) ** 3
    return wrench


def test_what_is_left_of_a_form_is_not_sold_as_another_effect() -> None:
    found = claims(analyse_instrument(stand_set(bowed, rotors=1)))
    classes = {frozenset(f.alternatives) or frozenset([f.id]) for f in found.values()}
    assert len(classes) == 1 and "thrust_curve" in next(iter(classes))


def test_an_effect_of_its_own_stays_beside_a_strong_one() -> None:
    """A tare and a leaning thrust next to a thrust curve: all are needed."""

    def change(speed, wrench, t):
        wrench[:, 2] -= 0.0008 * speed[:, 0]
        wrench[:, 0] += 0.01 * wrench[:, 2]
        return wrench + np.array([0.0, 0.2, 0.1, 0.0, 0.0, 0.0])

    setup = set_up(stand_set(change, rotors=1))
    model = fitted_model(setup, make_terms(setup)[0])
    found = {model.search.terms[k].effect for k in model.selection.active}
    assert len(found) == 3 and {"thrust_curve", "tare_offset"} < found


def test_hats_add_up_to_one() -> None:
    np.testing.assert_allclose(hats(np.array([0.0, 1 / 6, 0.5, 1.0])).sum(axis=1), 1.0)
    np.testing.assert_allclose(hats(np.array([1 / 6]))[0], [0.5, 0.5, 0, 0])


def test_noise_of_a_voltmeter_is_told_from_a_supply_in_steps() -> None:
    white = np.random.default_rng(0).standard_normal(5000)
    steps = np.repeat([0.1, -0.1, 0.05, -0.05, 0.1], 1000)
    assert is_noise([white], [0.02]) and not is_noise([steps], [0.02])


def test_the_voltage_of_a_stand_is_what_can_be_expected_of_it() -> None:
    rng = np.random.default_rng(1)
    loading = stand_loading(stand_vehicle(), seconds=100.0)
    command = loading.motion.rotor_speed
    true = 12.0 - 0.002 * loading.time_s - 3e-11 * (command**3).sum(axis=1)
    read = true + 0.02 * rng.standard_normal(loading.size)
    with_volts = replace(loading, command=command, motion=replace(loading.motion, voltage=read))
    (found,) = without_voltmeter_noise([with_volts])
    inner = slice(250, -250)
    assert (found.motion.voltage - true)[inner].std() < 0.004 and found.voltage_read is read
    (same,) = without_voltmeter_noise([replace(with_volts, command=None)])
    assert same.motion.voltage is read


def test_a_cube_beside_its_own_square_by_hand() -> None:
    """Two rotors and two more at 1000 rad/s: four times 1e-9 · 1e9 − 2e-7 · 1e6 = 0.8 N of thrust."""
    vehicle = stand_vehicle(sensor_mount="tilting")
    loading = still(stand_loading(vehicle), rotor_speed=np.full((1500, 4), 1000.0))
    form = form_named("thrust_curve", "cubic term and its own square", vehicle)
    assert form_reading(form, (1e-9, -2e-7), loading, vehicle)[0, 2] == pytest.approx(-4 * 0.8)


def test_a_coefficient_that_makes_up_for_a_curve_is_not_called_wrong() -> None:
    """Thrust that falls short of the square by 9 % u⁵ at full speed: a curve, whatever C_F fits it best."""

    def change(speed, wrench, t):
        wrench[:, 2] *= 1.03 - 0.09 * (speed[:, 0] / 1800.0) ** 5
        return wrench

    analysis = analyse_instrument(stand_set(change, rotors=1))
    # Of one rotor the curve of the thrust and that of the sensor are functions of the same load.
    assert claimed(analysis) in ({"thrust_curve"}, {"load_nonlinearity"}) and not analysis.values


def test_a_wrong_coefficient_alone_is_called_wrong() -> None:
    def change(speed, wrench, t):
        wrench[:, 2] *= 1.08
        return wrench

    analysis = analyse_instrument(stand_set(change, rotors=1))
    believed, _, low, high = analysis.values["thrust_coefficient_n_s2"]
    assert not claimed(analysis) and low < 1.08 * believed < high


def test_rotors_that_lean_apart_come_before_a_newcomer() -> None:
    """Six rotors lean forward, each its own way: four sums do not hold six thrusts, so no crosstalk."""
    lean = np.array([0.01, 0.04, 0.02, 0.05, 0.0, 0.03])

    def change(speed, wrench, t):
        force = C_F * speed**2 * lean
        wrench[:, 0] += force.sum(axis=1)
        wrench[:, 5] -= force @ np.array([h[1] for h in SIX])
        wrench[:, 3] -= (C_Q * speed**2 * lean) @ np.array([1.0, -1.0] * 3)  # torques lean with their axes
        return wrench

    found = claims(analyse_instrument(stand_set(change, rotors=6)))
    assert set(found) == {"thrust_tilt"}
    values = {p.symbol: p.value for p in found["thrust_tilt"].parameters}
    assert [values[f"eps_x{k + 1}"] for k in range(6)] == pytest.approx(lean.tolist(), abs=1.5e-3)
