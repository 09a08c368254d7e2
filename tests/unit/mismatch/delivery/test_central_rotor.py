"""A vehicle of one central rotor, of which the collective alone is known."""

from pathlib import Path

import numpy as np
import pytest

from rotorid.cli.modelling import fly
from rotorid.errors import InputError
from rotorid.mismatch.delivery.final import delivered_value
from rotorid.mismatch.delivery.usable import full_thrust_n
from rotorid.recordings import RecordingSet, Run, read_set, templates
from rotorid.recordings import columns as c
from rotorid.report.deliver import analysis_of
from rotorid.vehicle.mixer import allocation_matrix

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
