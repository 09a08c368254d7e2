"""Pictures of effects: what is shown is the effect's own equation, over what it hangs on."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid_lab.plots.signature import HOVER_RAD_S, explained, signature

WITHOUT = {"gust", "quantisation"}
"""A gust is a window of the data's own; a step of the last digit is nothing on a made-up load."""


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_effect_has_one(name: str) -> None:
    shown = signature(catalogue()[name])
    assert (shown is None) == (name in WITHOUT)
    if shown is None or shown.layouts is not None:
        return
    assert len(shown.x) == len(shown.y) > 100
    assert np.isfinite(shown.y).mean() > 0.5
    reference = 0.0 if shown.without is None else shown.without
    assert np.nanmax(np.abs(np.nan_to_num(shown.y) - reference)) > 0


def test_rotor_drag_is_shown_over_forward_speed_with_the_slope_of_its_equation() -> None:
    shown = signature(catalogue()["rotor_drag"])
    assert (shown.over, shown.shows) == ("forward speed (m/s)", "force along x (N)")
    k_d = dict((s, v) for s, v, _ in shown.values)["k_d"]
    assert np.polyfit(shown.x, shown.y, 1)[0] == pytest.approx(-4 * k_d * HOVER_RAD_S, rel=0.02)


def test_what_hangs_on_height_is_shown_over_height_and_a_lag_over_time() -> None:
    ground = signature(catalogue()["ground_effect"])
    assert ground.over == "height (m)" and np.corrcoef(ground.x, ground.y)[0, 1] > 0.3  # lift is along -z
    lag = signature(catalogue()["motor_lag"])
    first = int(np.flatnonzero(np.diff(lag.without))[0]) + 1
    assert lag.over == "time (s)" and abs(lag.y[first] - lag.without[first]) > 0.3 * np.ptp(lag.without)


def test_the_share_explained_is_one_for_a_function_and_small_for_chance() -> None:
    x = np.linspace(-1, 1, 5000)
    assert explained(x**2, x) > 0.98
    assert explained(np.random.default_rng(1).normal(size=5000), x) < 0.02
