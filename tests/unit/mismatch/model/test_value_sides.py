"""Inertias are judged by what is quick where a slow moment of the air, and the controller's answer, bias the rest."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rotorid.mismatch.decision.decide import coefficients, relative_change
from rotorid.mismatch.model.fitted import Fitted, fitted
from rotorid.mismatch.model.prepare import prepare
from rotorid.mismatch.model.value_sides import sides_of_values
from rotorid.mismatch.model.within_trust import settled
from rotorid.mismatch.plant.split import parts_of, split_runs
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


@pytest.mark.parametrize(("size_n_m", "every"), [(0.0, True), (0.03, False)])
def test_all_frequencies_judge_unless_slow_ones_tell_of_another_gain(size_n_m, every):
    model = found(size_n_m).model
    assert (sides_of_values(model).judging is model.search.regression) == every


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
