"""Which finding goes into which file: nothing suggested anywhere, no wind and no sensor's error in the vehicle."""

import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.deliver.files import delivered, entry_of, improved_vehicle, place_of
from tests.unit.mismatch.synthetic import analysis, drag_finding

WIND = Finding(
    id="steady_wind",
    status="established",
    equation="v_air = v − Rᵀ w",
    parameters=(Estimate("w_north", 2.0, "m/s", 1.8, 2.2), Estimate("w_east", 0.0, "m/s", -0.2, 0.2)),
)


def sensor_error(**changes) -> Finding:
    form = next(f for f in catalogue()["gyro_error"].forms(analysis().believed) if f.name.startswith("bias"))
    values = dict(id="gyro_error", status="established", form=form, values=(0.01,) * len(form.parameters))
    return Finding(**(values | changes))


@pytest.mark.parametrize(
    ("effect_id", "place"),
    [
        ("rotor_drag", "vehicle"), ("motor_lag", "vehicle"), ("com_offset", "vehicle"), ("steady_wind", "conditions"),
        ("gust", "conditions"), ("gyro_error", "instruments"), ("accelerometer_error", "instruments"),
        ("clock_skew", "instruments"), ("tare_offset", "instruments"), ("compliance", "instruments"),
        ("wall_interference", "instruments"), ("rotor_order", None), ("unit_error", None),
    ],
)  # fmt: skip
def test_every_finding_has_one_place(effect_id, place):
    assert place_of(Finding(id=effect_id, status="established")) == place


def test_a_delay_of_the_command_is_of_the_vehicle_and_one_of_a_stamp_is_not():
    command = catalogue()["delay"].speed_forms[0]
    of_command = Finding(id="delay", status="established", equation=command.equation, values=(0.02,))
    of_stamps = Finding(id="delay", status="established", equation="written at t: the value of t − T")
    assert place_of(of_command) == "vehicle" and place_of(of_stamps) == "instruments"


def test_a_payload_for_a_time_is_a_condition():
    form = catalogue()["payload"].forms(analysis().believed)[0]
    always = Finding(id="payload", status="established", form=form, values=(0.1,) * len(form.parameters))
    for_a_time = Finding(id="payload", status="established", form=form, windows=(("a", 1.0, 2.0),))
    assert place_of(always) == "vehicle" and place_of(for_a_time) == "conditions"


def test_a_sensor_that_drops_out_for_a_time_is_an_instrument():
    assert place_of(Finding(id="sensor_dropout", status="established", windows=(("a", 1.0, 2.0),))) == "instruments"


def test_nothing_suggested_is_in_any_file():
    made = analysis(findings=[drag_finding(status="suggested"), sensor_error(status="suggested")])
    assert improved_vehicle(made).effects == ()
    assert not any(delivered(made, place) for place in ("vehicle", "conditions", "instruments"))


def test_a_vehicle_holds_no_wind_and_no_error_of_a_sensor():
    made = analysis(findings=[drag_finding(), WIND, sensor_error()])
    assert [e["id"] for e in improved_vehicle(made).effects] == ["rotor_drag"]
    assert [f.id for f in delivered(made, "conditions")] == ["steady_wind"]
    assert [f.id for f in delivered(made, "instruments")] == ["gyro_error"]


def test_of_a_class_one_member_stands_in_the_file_and_is_marked():
    both = ("frame_drag", "rotor_drag")
    weaker = drag_finding(id="frame_drag", status="ambiguous", alternatives=both, p_value=1e-3)
    made = analysis(findings=[weaker, drag_finding(status="ambiguous", alternatives=both)])
    (entry,) = improved_vehicle(made).effects
    assert entry["id"] == "rotor_drag" and entry["one_of"] == ["rotor_drag", "frame_drag"]


def test_what_is_not_in_the_chosen_vehicle_keeps_its_status():
    held = drag_finding(withheld="a plainer vehicle predicts as well")
    assert held.status == "established" and not held.delivered
    assert improved_vehicle(analysis(findings=[held])).effects == ()


def test_an_entry_has_what_the_simulator_needs():
    assert set(entry_of(drag_finding())) == {"id", "form", "parameters"}
