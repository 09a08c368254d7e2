"""From an analysis to its files: the improved vehicle holds the model, the page needs no other file."""

import math
import re
from dataclasses import replace

import pytest

from rotorid.mismatch.deliver.files import improved_vehicle
from rotorid.mismatch.deliver.flown import model_of
from rotorid.mismatch.tell.forward import delivered_model, forward_channels, prove
from rotorid.recordings import read_vehicle, write_vehicle
from rotorid.report.deliver import write_files
from tests.unit.mismatch.synthetic import HOVER, K_D, SPEED_M_S, analysis, drag_finding


def test_the_improved_vehicle_comes_back_with_its_effect(tmp_path):
    made = analysis(findings=[drag_finding()])
    write_vehicle(improved_vehicle(made), tmp_path / "v.yaml")
    model = model_of(read_vehicle(tmp_path / "v.yaml"))
    ((form, values),) = model.forms
    assert (form.name, list(values)) == ("at the centre of mass", [K_D])


def test_an_effect_between_command_and_speed_comes_back(tmp_path):
    from rotorid.effects.catalogue import catalogue

    form = catalogue()["motor_lag"].speed_forms[0]
    lag = drag_finding(id="motor_lag", form=None, equation=form.equation, values=tuple(form.neutral))
    write_vehicle(improved_vehicle(analysis(findings=[lag])), tmp_path / "v.yaml")
    model = model_of(read_vehicle(tmp_path / "v.yaml"))
    assert [(i, f.name) for i, f in model.chain] == [("motor_lag", form.name)]
    assert model.chain_values == tuple(map(float, form.neutral))


def test_forward_errors_are_those_computed_by_hand():
    """At a steady 5 m/s, level, at hover speed the plain model is exact; one with drag slows down by a known amount."""
    made = analysis(findings=[drag_finding()])
    runs = tuple(
        replace(r, table=r.table.assign(velocity_x_m_s=5.0, position_x_m=5.0 * r.time_s)) for r in made.recordings.runs
    )
    channels, _ = forward_channels(replace(made, recordings=replace(made.recordings, runs=runs)))
    velocity = channels["velocity"].rmse.held_out
    assert velocity.before == pytest.approx(0, abs=1e-6)
    # dv = a t with a = K_D · 4 ω · v / m; steps of 10 ms to 0.5 s: the mean of t² is 0.5² · 51 · 101 / (6 · 50²).
    slowing = K_D * 4 * HOVER * SPEED_M_S / 0.652
    assert velocity.after == pytest.approx(slowing * 0.5 * math.sqrt(51 * 101 / (6 * 50**2)), rel=0.1)
    assert channels["attitude"].rmse.held_out.after == pytest.approx(0, abs=1e-6)


def test_a_vehicle_that_is_not_the_model_is_refused():
    made = analysis(findings=[drag_finding()])
    forward = forward_channels(made)
    prove(made, delivered_model(made), *forward)
    wrong = replace(made, findings=(drag_finding(values=(2 * K_D,)),))
    with pytest.raises(RuntimeError, match="improved_vehicle.yaml"):
        prove(made, delivered_model(wrong), *forward)


@pytest.mark.parametrize(
    ("findings", "shown"),
    [
        ((), "no mismatch"),
        ((drag_finding(),), "mismatch, explained"),
        ((drag_finding(status="ambiguous", alternatives=("frame_drag", "rotor_drag")),), "cannot distinguish them"),
    ],
)
def test_the_page_is_whole_and_the_same_twice(tmp_path, findings, shown):
    made = analysis(findings=findings, dash=bool(findings))
    for name in ("one", "two"):
        out = tmp_path / name
        verdict = write_files(made, out)
    page = (tmp_path / "one" / "report.html").read_text()
    assert page == (tmp_path / "two" / "report.html").read_text()
    assert shown in page
    assert not re.search(r'(?:src|href)="(?!data:)', page)
    headings = ("What was left out", "Where", "How much better", "Ruled out", "Could not be tested", "What to fly next")
    for heading in headings:
        assert f"<h2>{heading}</h2>" in page
    assert "no height above ground" in page
    assert verdict.set == "made"
