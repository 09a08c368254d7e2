"""Numbers of effects refer to the vehicle that is delivered, not to the one that was believed."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.analyse import analyse
from rotorid.mismatch.deliver.by_vehicle import acting_over_rows, on_vehicle
from rotorid.mismatch.evidence.rows import Term
from rotorid.mismatch.flight.prepare import prepare
from rotorid.recordings import templates
from rotorid.vehicle.control import swings
from tests.unit.mismatch.flights import as_commands, recorded, with_table

NOISE = np.ones(12)
DRAG = {"id": "rotor_drag", "form": "at the centre of mass", "parameters": {"k_d": 1e-4}}


@pytest.fixture(scope="module")
def flown():
    """A five-inch quadrotor with drag, as sensors record its swings."""
    vehicle = templates.read("five-inch").model_copy(update={"effects": (DRAG,)})
    return swings(vehicle, "swings", 20.0, 3, 0)


def term_of(effect: str, form: str, vehicle) -> Term:
    own = next(f for f in catalogue()[effect].forms(vehicle) if f.name == form)
    return Term(f"{effect}/{form}", "effect", effect, own, tuple(0.0 for _ in own.parameters), len(own.linear))


LARGER = {f"inertia_{axis}{axis}": (0.1, 0.0) for axis in "xyz"}


@pytest.mark.parametrize(
    ("effect", "form", "changed", "factor"),
    [
        pytest.param("rotor_drag", "at the centre of mass", {"mass": (-0.2, 0.01)}, 0.8, id="drag by mass"),
        pytest.param("rotor_drag", "at the centre of mass", {"thrust": (0.1, 0.01)}, 1.0, id="drag not by thrust"),
        pytest.param("rotational_damping", "linear", LARGER, 1.1, id="damping by inertia"),
        pytest.param("unequal_rotors", "thrust", {"thrust": (0.1, 0.01)}, 1 / 1.1, id="a share of a larger thrust"),
    ],
)
def test_coefficients_grow_with_what_they_accelerate_and_shrink_with_what_they_refer_to(
    flown, effect, form, changed, factor
) -> None:
    prepared = prepare(flown)
    larger, _ = on_vehicle(term_of(effect, form, prepared.vehicle), prepared.segments, prepared.vehicle, changed, NOISE)
    np.testing.assert_allclose(larger, factor, rtol=1e-6)


def test_the_doubt_of_a_mass_is_in_the_drag(flown) -> None:
    prepared = prepare(flown)
    term = term_of("rotor_drag", "at the centre of mass", prepared.vehicle)
    _, doubt = on_vehicle(term, prepared.segments, prepared.vehicle, {"mass": (-0.2, 0.01)}, NOISE)
    np.testing.assert_allclose(doubt, 0.01, rtol=1e-6)


def test_force_and_moment_are_larger_by_mass_and_inertia() -> None:
    believed = templates.read("five-inch")
    inertia = believed.inertia_kg_m2
    delivered = believed.model_copy(
        update={"mass_kg": 1.2 * believed.mass_kg, "inertia_kg_m2": inertia.model_copy(update={"zz": 0.9 * inertia.zz})}
    )
    np.testing.assert_allclose(acting_over_rows(believed, delivered), [1.2, 1.2, 1.2, 1.0, 1.0, 0.9])


@pytest.mark.parametrize("wrong", [0.8, 1.25])
def test_a_wrong_mass_does_not_spoil_the_drag(flown, wrong: float) -> None:
    """Before: mass right, and a drag that is off by as much as the mass was."""
    believed = flown.vehicle.model_copy(update={"mass_kg": wrong * flown.vehicle.mass_kg})
    found = analyse(replace(flown, vehicle=believed))
    drag = next(f for f in found.findings if f.id == "rotor_drag")
    k_d = next(p for p in drag.parameters if p.symbol == "k_d")
    assert found.improved.mass_kg == pytest.approx(flown.vehicle.mass_kg, rel=0.01)
    assert k_d.low < 1e-4 < k_d.high
    assert k_d.value == pytest.approx(1e-4, rel=0.02)


def test_a_wrong_mass_is_one_wrong_value_where_commands_alone_are_recorded() -> None:
    """Before: a scale of the rotors' distances and a torque coefficient that were off by as much as the mass was."""
    flown = with_table(recorded(1, 2, 3, rate_hz=100.0), as_commands)
    true = flown.vehicle
    found = analyse(replace(flown, vehicle=true.model_copy(update={"mass_kg": true.mass_kg / 1.18})))
    _, mass_kg, low, high = found.values["mass_kg"]
    assert list(found.values) == ["mass_kg"] and low < true.mass_kg < high
    assert (mass_kg, found.improved.mass_kg) == pytest.approx((true.mass_kg, true.mass_kg), rel=0.01)
    # The commands are the speeds here: what lifts the vehicle is its true thrust.
    made, wanted = (v.thrust_coefficients_n_s2() for v in (found.improved, true))
    np.testing.assert_allclose(made, wanted, rtol=0.01)
