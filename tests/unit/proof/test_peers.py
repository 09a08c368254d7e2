"""The peers on a regression whose answer is known."""

import numpy as np
import pytest

from rotorid_proof.peers import boosting, refit_only, sample_split, sindy, stepwise
from rotorid_proof.peers.problem import Problem, as_verdict, least_squares

NAMES = ("rotor_drag", "com_offset", "thrust_curve", "gyro_error")


def problem(weights: dict[str, float], mass: float = 0.0, seed: int = 1) -> Problem:
    """Four effects, one column each, independent and of rms one, on one channel with white noise of rms 0.5."""
    rng = np.random.default_rng(seed)
    n = 3000
    x = rng.normal(size=(n, 1, 1 + len(NAMES)))
    speed = x[:, 0, 1]
    noise = 0.5 * rng.normal(size=n)
    y = mass * x[:, 0, 0] + sum(w * x[:, 0, 1 + NAMES.index(name)] for name, w in weights.items()) + noise
    time = np.arange(n) / 40
    return Problem(
        keys=("mass", *(f"{name}/only" for name in NAMES)), effects={f"{name}/only": name for name in NAMES},
        values=("mass",), believed={"mass": 2.0}, x=x, y=y[:, None], scale=np.array([0.1]), channels=("force_x",),
        training=time < 50, held_out=time >= 50, block=time.astype(int),
        regime={"forward_speed_m_s": speed, "body_rate_rad_s": rng.normal(size=n)},
        runs={"training": ("a",), "held_out": ("b",)}, rest={"prior": {"mass": 0.05}},
    )  # fmt: skip


@pytest.mark.parametrize("ask", [stepwise.ask, sindy.ask, sample_split.ask, boosting.ask])
def test_a_peer_finds_the_one_effect_and_nothing_where_nothing_is(ask) -> None:
    if ask is sindy.ask:
        pytest.importorskip("pysindy")
    assert set(ask(problem({"rotor_drag": 1.0})).found) == {"rotor_drag"}
    assert ask(problem({})).found == {}


@pytest.mark.parametrize("ask", [stepwise.ask, sindy.ask, sample_split.ask])
def test_a_peer_leaves_the_noise(ask) -> None:
    if ask is sindy.ask:
        pytest.importorskip("pysindy")
    given = problem({"rotor_drag": 1.0, "com_offset": -0.7})
    answer = ask(given)
    assert set(answer.found) == {"rotor_drag", "com_offset"}
    assert np.std(answer.after[given.held_out]) == pytest.approx(0.5, rel=0.05)


def test_refitting_finds_a_value_and_never_physics() -> None:
    answer = refit_only.ask(problem({"rotor_drag": 1.0}, mass=0.4))
    assert answer.found == {}
    # the column is the change for a mass wrong by its whole; 0.4 of it was put in
    assert answer.values["mass"][0] == pytest.approx(0.4, abs=0.05)


def test_an_answer_in_the_words_of_a_verdict() -> None:
    given = problem({}, mass=0.4)
    said = as_verdict("set-x", given, refit_only.ask(given))
    low, high = said["parameters"]["mass_kg"]["interval_95"]
    assert low < 2.8 < high
    # scaled rms 0.5 of a channel whose rms is 0.1 N
    assert said["channels"]["force_x"]["rmse"]["held_out"]["after"] == pytest.approx(0.05, rel=0.06)
    assert said["runs"]["held_out"] == ["b"]


def test_least_squares_by_hand() -> None:
    # y = 2 x at x = 1, 2, 3 with errors 0, 0, 0; a column of zeros stays at zero
    x = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    beta, covariance = least_squares(x, np.array([2.0, 4.0, 6.0]))
    assert beta == pytest.approx([2.0, 0.0], abs=1e-6)
    assert np.isfinite(covariance).all()
