import numpy as np
import pytest

from rotorid_lab.networks import Network, Training, build, gradients, sigmoid, train


def test_delta_rule_by_hand():
    """One linear node, w = (0.5, -1), x = (1, 2), d = 3, rate 0.1: e = 4.5, w += 0.1 e x = (0.95, -0.1)."""
    network = Network((np.array([[0.5, -1.0]]),), (None,), ("linear",), (None,))
    found, _, mse = train(network, np.array([[1.0, 2.0]]), np.array([[3.0]]), Training(0.1, 1))
    np.testing.assert_allclose(found.weights[0], [[0.95, -0.1]])
    np.testing.assert_allclose(mse, [[4.5**2]])


def test_generalised_delta_rule_of_a_sigmoid_by_hand():
    """v = 0: y = 0.5, φ' = 0.25, e = 0.5: Δw = 0.25 · 0.5 · x."""
    network = Network((np.zeros((1, 2)),), (np.zeros(1),), ("sigmoid",), (None,))
    steps, bias_steps, _ = gradients(network, np.array([[1.0, 2.0]]), np.array([[1.0]]))
    np.testing.assert_allclose(steps[0], [[0.125, 0.25]])
    np.testing.assert_allclose(bias_steps[0], [0.125])


def test_back_propagation_is_the_gradient_of_the_squared_error():
    rng = np.random.default_rng(3)
    network = build((3, 4, 5, 2), ("sigmoid", "sigmoid", "linear"), rng)
    x, d = rng.normal(size=(7, 3)), rng.normal(size=(7, 2))
    steps, bias_steps, _ = gradients(network, x, d)

    def cost(net):
        return 0.5 * np.mean(np.sum((d - net(x)) ** 2, axis=1))

    for layer in range(3):
        for kind, step in (("weights", steps[layer]), ("biases", bias_steps[layer])):
            index = (0,) * step.ndim
            arrays = [a.copy() for a in getattr(network, kind)]
            change = {}
            for sign in (1, -1):
                moved = [a.copy() for a in arrays]
                moved[layer][index] += sign * 1e-6
                parts = {"weights": network.weights, "biases": network.biases, kind: tuple(moved)}
                change[sign] = cost(Network(parts["weights"], parts["biases"], network.activations, network.masks))
            assert step[index] == pytest.approx(-(change[1] - change[-1]) / 2e-6, rel=1e-6)


def test_batch_of_one_is_stochastic_and_group_of_all_is_batch():
    rng = np.random.default_rng(0)
    network = build((2, 3, 1), ("sigmoid", "linear"), rng)
    x, d = rng.normal(size=(6, 2)), rng.normal(size=(6, 1))

    def weights(**how):
        return train(network, x, d, Training(0.1, 20, **how))[0].weights[0]

    np.testing.assert_allclose(weights(method="mini-batch", group=1), weights(method="stochastic"), rtol=1e-12)
    np.testing.assert_allclose(weights(method="mini-batch", group=6), weights(method="batch"), rtol=1e-10)
    assert not np.allclose(weights(method="stochastic"), weights(method="batch"))


def test_sigmoid_does_not_overflow():
    np.testing.assert_allclose(sigmoid(np.array([-1000.0, 0.0, 1000.0])), [0, 0.5, 1])


@pytest.mark.parametrize("method", ["batch", "stochastic", "mini-batch"])
def test_resume_ends_at_the_same_weights(tmp_path, method):
    rng = np.random.default_rng(5)
    network = build((2, 4, 1), ("sigmoid", "linear"), rng)
    x, d = rng.normal(size=(10, 2)), rng.normal(size=(10, 1))
    how = dict(method=method, group=3, checkpoint_every=10)
    whole, _, mse = train(network, x, d, Training(0.1, 40, **how))
    train(network, x, d, Training(0.1, 20, **how), tmp_path / "c.npz")
    second, _, again = train(network, x, d, Training(0.1, 40, **how), tmp_path / "c.npz")
    np.testing.assert_array_equal(second.weights[0], whole.weights[0])
    np.testing.assert_array_equal(again, mse)
    with pytest.raises(ValueError, match="checkpoint of another network"):
        train(build((2, 5, 1), ("sigmoid", "linear"), rng), x, d, Training(0.1, 40), tmp_path / "c.npz")


def test_running_away_is_said():
    network = build((1, 1), ("linear",), np.random.default_rng(0))
    with pytest.raises(ValueError, match="ran away by epoch"), np.errstate(all="ignore"):
        train(network, np.array([[10.0]]), np.array([[1.0]]), Training(5.0, 1000))


def test_masked_weights_stay_zero():
    mask = np.array([[1.0, 0.0]])
    network = build((2, 1), ("linear",), np.random.default_rng(0), bias=False, masks=(mask,))
    x = np.random.default_rng(1).normal(size=(20, 2))
    found, *_ = train(network, x, x @ np.array([[2.0], [3.0]]), Training(0.1, 300))
    assert found.weights[0][0, 1] == 0
