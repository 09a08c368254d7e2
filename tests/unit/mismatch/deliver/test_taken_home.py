"""What is taken home of recordings: it hovers, it flies, and no channel is worse where it was not fitted.

A handful of sets of every kind of finding, each analysed once. `snakemake delivered` asks the same of all sets.
"""

from dataclasses import replace
from functools import cache

import pytest
from scipy.spatial.transform import Rotation

from rotorid.cli import verdicts
from rotorid.cli.modelling import fly
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.deliver.files import delivered, improved_vehicle
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.recordings import RecordingSet, Vehicle, templates, write_set, write_vehicle
from rotorid.recordings import columns as c
from rotorid.report.deliver import analysis_of, verdict_of, write_files
from rotorid.vehicle.control import swings
from rotorid_proof.delivered import row_of
from tests.command_line import answer, invoke
from tests.unit.mismatch.flights import QUAD, quad, recorded, with_table

LIMITS = {"rotor_speed_limits_rad_s": (0.0, 1800.0)}


def flown(name: str, *effects: tuple[str, str, dict[str, float]], seconds: float = 8.0) -> RecordingSet:
    """Two flights of the thesis's vehicle with these effects under an attitude controller, as `simulate` makes them."""
    entries = tuple({"id": i, "form": f, "parameters": p} for i, f, p in effects)
    return swings(templates.read("thesis").model_copy(update={"effects": entries, **LIMITS}), name, seconds, 2, 1)


def pushed(table):
    """An accelerometer that reads 0.4 m/s² too much forward."""
    return table.assign(specific_force_x_m_s2=table["specific_force_x_m_s2"] + 0.4)


def turned(table):
    """A gyroscope that is mounted 3 degrees off about the roll axis."""
    names = list(c.ANGULAR_VELOCITY)
    table[names] = Rotation.from_euler("x", 3, degrees=True).apply(table[names].to_numpy(copy=True))
    return table


def weak_pitch() -> Vehicle:
    inertia = QUAD["inertia_kg_m2"]
    return quad(inertia_kg_m2=inertia | {"yy": 1.5 * inertia["yy"]}, **LIMITS)


CURVE = ("throttle_curve", "thrust curve of the throttle", {"b": 0.3})
WINDY = {"drag": 0.35, "wind": (3.0, 1.0), "duration_s": 15}
SETS = {
    "drag": lambda: flown("drag", ("rotor_drag", "at the hubs", {"k_d": 6e-5})),
    "chain": lambda: flown("chain", ("motor_lag", "one constant", {"tau": 0.05}), CURVE),
    "air": lambda: with_table(recorded(1, 2, flight=WINDY, vehicle=quad(**LIMITS)), pushed),
    "mass": lambda: recorded(17, 18, flight={"drag": 0.0115, "duration_s": 12}, vehicle=quad(mass_kg=0.5, **LIMITS)),
    "gyroscope": lambda: with_table(recorded(5, 6, flight={"duration_s": 10}, vehicle=quad(**LIMITS)), turned),
    "pitch": lambda: recorded(7, 8, flight={"drag": 0.02, "duration_s": 12}, vehicle=weak_pitch()),
}
"""Name to a set in which something is off: an effect, the command's path, air and sensor, a value, a sensor, both."""


@cache
def taken(name: str) -> tuple[RecordingSet, Analysis, Verdict]:
    """A set, its analysis and its verdict, made once."""
    recordings = SETS[name]()
    analysis = analysis_of(recordings)
    return recordings, analysis, verdict_of(analysis)


@pytest.mark.parametrize("name", SETS)
def test_what_is_delivered_hovers_flies_and_makes_nothing_worse(name):
    row = row_of(*taken(name))
    assert row["channels_worse"] == 0 and row["held_out_after"] <= min(1.0, row["held_out_refitted"])
    # Noise averages out over half a second, what is left of physics does not.
    assert 0 < row["half_second_after"] <= 1.05 * row["half_second_refitted"]
    assert [row[key] for key in ("unfit", "not_flown_by", "failed")] == ["", "", ""]
    assert row["verdict"] in ("explained", "partly_explained")


@pytest.mark.parametrize("name", SETS)
def test_the_simulator_runs_the_file_as_it_stands(name, tmp_path):
    said = []
    fly(improved_vehicle(taken(name)[1]), tmp_path / "flown", 2.0, 1, 1, said.append)
    assert said == []


@pytest.mark.parametrize("name", SETS)
def test_a_channel_that_is_worse_on_the_runs_held_out_is_a_warning(name):
    verdict = taken(name)[2]
    for channel in verdict.channels.values():
        errors = channel.rmse.held_out
        least = min(errors.before, errors.refitted)
        if errors.after > max(1.02 * least, channel.noise_floor or 0.0):
            assert verdict.warnings
    assert all(text.startswith("On the held-out runs the error of the ") for text in verdict.warnings)


def test_what_is_only_suggested_is_in_no_file_and_counts_in_no_figure():
    """Of a vehicle whose mass is wrong a drag that is hardly there is suggested."""
    _, analysis, verdict = taken("mass")
    assert [(e.id, e.status, e.delivered) for e in verdict.effects] == [("rotor_drag", "suggested", False)]
    assert not any(delivered(analysis, place) for place in ("vehicle", "conditions", "instruments"))
    assert not improved_vehicle(analysis).effects and not analysis.winds
    assert improved_vehicle(analysis).mass_kg == pytest.approx(0.652, rel=0.01)
    assert verdict.channels["position"].rmse.held_out.after < 0.2 * verdict.channels["position"].rmse.held_out.before


def test_a_wind_and_an_error_of_a_sensor_are_no_properties_of_the_vehicle():
    _, analysis, verdict = taken("air")
    assert [e["id"] for e in improved_vehicle(analysis).effects] == ["rotor_drag"]
    assert [f.id for f in delivered(analysis, "conditions")] == ["steady_wind"]
    assert [f.id for f in delivered(analysis, "instruments")] == ["accelerometer_error"]
    for name in ("position", "velocity", "attitude"):
        errors = verdict.channels[name].rmse.held_out
        assert errors.after <= 1.02 * errors.before
    assert verdict.channels["velocity"].rmse.held_out.after < 0.6 * verdict.channels["velocity"].rmse.held_out.before
    assert [f.id for f in delivered(taken("gyroscope")[1], "instruments")] == ["gyro_error"]
    assert not improved_vehicle(taken("gyroscope")[1]).effects


def test_a_fault_of_the_run_that_is_held_out_moves_no_value_of_the_file():
    """A tachometer at fault in the run that is held out asks for 36 % more thrust there, and there alone."""
    names = list(c.rotor_columns("rotor_speed", 4))
    sound = recorded(1, 2, 3, 4, flight={"duration_s": 10, "drag": 0.35}, vehicle=quad(**LIMITS))
    faulty = with_table(replace(sound, runs=sound.runs[2:3]), lambda t: t.assign(**(t[names] * 0.8)))
    analysis = analysis_of(replace(sound, runs=(*sound.runs[:2], *faulty.runs, sound.runs[3])))
    assert analysis.split.held_out == ("run02",)
    errors = verdict_of(analysis).channels["force_z"].rmse.held_out
    assert improved_vehicle(analysis).thrust_coefficient_n_s2 == pytest.approx(1.3877e-6, rel=0.02)
    assert errors.after <= 1.02 * errors.before


def test_an_export_takes_the_lag_that_was_found(tmp_path):
    write_vehicle(improved_vehicle(taken("chain")[1]), tmp_path / "v.yaml")
    answer("export", tmp_path / "v.yaml", "--to", "rotorpy", "-o", tmp_path / "p.py")
    content: dict = {}
    exec((tmp_path / "p.py").read_text(), content)
    assert content["quad_params"]["tau_m"] == pytest.approx(0.05, rel=0.1)


def test_a_warning_is_on_the_page_on_the_screen_and_in_the_file(tmp_path, monkeypatch):
    recordings, analysis, verdict = taken("gyroscope")
    (warning,) = verdict.warnings
    folder = write_set(recordings, tmp_path)

    def deliver(folder, target, series=False):
        target.mkdir()
        return write_files(analysis, target)

    monkeypatch.setattr(verdicts, "write_verdict", deliver)
    said = answer("verdict", folder, "-q", "-o", tmp_path / "out")
    assert f"! {warning}" in said.splitlines() and verdict.sentence in said.splitlines()
    assert said.splitlines()[0] == verdict.basis.sentence
    assert warning in (tmp_path / "out" / "verdict.json").read_text()
    assert warning in (tmp_path / "out" / "report.html").read_text()


def test_the_first_sentence_goes_by_size_and_not_by_significance():
    """A drag that is significant pushes by thousandths of the weight; a wrong inertia is what a pilot would feel."""
    _, _, verdict = taken("pitch")
    first, *_ = verdict.sentence.split(";")
    assert "pitch moment" in first and "m after 0.5 s simulated" in first
    force = verdict.channels["force_x"].rmse.held_out.before / (0.652 * 9.81)
    assert verdict.size.channel == "moment_y" and force < 0.5 * verdict.size.share


def xyzw(table):
    """The scalar part of the quaternion last."""
    names = list(c.QUATERNION)
    table[names] = table[[*names[1:], names[0]]].to_numpy(copy=True)
    return table


def z_up(table):
    """A world whose second axis points west and whose third points up."""
    for name in ("position_y_m", "velocity_y_m_s", "position_z_m", "velocity_z_m_s"):
        table[name] = -table[name]
    return table


def as_given(name: str, mistake) -> Verdict:
    return verdict_of(analysis_of(with_table(taken(name)[0], mistake)))


def test_a_set_with_the_scalar_last_is_not_judged():
    """Axes of the gyroscope and rotors can be exchanged so that all agree; what is left says that it is not so."""
    verdict = as_given("gyroscope", xyzw)
    assert verdict.verdict == "not_judged" and verdict.sentence.startswith("Not judged.")
    assert any(d.stops and d.what.startswith("angular_velocity") for d in verdict.doubts)


def test_an_axis_that_the_analysis_corrected_is_a_doubt_no_more():
    verdict = as_given("air", z_up)
    (doubt,) = [d for d in verdict.doubts if d.what == "velocity_y_m_s"]
    assert "world axes" in doubt.sentence and "The analysis found and corrected this" in doubt.sentence
    assert not doubt.stops and verdict.verdict == "explained"
    assert {e.id for e in verdict.effects if e.status == "established"} >= {"axis_sign", "rotor_drag"}


def test_values_that_were_only_proposed_are_said_before_the_verdict(tmp_path):
    recordings, _, _ = taken("mass")
    folder = write_set(recordings, tmp_path)
    text = (folder / "vehicle.yaml").read_text()
    proposed = "   # PROPOSED: template x500"
    lines = [line + (proposed if line.startswith("mass_kg") else "") + "\n" for line in text.splitlines()]
    (folder / "vehicle.yaml").write_text("".join(lines))
    done = invoke("verdict", folder, "-q", "-o", tmp_path / "out")
    assert "! mass_kg is only proposed (template x500)." in done.output.splitlines()
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.index("mass_kg is only proposed") < page.index("<h1>")
