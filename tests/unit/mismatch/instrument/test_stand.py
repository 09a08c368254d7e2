"""Stands: what lies between throttle and speed, what is not claimed, and what is not identifiable."""

import numpy as np
import pandas as pd
import pytest

from rotorid.effects.loading import bracketed
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.instrument.analyse import analyse_instrument
from rotorid.mismatch.instrument.chain import find_chain
from rotorid.mismatch.instrument.model import make_terms
from rotorid.mismatch.instrument.setup import set_up
from rotorid.mismatch.tell.sentences import _wrong, surest
from rotorid.recordings import RecordingSet, Run
from tests.unit.mismatch.instrument.stands import C_F, MASS_KG, SENSOR_Z_M, claimed, one_rotor, stand_vehicle

FULL_RAD_S = 2000.0


def steady_run(name: str, volts: float, seed: int) -> Run:
    """Throttle up and down in steps, a reading a second: ω = 2000 ((u − 0.04)/0.96)^0.65 (V/16)^0.8."""
    rng = np.random.default_rng(seed)
    u = np.repeat(np.concatenate([np.linspace(0.1, 1, 10), np.linspace(0.9, 0.1, 9)]), 12)
    v = volts * (1 - 0.01 * u)
    speed = FULL_RAD_S * ((u - 0.04) / 0.96) ** 0.65 * (v / 16.0) ** 0.8 + 3.0 * rng.standard_normal(len(u))
    table = {
        "time_s": np.arange(len(u), dtype=float), "throttle_1": u, "rotor_speed_1_rad_s": speed,
        "battery_voltage_v": v, "force_z_n": -C_F * speed**2 + 0.003 * rng.standard_normal(len(u)),
    }  # fmt: skip
    return Run(name, pd.DataFrame(table))


def supplied(*volts: float) -> RecordingSet:
    """Three runs at these supplies, the last held out."""
    return one_rotor([steady_run("abc"[k], own, k + 1) for k, own in enumerate(volts)], ["c"])


def test_the_curve_of_the_throttle_is_found_from_steady_points() -> None:
    found = find_chain(set_up(supplied(16.0, 14.5, 15.2)))
    estimates = {(f.id, p.symbol): p for f in found.findings for p in f.parameters}
    assert estimates["throttle_curve", "n"].value == pytest.approx(0.65, abs=0.01)
    assert estimates["throttle_curve", "u_0"].value == pytest.approx(0.04, abs=0.003)
    assert estimates["battery_sag", "p"].value == pytest.approx(0.8, abs=0.1)
    # Full speed is stated at the largest voltage: 16 V less a thousandth of it.
    assert found.full_speed == pytest.approx(FULL_RAD_S, rel=0.01)
    assert all(f.status == "established" for f in found.findings if f.id == "throttle_curve")


def test_a_curve_found_at_one_supply_is_not_held_to_carry_over_to_another() -> None:
    analysis = analyse_instrument(supplied(16.0, 16.0, 11.0))
    assert "rotor_speed_1" in analysis.unexplained_channels
    assert "battery_voltage_v" in analysis.unexplained_depends_on


def tilted_run(name: str, roll: float, pitch: float, centre_m, seed: int, moments: bool = True) -> Run:
    """Four rotors alike on a level sensor, the centre of mass at `centre_m` (body axes)."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 20.0, 0.05)
    speed = np.interp(t, [0, 5, 10, 15, 20], [0, 900, 1300, 700, 0])
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    rotation = np.array([[cp, sr * sp, cr * sp], [0, cr, -sr], [-sp, sr * cp, cr * cp]])
    thrust = rotation @ np.array([0, 0, -1.0]) * (4 * C_F * speed**2)[:, None]
    weight = np.array([0.0, 0.0, MASS_KG * 9.81])
    # All hubs alike: their thrust acts at the middle, as seen from the sensor at (0, 0, 0.05).
    moment = np.cross(rotation @ np.array([0, 0, -SENSOR_Z_M]), thrust)
    moment = moment + np.cross(rotation @ (np.asarray(centre_m) - [0, 0, SENSOR_Z_M]), weight)
    force = thrust + weight + 0.02 * rng.standard_normal(thrust.shape)
    moment = moment + 0.0005 * rng.standard_normal(moment.shape)
    table = {"time_s": t, "roll_rad": np.full(len(t), roll), "pitch_rad": np.full(len(t), pitch)}
    table |= {f"rotor_speed_{i + 1}_rad_s": speed for i in range(4)}
    table |= {f"force_{a}_n": force[:, k] for k, a in enumerate("xyz")}
    if moments:
        table |= {f"moment_{a}_n_m": moment[:, k] for k, a in enumerate("xyz")}
    return Run(name, pd.DataFrame(table))


TILTS = ((0, 0), (0.26, 0), (-0.26, 0), (0, 0.26), (0, -0.26), (0.5, 0), (0, 0.5))


def tilted(centre_m, tilts=TILTS) -> tuple[Run, ...]:
    """A run at each tilt."""
    return tuple(tilted_run(f"r{k}", roll, pitch, centre_m, k) for k, (roll, pitch) in enumerate(tilts))


def test_a_higher_centre_of_mass_is_not_sold_as_a_mass_and_a_tare() -> None:
    analysis = analyse_instrument(RecordingSet("s", stand_vehicle(), tilted((0.004, -0.003, 0.004)), ("r2", "r4")))
    assert analysis.values == {}
    assert "com_offset" in claimed(analysis) and "tare_offset" not in claimed(analysis)


def test_what_the_weight_loads_is_known_where_the_mount_tilts_with_the_sensor() -> None:
    """On a sensor that tilts the weight pushes along x and y and turns about them; rotors alike push along z."""
    level, tilting = (
        set_up(RecordingSet("s", stand_vehicle(sensor_mount=mount), tilted((0, 0, 0)))).instrument
        for mount in ("level", "tilting")
    )
    assert tilting.weighed == (0, 1, 3, 4) and tilting.loaded == (2,)
    assert not {0, 1} & {*level.weighed}


def test_which_rotor_is_stronger_cannot_be_seen_without_moments() -> None:
    runs = [tilted_run(f"r{k}", 0, 0, (0, 0, 0), k, moments=False) for k in range(3)]
    terms, reasons = make_terms(set_up(RecordingSet("s", stand_vehicle(tared=True), tuple(runs), ())))
    assert "unequal_rotors" in reasons and all(t.effect != "unequal_rotors" for t in terms)


def test_a_value_of_which_nothing_was_believed_is_said_so() -> None:
    text = _wrong("rotor_speed_limits_rad_s", (float("nan"), 2000.0, 1990.0, 2010.0))
    assert text.endswith("nothing was believed about it.") and "unknown" not in text


def test_a_sentence_names_the_surest_numbers() -> None:
    wide, sharp = Estimate("a", 1.0, "1", -9.0, 11.0), Estimate("b", 0.1, "1", 0.09, 0.11)
    assert [e.symbol for e in surest((wide, sharp, wide, sharp, sharp))] == ["b", "b", "b"]
    assert [e.symbol for e in surest((wide, sharp))] == ["a", "b"]


def test_a_product_of_units_stands_in_brackets_below_a_stroke() -> None:
    assert [f"1/{bracketed(u)}2" for u in ("N", "N m")] == ["1/N2", "1/(N m)2"]
