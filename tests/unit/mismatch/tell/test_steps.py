"""What each step takes off the error: one sentence, and which effects would explain a derivative."""

from dataclasses import replace

import pytest

from rotorid.mismatch.decide.findings import Delivery
from rotorid.mismatch.tell.steps import _moved_by, steps_of, steps_sentence, together
from rotorid.report.deliver import verdict_of

from ..synthetic import analysis, drag_finding


def shrunk(model: str, refitted: float, named: float, after: float):
    """A verdict in which every channel's error is a share of the believed vehicle's, far above the noise."""
    made = analysis(findings=[drag_finding()])
    traces = tuple(
        replace(t, before=t.named, refitted=refitted * t.named, named=named * t.named, after=after * t.named)
        for t in made.traces
    )
    floor = {c: 0.05 * f for c, f in made.noise_floor.items()}
    return verdict_of(replace(made, traces=traces, noise_floor=floor, delivery=Delivery(model, True, ())))


def test_the_sentence_has_each_step():
    assert steps_sentence(shrunk("named", 0.65, 0.45, 0.33)) == (
        "On flights not used for fitting, values take 35 % off the errors of the 6 forces and moments on average, "
        "rotor drag another 20 %, 12 % more is "
        "predictable and has no name yet; 33 % is left (noise alone: 5 %)."
    )


def test_values_that_do_not_help_take_nothing_off():
    said = steps_sentence(shrunk("named", 1.05, 0.40, 0.40))
    assert (
        "rotor drag takes 60 % off the errors of the 6 forces and moments on average;" in said and "values" not in said
    )


def with_a_lag(verdict):
    lag = next(e for e in verdict.effects if e.id == "rotor_drag").model_copy(update={"id": "motor_lag"})
    return verdict.model_copy(update={"effects": [*verdict.effects, lag]})


def test_without_rotor_speeds_what_is_between_command_and_speed_is_named_physics():
    said = steps_sentence(with_a_lag(shrunk("named", 0.65, 0.45, 0.45)))
    assert "values take 35 % off the errors of the 6 forces and moments" in said
    assert "rotor drag and the lag of the motors another 20 %" in said


def test_refitted_values_behind_a_path_owe_part_of_what_they_take_to_it():
    said = steps_sentence(with_a_lag(shrunk("refitted", 0.65, 0.45, 0.45)))
    assert "20 % more is predictable: the lag of the motors, and what has no name yet" in said


def test_a_class_is_named_as_one_of_its_members():
    verdict = shrunk("named", 0.65, 0.45, 0.45)
    members = ("frame_drag", "ground_effect", "rotor_drag")
    drag = verdict.effects[0].model_copy(update={"status": "ambiguous", "alternatives": members})
    said = steps_sentence(verdict.model_copy(update={"effects": [drag]}))
    assert "rotor drag, drag of the airframe or ground effect another 20 %" in said


def test_what_is_not_delivered_takes_nothing_off():
    whole = together(steps_of(shrunk("refitted", 0.65, 0.45, 0.50).channels, "refitted"))
    assert (whole.values, whole.named, whole.delivered) == pytest.approx((0.65, 0.65, 0.50), abs=1e-4)


@pytest.mark.parametrize(
    ("effect", "derivative"),
    [
        ("rotor_drag", ("force_x", "u")),
        ("rotational_damping", ("moment_z", "r")),
        ("axial_inflow", ("force_z", "w")),
        ("flapping_moment", ("moment_y", "u")),
        ("com_offset", ("moment_x", "constant")),
    ],
)
def test_an_effect_makes_the_derivatives_that_it_is_known_for(effect, derivative):
    assert derivative in _moved_by()[effect] and ("force_x", "q") not in _moved_by()[effect]
