"""The table of what is delivered: a file that is not written for a tool is no flight that failed there."""

import pytest

from rotorid_proof import delivered
from rotorid_proof.delivered import COLUMNS, not_flown_by, refused_by, table
from tests.unit.vehicle.test_exports import FLAT, six_rotors, with_effects


def test_what_a_tool_does_not_take_is_told_from_what_it_does_not_fly():
    assert set(refused_by(FLAT)) == {"mjcf", "sdf"} and set(refused_by(six_rotors())) == {
        "rotorpy",
        "gym-pybullet-drones",
    }
    assert refused_by(with_effects()) == {} and not_flown_by(FLAT) == []


def test_an_engine_that_refuses_a_file_is_named(monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr(delivered, "refused_by", lambda vehicle: {"rotorpy": "", "gym-pybullet-drones": ""})
    monkeypatch.setattr("rotorid.vehicle.exports.refusal", lambda *asked: "")
    (said,) = not_flown_by(FLAT)
    assert said.startswith("mjcf (MuJoCo does not read the exported vehicle")


def test_rows_of_all_files_stand_in_one_table(tmp_path):
    (tmp_path / "a.json").write_text('[{"set": "a", "kind": "flight"}, {"set": "b", "failed": "too short"}]')
    found = table([tmp_path / "a.json"])
    assert tuple(found.columns) == COLUMNS and found["failed"].tolist() == ["", "too short"]
