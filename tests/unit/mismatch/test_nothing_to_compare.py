"""What is said where nothing of the runs held out can be compared, and how little is asked of a set of many runs."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from rotorid.mismatch import analyse as module
from rotorid.mismatch.flight.every_run import comparable, lacking
from rotorid.recordings import RecordingSet, templates
from rotorid.vehicle.control import swings
from tests.refusals import refused

OF_SEGMENT = ("command", "kinematic_specific_force", "kinematic_angular_velocity")
OF_MOTION = (
    "rotor_speed", "specific_force", "accelerometer", "angular_velocity", "gyroscope", "rotation", "velocity", "height",
    "voltage",
)  # fmt: skip


def stretch(*missing: str) -> SimpleNamespace:
    motion = SimpleNamespace(**{n: None if n in missing else n for n in OF_MOTION})
    return SimpleNamespace(motion=motion, **{n: None if n in missing else n for n in OF_SEGMENT})


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> RecordingSet:
    monkeypatch.setattr(module, "find_mistakes", lambda recordings: (recordings, (), ()))
    made = swings(templates.read("thesis"), "flight", 4.0, 1, 3)
    run = made.runs[0]
    return replace(made, runs=tuple(replace(run, name=f"r{k}") for k in range(4)))


def test_what_a_stretch_lacks_is_named() -> None:
    assert comparable(stretch("height"), stretch("height"))
    assert lacking(stretch("gyroscope", "rotation"), stretch("height")) == ("gyroscope", "attitude")


def test_the_sensor_that_is_missing_is_named(flights: RecordingSet, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(recordings, *_):
        held = module.split_runs(recordings).held_out
        raise module._NothingToCompare(held, ("gyroscope", "attitude"))

    monkeypatch.setattr(module, "_analysed", nothing)
    said = refused(None, module.analyse, flights)
    assert "lacks gyroscope and attitude in flight" in said and "r" in said and "\n" not in said
    monkeypatch.setattr(module, "_analysed", lambda *_: (_ for _ in ()).throw(module._NothingToCompare(("r1",), ())))
    assert "r1 has no stretch of flight in which all sensors read" in refused(None, module.analyse, flights)


def test_runs_are_not_split_once_for_each_of_them(flights: RecordingSet, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: 500 times for 500 runs, each of which looks at 500 choices."""
    asked = []
    monkeypatch.setattr(module, "_analysed", lambda *_: "analysis")
    monkeypatch.setattr(module, "split_runs", lambda *_: asked.append(1))
    assert module.analyse(flights) == "analysis" and len(asked) < 2
