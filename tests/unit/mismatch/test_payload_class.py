"""A centre of mass off its place may be a payload where the vehicle is heavier than believed."""

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.analyse import payload_or_offset
from rotorid.mismatch.decide.findings import Finding
from tests.unit.mismatch.flights import quad

OFFSET = Finding(id="com_offset", status="established")
PRODUCTS = Finding(id="inertia_products", status="established")
DRAG = Finding(id="rotor_drag", status="established")


def classes(values: dict[str, tuple[float, float]], *findings: Finding) -> dict[str, tuple[str, ...]]:
    """Alternatives of each id where values changed by relative amounts with one-sigmas."""
    return {f.id: f.alternatives for f in payload_or_offset(list(findings), values)}


def test_an_offset_of_a_heavier_vehicle_may_be_a_payload_and_so_may_its_products_of_inertia():
    found = classes({"mass": (0.014, 0.002)}, OFFSET, PRODUCTS, DRAG)
    assert found["com_offset"] == ("com_offset", "payload")
    assert found["inertia_products"] == ("inertia_products", "payload") and found["rotor_drag"] == ()


def test_thrust_that_is_missing_is_weight_as_well():
    assert classes({"thrust": (-0.013, 0.003)}, OFFSET)["com_offset"] == ("com_offset", "payload")


def test_a_vehicle_that_is_not_surely_heavier_carries_none():
    for values in ({}, {"mass": (-0.02, 0.002)}, {"mass": (0.08, 0.05)}, {"thrust": (-0.09, 0.06)}):
        assert classes(values, OFFSET)["com_offset"] == ()


def test_without_an_offset_there_is_no_question():
    assert classes({"mass": (0.05, 0.002)}, PRODUCTS) == {"inertia_products": ()}


def test_a_load_shows_its_mass_however_it_hangs():
    """What swings and weighs nothing is a disturbance that comes and goes."""
    assert all(form.must_show == (0,) for form in catalogue()["payload"].forms(quad()))
