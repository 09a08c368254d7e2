"""A delivered vehicle is a body that hovers and flies. A vehicle of one central rotor, of which the collective alone is
known.
"""

import inspect
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.cli.modelling import fly, simulate
from rotorid.errors import InputError
from rotorid.mismatch.decide.values import changed_vehicle
from rotorid.mismatch.deliver import usable
from rotorid.mismatch.deliver.final import delivered_value
from rotorid.mismatch.deliver.usable import (
    as_a_body,
    cannot_fly,
    cannot_hover,
    exports_lost,
    full_thrust_n,
    no_body,
    question_of,
    recorded_share,
)
from rotorid.recordings import RecordingSet, Run, read_set, templates
from rotorid.recordings import columns as c
from rotorid.recordings.vehicle import Derivative
from rotorid.report.deliver import analysis_of
from rotorid.vehicle.control import FLIGHTS, SECONDS, SEED
from rotorid.vehicle.mixer import allocation_matrix
from tests.unit.vehicle.thesis import thesis_vehicle

LIMITS = {"rotor_speed_limits_rad_s": (0.0, 1600.0)}


def vehicle(**changes):
    return thesis_vehicle().model_copy(update=LIMITS | changes)


def test_full_thrust_is_that_of_all_rotors_at_their_limit():
    assert full_thrust_n(vehicle()) == pytest.approx(4 * 1.3877e-6 * 1600**2)
    assert full_thrust_n(thesis_vehicle().model_copy(update={"rotor_speed_limits_rad_s": None})) is None


def test_a_thrust_coefficient_below_the_weight_cannot_hover():
    """A maximum thrust of 0.72 of the weight, as one improved vehicle had."""
    weak = vehicle(thrust_coefficient_n_s2=0.72 * 0.652 * 9.81 / (4 * 1600**2))
    assert "full thrust is 4.61 N for a weight of 6.4 N" in cannot_hover(weak, 0.0)
    assert cannot_hover(vehicle(), 0.0) == ""


def constant(value: float):
    """A constant vertical force among the derivatives, N."""
    known = {"channel": "force_z", "quantity": "constant", "unit": "N", "interval_95": (value, value)}
    return (Derivative(**known, value=value, low=1.0, high=1.0),)


def test_a_constant_of_the_derivatives_is_a_trim_and_lifts_nothing():
    """Weight 6.4 N: 0.5 N are a trim, 5 N hold a vehicle whose rotors do not."""
    asked, _ = question_of(vehicle(), ())
    assert asked(vehicle(derivatives=constant(-0.5))) == ""
    assert "constant force_z of -5 N, 78 % of its weight" in asked(vehicle(derivatives=constant(-5.0)))
    weak = vehicle(thrust_coefficient_n_s2=0.95 * 0.652 * 9.81 / (4 * 1600**2), derivatives=constant(-0.6))
    assert "full thrust is 6.08 N" in asked(weak)


def test_a_vehicle_recorded_near_its_full_thrust_may_hover_there():
    tight = vehicle(thrust_coefficient_n_s2=1.05 * 0.652 * 9.81 / (4 * 1600**2))
    assert cannot_hover(tight, 0.0) and cannot_hover(tight, 0.96) == ""


def test_an_effect_that_takes_the_thrust_away_is_seen():
    curve = {"id": "command_saturation", "form": "upper limit", "parameters": {"w_high": 0.6}}
    slow = vehicle(effects=(curve,))
    assert full_thrust_n(slow) == pytest.approx(0.36 * full_thrust_n(vehicle())) and cannot_hover(slow, 0.0)


def test_the_recorded_share_needs_no_coefficient():
    speed = np.full((400, 4), 0.5 * 1600.0)
    speed[:100] = 100.0  # on the ground
    table = pd.DataFrame(speed, columns=[f"rotor_speed_{i}_rad_s" for i in range(1, 5)]).assign(
        time_s=np.arange(400) / 100
    )
    assert recorded_share([Run("a", table)], vehicle()) == pytest.approx(0.25)


@pytest.mark.parametrize("factor", [1e-4, 100.0])
def test_an_inertia_is_that_of_the_body(factor):
    j = thesis_vehicle().inertia_kg_m2
    wrong = vehicle(inertia_kg_m2=j.model_copy(update={k: getattr(j, k) * factor for k in ("xx", "yy", "zz")}))
    assert "radius of gyration" in no_body(wrong) and no_body(vehicle()) == ""


@pytest.mark.parametrize("stated", ["", "inertia_zz", "inertia_xx"])
def test_what_is_known_as_a_ratio_alone_is_split_into_that_of_a_body(stated):
    """A yaw inertia three times too large for the others: predicted motion stays, one of the two groups gives way."""
    believed = vehicle()
    moved = {"inertia_zz": (2.0, 0.1), "inertia_xx": (-0.1, 0.02), "mass": (0.01, 0.002)}
    values = {stated: moved.pop(stated)} if stated else {}
    before = changed_vehicle(believed, {k: v for k, (v, _) in {**moved, **values}.items()})
    assert "of no body" in no_body(before)
    split = as_a_body(believed, values, moved)
    after = changed_vehicle(believed, {k: v for k, (v, _) in {**split, **values}.items()})
    assert no_body(after) == "" and not set(split) & set(values)

    def accelerates(v):
        arm, inertia = np.abs(v.rotor_positions_m()).max(), v.inertia_kg_m2
        return [arm / inertia.xx, arm / inertia.yy, v.torque_coefficient_n_m_s2 / inertia.zz, v.mass_kg]

    np.testing.assert_allclose(accelerates(after), accelerates(before), rtol=1e-9)


def test_a_body_stays_as_it_is_and_nothing_is_split_about_values_that_are_called_wrong():
    believed, sound = vehicle(), {"inertia_zz": (0.05, 0.01)}
    assert as_a_body(believed, {}, sound) == sound
    wrong = {"inertia_zz": (2.0, 0.1), "inertia_xx": (-0.1, 0.1)}
    assert as_a_body(believed, wrong, {}) == {}


def test_no_rotor_is_better_than_an_ideal_one():
    known = vehicle(rotor_radius_m=0.0635)
    better = known.model_copy(update={"torque_coefficient_n_m_s2": 1.8558e-9})
    assert no_body(known) == "" and "figure of merit of 5" in no_body(better)


def test_it_flies_under_the_projects_controller_and_one_that_cannot_is_said():
    assert cannot_fly(vehicle()) == ""
    still = vehicle(torque_coefficient_n_m_s2=1.8558e-8, rotor_speed_limits_rad_s=(0.0, 900.0))
    tilted = {"id": "com_offset", "form": "moment", "parameters": {"r_x": 0.08, "r_y": 0.0}}
    assert cannot_fly(still.model_copy(update={"effects": (tilted,)}))


def test_what_the_believed_vehicle_fails_itself_is_not_asked_of_another():
    weak = vehicle(thrust_coefficient_n_s2=0.72 * 0.652 * 9.81 / (4 * 1600**2))
    question, faults = question_of(weak, ())
    sound, none = question_of(vehicle(), ())
    assert question(weak) == "" and sound(weak)
    assert "full thrust is 4.61 N" in faults[0] and none == ()


def test_a_vehicle_that_turns_over_late_is_caught(monkeypatch):
    """Two seconds of swings do not turn over what the flights of `rotorid simulate` do."""
    tipping = {"id": "flapping_moment", "form": "at the hubs", "parameters": {"k_flap": -1e-5}}
    late = vehicle(effects=(tipping,))  # the faster it flies, the more it leans into it
    assert "turns over" in cannot_fly(late)
    monkeypatch.setattr(usable, "SECONDS", 2.0)
    assert cannot_fly(late) == ""


@pytest.mark.parametrize("over_weight", [1.12, 1.4])
def test_a_sound_vehicle_with_little_to_spare_is_not_turned_over_by_its_pilot(over_weight):
    """An x500, as proposed for a Copter's log, turned over: a yaw that its rotors could not make took the rest."""
    made = templates.read("x500")
    full = np.sqrt(over_weight * made.mass_kg * made.gravity_m_s2 / made.thrust_coefficients_n_s2().sum())
    assert cannot_fly(made) == ""
    assert cannot_fly(made.model_copy(update={"rotor_speed_limits_rad_s": (0.0, float(full))})) == ""


def test_the_trial_is_the_flight_that_is_simulated_of_the_file():
    asked = inspect.signature(simulate).parameters
    assert [asked[name].default for name in ("seconds", "flights", "seed")] == [SECONDS, FLIGHTS, SEED]


def test_an_export_that_the_estimates_cost_is_said_and_the_vehicle_stays():
    """A flat vehicle's yaw inertia estimated 3 % too large is a body with an error; MuJoCo takes none such."""
    j = thesis_vehicle().inertia_kg_m2
    flat = vehicle(inertia_kg_m2=j.model_copy(update={"zz": 1.03 * (j.xx + j.yy)}))
    assert no_body(flat) == "" and exports_lost(vehicle(), vehicle()) == ()
    said = exports_lost(flat, vehicle())
    assert [s.split(":")[0] for s in said] == [
        f"The improved vehicle cannot be exported as {f}" for f in ("mjcf", "sdf")
    ]
    assert exports_lost(flat, flat) == ()


FULL_RAD_S = 1500.0


def central(folder: Path) -> RecordingSet:
    """A flight of the thesis quadrotor as that of one rotor in the middle with the four's thrust."""
    flown = read_set(fly(templates.read("thesis"), folder / "flight", 14.0, 1, 1))
    vehicle, (run,) = flown.vehicle, flown.runs
    rotor = vehicle.rotors[0].model_copy(update={"x_m": 0.0, "y_m": 0.0})
    own = {
        "rotors": (rotor,),
        "thrust_coefficient_n_s2": 4 * vehicle.thrust_coefficient_n_s2,
        "torque_coefficient_n_m_s2": 4 * vehicle.torque_coefficient_n_m_s2,
        "rotor_radius_m": None,
        "rotor_speed_limits_rad_s": (0.0, FULL_RAD_S),
    }
    names = list(c.rotor_columns("rotor_command", 4))
    table = run.table.drop(columns=[n for n in run.table if n.startswith("rotor_")])
    table["throttle_1"] = np.sqrt((run.table[names] ** 2).mean(axis=1)) / FULL_RAD_S
    return RecordingSet("central", vehicle.model_copy(update=own), (Run(run.name, table),))


def test_one_central_rotor_is_judged_and_what_cannot_be_is_said(tmp_path: Path) -> None:
    made = central(tmp_path)
    with pytest.raises(InputError):
        allocation_matrix(made.vehicle)
    assert full_thrust_n(made.vehicle) is None
    assert delivered_value(made.vehicle, made.vehicle, "arm") == 1.0
    analysis = analysis_of(made)
    assert "its 1 rotor cannot set thrust, roll, pitch and yaw independently" in " ".join(analysis.notes), (
        analysis.notes
    )
