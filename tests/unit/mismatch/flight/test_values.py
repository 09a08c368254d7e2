"""Wrong believed values: the fewest that explain the residual, only where they are certain and matter. What is said
about a believed value where something beside it would make up for it.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.decide.select import Selection
from rotorid.mismatch.decide.selected import SMALLEST_CHANGE, main_channels, relative_change, wrong_values
from rotorid.mismatch.decide.values import with_values_in_question
from rotorid.mismatch.evidence.regression import build
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.flight.values import with_square_term, with_thrust_per_command
from tests.unit.mismatch import synthetic
from tests.unit.mismatch.evidence.test_regression import RATE_HZ
from tests.unit.mismatch.flights import quad
from tests.unit.mismatch.synthetic import coloured

TRUST = {"thrust": 0.1, "torque": 0.2, "mass": 0.05, "inertia_zz": 0.15}
NOISE = 0.1


def columns(size: int, rng) -> np.ndarray:
    """Columns (n, 12, 4) as a flight gives them: thrust and mass in force_z, torque and inertia in moment_z."""
    x = np.zeros((size, 12, 4))
    lift = -6.4 + 0.6 * coloured(size, 1.0, rng, pole=0.9)
    x[:, 2, 0], x[:, 2, 2] = lift, -lift
    x[:, 5, 1] = coloured(size, 1.0, rng, pole=0.9)
    x[:, 5, 3] = coloured(size, 1.0, rng, pole=0.9)
    return x


def judged(changes: dict[str, float], seed: int = 0, size: int = 4000, refused=()) -> dict:
    """What is said of a recording in which some values are off by relative changes."""
    rng = np.random.default_rng(seed)
    x = columns(size, rng)
    beta = np.array([changes.get(key, 0.0) for key in TRUST])
    y = np.full((size, 12), np.nan)
    for channel in (2, 5):
        y[:, channel] = x[:, channel] @ beta + coloured(size, NOISE, rng, pole=0.0)
    rows = Rows("a", np.arange(size) / RATE_HZ, y, x)
    terms = [Term(key, "value", prior_sd=(sd,)) for key, sd in TRUST.items()]
    filters = {c: np.array([1.0 / NOISE]) for c in (2, 5)}
    made = build([rows], terms, filters, lambda run, t: True, 1.0, RATE_HZ)

    def size_of(key, change):
        column = x[:, :, list(TRUST).index(key)]
        return float(np.sqrt((column**2).mean(axis=0)).max() * abs(change) / NOISE)

    return wrong_values(made, Selection([], made.fit(list(TRUST))), size_of, refused=refused)


@pytest.mark.parametrize(
    ("changes", "allowed"),
    [
        ({"torque": 0.12}, 0.01),
        # An accelerometer sees their ratio only: 5 % less thrust is half of its trust, 5 % more mass one of its own.
        ({"thrust": -0.05}, 0.005),
        ({"torque": 0.1, "inertia_zz": -0.08}, 0.01),
    ],
    ids=["torque", "of mass and thrust the least trusted", "two values"],
)
def test_wrong_values_are_named_with_their_intervals(changes, allowed):
    found = judged(changes)
    assert found.keys() == changes.keys()
    for key, true in changes.items():
        value, sd = found[key]
        assert value == pytest.approx(true, abs=min(3 * sd, allowed)) and sd < 0.01


def test_a_change_that_no_laboratory_could_tell_is_not_named():
    assert SMALLEST_CHANGE > 0.01 and judged({"torque": 0.01}) == {}


def test_right_values_are_left_alone():
    """100 recordings: a value is called wrong in none of them."""
    assert [seed for seed in range(100) if judged({}, seed, size=1000)] == []


def test_a_value_that_was_refused_is_not_named_again():
    """Without the thrust the mass stands for it: the two share a column."""
    assert list(judged({"torque": 0.1, "thrust": -0.05}, refused=("torque",))) == ["thrust"]
    assert sorted(judged({"torque": 0.1, "thrust": -0.05}, refused=("thrust",))) == ["mass", "torque"]


def test_the_channels_of_a_finding_are_those_it_is_strongest_in():
    """In units of the noise: 2 in force_x, 1 in moment_y (half of it), 0.2 in force_z (a tenth)."""
    x = np.zeros((100, 12, 1))
    x[:, 0], x[:, 4], x[:, 2] = 0.2, 0.001, 0.02
    rows = Rows("a", np.arange(100) / RATE_HZ, np.zeros((100, 12)), x)
    noise = np.array([0.1, 0.1, 0.1, 0.001, 0.001, 0.001, *[np.nan] * 6])
    assert main_channels([rows], np.array([0]), np.array([1.0]), noise) == [0, 4]


def test_the_coefficient_of_a_mass_is_its_share_of_the_true_one():
    """Believed 0.9 kg of a true 1 kg: the force misses m a by a tenth of the true mass, 0.1 = 1 − 0.9; the change is
    1/0.9 − 1 = 0.111. A thrust's coefficient is the change itself."""
    change, sd = relative_change("mass", 0.1, 0.009)
    assert (change, sd) == (pytest.approx(1 / 9), pytest.approx(0.009 / 0.81))
    assert relative_change("inertia_xx", 0.1, 0.009) == (change, sd)
    assert relative_change("thrust", 0.1, 0.009) == (0.1, 0.009)


def test_a_value_that_a_member_of_an_open_class_would_change_is_suggested_with_the_reason():
    """A vehicle heavier than believed, or one that is right and carries a payload."""
    mass, arms = (0.65, 0.8, 0.78, 0.82), (1.0, 0.9, 0.88, 0.92)
    open_class = ("com_offset", "payload")
    class_ = synthetic.drag_finding(id="com_offset", status="ambiguous", alternatives=open_class)
    told = with_values_in_question(synthetic.analysis(findings=[class_], values={"mass_kg": mass, "arm_scale": arms}))
    assert set(told.values) == {"arm_scale"}
    numbers, why = told.suggested_values["mass_kg"]
    assert numbers == mass and "payload" in why and "centre of mass" not in why
    # A class that is only suggested questions nothing.
    suggested = synthetic.drag_finding(id="com_offset", status="suggested", alternatives=open_class)
    assert with_values_in_question(synthetic.analysis(findings=[suggested], values={"mass_kg": mass})).values


def test_thrust_per_command_is_another_full_speed_of_a_throttle_and_another_coefficient_of_commanded_speeds():
    """Rotors that turn 1.1 times as fast as believed at every command lift 1.21 times as much."""
    vehicle = quad(rotor_speed_limits_rad_s=(0.0, 2000.0))
    assert with_thrust_per_command(vehicle, 1.1, 2000.0).rotor_speed_limits_rad_s == pytest.approx((0.0, 2200.0))
    faster = with_thrust_per_command(vehicle, 1.1, None)
    assert faster.rotor_speed_limits_rad_s == (0.0, 2000.0)
    ratio = faster.thrust_coefficients_n_s2() / vehicle.thrust_coefficients_n_s2()
    np.testing.assert_allclose(ratio, 1.21)


def test_a_thrust_curve_has_no_square_of_a_thrust_coefficient_that_is_not_asked():
    """With commands alone a scale of the commands stands in its place."""
    term = SimpleNamespace(effect="thrust_curve")
    model = SimpleNamespace(
        selection=SimpleNamespace(active=["curve"]),
        search=SimpleNamespace(terms={"curve": term}),
        regression=SimpleNamespace(start={"curve": 0}),
    )
    findings = [SimpleNamespace(id="thrust_curve", status="established")]
    assert with_square_term(findings, {}, model) == (findings, {})
