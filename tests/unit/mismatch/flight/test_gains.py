"""Gains by two bands and both sides: a slow moment of the air, and the controller's answer, bias what is slow."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.decide.problem import LogGain, Prior
from rotorid.mismatch.decide.selected import coefficients, relative_change
from rotorid.mismatch.decide.ways import settled
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.flight.fitted import Fitted, fitted
from rotorid.mismatch.flight.gains import Side, _trust_of, gains_of, mean_of, merged, shown_by_commands
from rotorid.mismatch.flight.prepare import prepare
from tests.unit.mismatch.flights import DENSE_HZ, quad, recorded, smooth, with_table

CUTOFF_HZ = 10.0
BELIEVED_XX = 1.3
"""The believed roll inertia over the true one."""


def pushed(table, size_n_m: float):
    """A table whose rotors cancel a slow moment about the roll axis, as a controller makes them: nothing else turns."""
    vehicle = quad()
    lever = vehicle.rotor_positions_m()[:, 1]
    push = smooth(np.random.default_rng(len(table)), int(DENSE_HZ * 60), size_n_m, 0.4)
    push = np.interp(table["time_s"], np.arange(len(push)) / DENSE_HZ, push)
    for k in range(4):
        name = f"rotor_speed_{k + 1}_rad_s"
        more = push * lever[k] / (vehicle.thrust_coefficient_n_s2 * lever @ lever)
        table[name] = np.sqrt(np.maximum(table[name] ** 2 + more, 0.0))
    return table


@cache
def found(size_n_m: float) -> Fitted:
    believed = {"xx": BELIEVED_XX * 2.489e-3, "yy": 2.5743e-3, "zz": 4.6838e-3}
    made = recorded(1, 2, 3, 4, flight={"duration_s": 20.0}, vehicle=quad(inertia_kg_m2=believed), rate_hz=100.0)
    made = with_table(made, lambda table: pushed(table, size_n_m))
    return fitted(prepare(parts_of(made, split_runs(made))[0], CUTOFF_HZ))


def test_a_slow_moment_that_the_rotors_make_up_for_widens_the_gain_of_its_axis_alone():
    quiet, moved = (gains_of(found(size).model, Prior()) for size in (0.0, 0.03))
    assert moved["inertia_xx"].variance > 2 * quiet["inertia_xx"].variance
    assert moved["inertia_yy"].variance < 2 * quiet["inertia_yy"].variance
    for gains in (quiet, moved):
        gain = gains["inertia_xx"]
        assert abs(gain.log - np.log(BELIEVED_XX)) < 2.5 * np.sqrt(gain.variance)


def side(log: float, variance: float = 1e-4, own: float = 100.0, noise: float = 0.0) -> Side:
    return Side("inertia_xx", log, variance, own, noise, leftover=0.0)


def test_without_a_leftover_the_forward_side_is_true_and_nothing_is_biased():
    gain = merged([side(0.1), side(0.3)], leftover=0.0, bias=1.0, samples=0.01)
    assert (gain.log, gain.variance) == (pytest.approx(0.1), pytest.approx(1e-4, rel=1e-3))


def test_a_column_far_below_the_noise_is_biased_without_a_leftover_too():
    """A controller that answers the gyroscope's noise makes all of the column: u² = 16."""
    gain = merged([side(1.4)], leftover=0.0, bias=0.1, samples=1600.0)
    assert gain.variance == pytest.approx(1e-4 + 0.01 * 16**2)


def test_the_column_of_a_smaller_gain_is_larger_than_that_of_the_believed_one():
    gain = merged([side(-0.5)], leftover=1.0, bias=0.1, samples=1.0)
    assert gain.variance == pytest.approx(1e-4 + 0.01 * 0.01 * 1.01 * np.exp(1.0))


def test_bands_that_differ_by_more_than_they_should_are_less_certain_together():
    assert mean_of([LogGain(0.1, 0.01), LogGain(0.1, 0.01)]).variance == pytest.approx(0.005)
    apart = mean_of([LogGain(0.0, 0.01), LogGain(0.6, 0.01)])
    assert (apart.log, apart.variance) == (pytest.approx(0.3), pytest.approx(0.005 * 18))


def test_where_all_is_leftover_the_truth_lies_between_the_sides_and_may_be_off_by_the_bias():
    gain = merged([side(0.1), side(0.3)], leftover=1.0, bias=1.0, samples=1.0)
    assert gain.log == pytest.approx(0.2)
    # Half of their distance, and u² (1 + u²) with u² a hundredth.
    assert gain.variance == pytest.approx(1e-4 + 0.01 + 0.01 * 1.01)
    # Noise of a tachometer is answered by no controller.
    assert merged([side(0.1, noise=1.0)], leftover=1.0, bias=1.0, samples=1.0).variance == pytest.approx(1e-4)


@pytest.mark.parametrize("size_n_m", [0.0, 0.03])
def test_a_wrong_inertia_is_told_though_the_rotors_make_up_for_a_slow_moment(size_n_m):
    change, sd = found(size_n_m).values["inertia_xx"]
    assert abs(change - (1 / BELIEVED_XX - 1)) < 2.5 * sd < 0.15


def test_the_told_inertia_is_the_one_delivered():
    """The whole balance, which the slow moment biases, would deliver another one next to the stated number."""
    made = found(0.03)
    model, (change, sd) = made.model, made.values["inertia_xx"]
    fit, moved = settled(model, made.values, model.selection.active)
    beta, _ = coefficients(model.regression, fit, "inertia_xx")
    assert relative_change("inertia_xx", float(beta[0]), 0.0)[0] == pytest.approx(change, rel=1e-9)
    assert "inertia_xx" not in moved
    free = model.regression.with_room(0.6).fit([*model.selection.active, "inertia_xx"], loose={"inertia_xx": 0.1})
    biased, _ = coefficients(model.regression, free, "inertia_xx")
    assert abs(relative_change("inertia_xx", float(biased[0]), 0.0)[0] - change) > 3 * sd


def test_commands_alone_show_no_moment_beyond_a_factor_of_two():
    """A yaw moment of an eighth is a controller that answers what turns the vehicle, not another rotor."""
    gains = {k: LogGain(np.log(x), 0.01) for k, x in (("mass", 2.5), ("inertia_xx", 0.6), ("inertia_zz", 0.12))}
    assert list(shown_by_commands(gains)) == ["mass", "inertia_xx"]


def test_an_offset_of_the_centre_where_no_value_is_asked_for():
    """Commands that only follow the motion determine no value: nothing is the least known of all."""
    regression = SimpleNamespace(terms=[], keys_of=lambda *_: [])
    search = SimpleNamespace(terms={"offset": SimpleNamespace(effect="com_offset")})
    model = SimpleNamespace(regression=regression, search=search, selection=SimpleNamespace(active=["offset"]))
    assert _trust_of(model) == {}
