"""The joint regression: whitening, intervals, noisy regressors, agreement between runs, by hand and by repetition."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from rotorid.mismatch.evidence.regression import (
    MOST_ATTENUATION,
    Regression,
    at_least,
    autoregression,
    build,
    inverse_root,
    limited_bias,
    quadratic_form,
    ridge_inverse,
    trusted,
)
from rotorid.mismatch.evidence.rows import Rows, Term
from tests.unit.mismatch.synthetic import coloured

RATE_HZ = 40.0


def rows_of(y: np.ndarray, *columns: np.ndarray, run: str = "a") -> Rows:
    """Rows in which only the first channel is there; columns (n,) each."""
    size = len(y)
    target = np.full((size, 12), np.nan)
    target[:, 0] = y
    x = np.zeros((size, 12, len(columns)))
    x[:, 0] = np.stack(columns, axis=1)
    return Rows(run, np.arange(size) / RATE_HZ, target, x)


def terms_of(*keys: str, prior: float = np.inf) -> list[Term]:
    return [Term(key, "effect", key, prior_sd=(prior,)) for key in keys]


def regression(rows, keys, filters=None, noisy=None, rule=lambda run, t: True, prior=np.inf) -> Regression:
    filters = filters if filters is not None else {0: np.array([1.0])}
    return build(rows, terms_of(*keys, prior=prior), filters, rule, 1.0, RATE_HZ, noisy)


# --- whitening


def test_the_whitening_filter_of_an_autoregression_is_its_own_coefficients():
    """e_t = 0.8 e_{t-1} + 0.6 σ w_t with σ = 2: the filter is (1, −0.8) / 1.2."""
    noise = coloured(60_000, 2.0, np.random.default_rng(0), pole=0.8)
    taps = autoregression([noise[:30_000], noise[30_000:]])
    white = lfilter(taps, [1.0], noise)[12:]
    assert white.std() == pytest.approx(1.0, abs=0.05)
    lagged = [np.corrcoef(white[k:], white[:-k])[0, 1] for k in (1, 2, 3)]
    # The share of white noise assumed on top leaves a little colour.
    assert np.abs(lagged).max() < 0.06
    assert taps[1] / taps[0] == pytest.approx(-0.8, abs=0.08)


def test_the_floor_bounds_how_small_noise_may_be():
    quiet = 1e-6 * np.random.default_rng(1).standard_normal(5000)
    assert lfilter(autoregression([quiet], floor=0.1), [1.0], np.ones(50))[-1] == pytest.approx(10.0, rel=0.02)
    assert autoregression([np.zeros(100)]).tolist() == [1.0]


# --- algebra by hand


def test_a_covariance_is_raised_to_the_plain_one_in_every_direction():
    np.testing.assert_allclose(at_least(np.diag([4.0, 1.0]), np.diag([1.0, 9.0])), np.diag([4.0, 9.0]), atol=1e-9)
    # The plain one's weak direction is (1, −1): there nothing is lost either.
    plain = np.array([[2.0, -1.9], [-1.9, 2.0]])
    raised = at_least(np.eye(2), plain)
    for direction in ([1.0, 1.0], [1.0, -1.0], [0.3, 0.7]):
        d = np.array(direction)
        assert d @ raised @ d >= max(d @ plain @ d, 0) * (1 - 1e-9)


def test_columns_that_are_never_excited_stay_at_zero():
    np.testing.assert_allclose(ridge_inverse(np.diag([4.0, 0.0])), np.diag([0.25, 0.0]), rtol=1e-6)
    np.testing.assert_allclose(inverse_root(np.array([4.0, 0.0])), [0.5, 0.0])


def test_a_quadratic_form_by_hand():
    # (1, 2) with variances 4 and 1e-12: 1/4 + 4e12
    assert quadratic_form(np.array([1.0, 2e-6]), np.diag([4.0, 1e-12])) == pytest.approx(0.25 + 4.0)


def test_the_correction_for_noise_is_held_to_a_share_of_the_energy():
    np.testing.assert_allclose(limited_bias(np.array([[10.0]]), np.array([[1.0]])), [[1.0]])
    held = limited_bias(np.array([[10.0]]), np.array([[8.0]]))
    np.testing.assert_allclose(held, [[10.0 * MOST_ATTENUATION]], rtol=1e-6)


# --- fits


def test_a_fit_of_two_columns_by_hand():
    """x1 = 1, x2 = ±1 in turn, orthogonal: coefficients are the means, variances 1 / n in units of the noise."""
    rng = np.random.default_rng(2)
    n = 4000
    sign = np.where(np.arange(n) % 2, 1.0, -1.0)
    y = 3.0 - 2.0 * sign + rng.standard_normal(n)
    found = regression([rows_of(y, np.ones(n), sign)], ["one", "two"]).fit(["one", "two"])
    np.testing.assert_allclose(found.beta, [y.mean(), (y * sign).mean()], rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), 1 / np.sqrt(n), rtol=0.25)
    assert found.gain == pytest.approx(n * (y.mean() ** 2 + (y * sign).mean() ** 2), rel=1e-6)


def test_a_prior_pulls_towards_the_believed_value():
    """y = 1 once a sample, prior one-sigma 0.1: precision 100 against n = 100 halves the estimate."""
    found = regression([rows_of(np.ones(100), np.ones(100))], ["v"], prior=0.1).fit(["v"])
    np.testing.assert_allclose(found.beta, [0.5], rtol=1e-6)
    loose = regression([rows_of(np.ones(100), np.ones(100))], ["v"], prior=0.1).fit(["v"], loose={"v": 10.0})
    np.testing.assert_allclose(loose.beta, [1.0], rtol=1e-3)


def test_blocks_held_out_and_gaps_are_not_fitted():
    def rule(run, t):
        return None if 4.0 < t < 6.0 else t < 5.0

    found = regression([rows_of(np.ones(400), np.ones(400))], ["v"], rule=rule)
    assert found.training.tolist() == [True] * 4 + [False] * 6


@pytest.mark.parametrize("pole", [0.0, 0.7, 0.95])
def test_intervals_hold_under_coloured_noise_and_coloured_inputs(pole):
    """200 recordings of 30 s with a slope of 1: the 95 % interval covers it in 91 to 99 % (binomial 3 sigma)."""
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(200):
        x = coloured(1200, 1.0, rng, pole=0.9)
        noise = coloured(1200, 1.0, rng, pole=pole)
        filters = {0: autoregression([noise])}
        found = regression([rows_of(x + noise, x)], ["x"], filters).fit(["x"], jackknife=True)
        inside += abs(found.beta[0] - 1.0) < 1.96 * np.sqrt(found.covariance[0, 0])
    assert 182 <= inside <= 199


def test_p_values_of_nothing_are_uniform_under_coloured_noise():
    rng = np.random.default_rng(4)
    values = []
    for _ in range(200):
        x = np.stack([coloured(1600, 1.0, rng, pole=0.9) for _ in range(2)])
        noise = coloured(1600, 1.0, rng, pole=0.9)
        found = regression([rows_of(noise, *x)], ["one", "two"], {0: autoregression([noise])})
        fit = found.fit(["one", "two"], jackknife=True)
        values.append(found.wald(fit, found.columns(["one", "two"]), int(found.training.sum())))
    values = np.array(values)
    # Never too small: an interval that is too wide in a rare draw is allowed, a false alarm is not.
    assert np.mean(values < 0.05) <= 0.09 and values.min() > 1e-4
    assert kstest(values, "uniform", alternative="greater").pvalue > 0.01


def noisy_case(rng, size: int = 8000, noise: float = 0.3):
    """A regressor of variance 1 read with noise of variance 0.25: plain least squares gives 1 / 1.25 = 0.8."""
    x = coloured(size, 1.0, rng, pole=0.9)
    read = x + 0.5 * rng.standard_normal(size)
    y = x + noise * rng.standard_normal(size)
    again = read + 0.5 * rng.standard_normal(size)
    return rows_of(y, read), rows_of(y, again)


def test_a_noisy_regressor_attenuates_and_the_correction_undoes_it():
    read, again = noisy_case(np.random.default_rng(5))
    plain = regression([read], ["x"]).fit(["x"])
    corrected = regression([read], ["x"], noisy=[again]).fit(["x"])
    assert plain.beta[0] == pytest.approx(0.8, abs=0.02)
    assert corrected.beta[0] == pytest.approx(1.0, abs=0.03)
    # Half of the correction is in doubt, and stated.
    assert np.sqrt(corrected.covariance[0, 0]) > 0.45 * (corrected.beta[0] - plain.beta[0])


def test_the_share_of_noise_in_a_column_beside_the_others():
    """Noise variance 0.25 of 1.25 in all; beside the noise-free signal it is all noise."""
    read, again = noisy_case(np.random.default_rng(6))
    alone = regression([read], ["x"], noisy=[again])
    assert alone.own_part(["x"], "x", np.ones(1))[1] == pytest.approx(0.2, abs=0.02)
    truth = coloured(8000, 1.0, np.random.default_rng(6), pole=0.9)
    both = [rows_of(read.y[:, 0], truth, read.x[:, 0, 0])]
    beside = regression(both, ["truth", "x"], noisy=[rows_of(read.y[:, 0], truth, again.x[:, 0, 0])])
    assert beside.own_part(["truth", "x"], "x", np.ones(1))[1] > 0.8


def test_a_true_effect_keeps_its_promise_on_a_noisy_column():
    """A fifth of the column's energy is noise: scored on it, three fifths of the promise would be kept."""
    read, again = noisy_case(np.random.default_rng(8))
    seen = regression([read], ["x"], noisy=[again]).compare(["x"], [])
    assert seen.votes.all() and seen.transfer == pytest.approx(1.0, abs=0.05) and seen.won == 1.0


# --- what is built on a fit


def runs_with_slopes(*slopes: float) -> Regression:
    rng = np.random.default_rng(7)
    rows = []
    for k, slope in enumerate(slopes):
        x = coloured(1200, 1.0, rng, pole=0.9)
        rows.append(rows_of(slope * x + 0.5 * rng.standard_normal(1200), x, run=f"r{k}"))
    return regression(rows, ["x"], {0: np.array([2.0])})


def test_runs_that_agree_add_no_variance_and_runs_that_differ_do():
    same = runs_with_slopes(1.0, 1.0, 1.0, 1.0)
    spread, p = same.between_runs(same.fit(["x"]), "x")
    assert spread[0] < 1e-3 and p > 0.01
    differ = runs_with_slopes(0.6, 1.4, 0.8, 1.2)
    spread, p = differ.between_runs(differ.fit(["x"]), "x")
    # Slopes of variance 0.1333 over four runs: 0.0333 for their mean.
    assert p < 1e-6 and spread[0] == pytest.approx(0.1333 / 4, rel=0.2)
    single = runs_with_slopes(1.0)
    assert single.between_runs(single.fit(["x"]), "x") == (0.0, 1.0)


def test_what_a_term_does_beyond_the_others_and_the_share_that_is_its_own():
    """x2 = x1 + z with z orthogonal and as large: its own part takes one x1 off and is half of its energy."""
    one = np.tile([1.0, 1.0, -1.0, -1.0], 200)
    found = regression([rows_of(one, one, one + np.tile([1.0, -1.0, 1.0, -1.0], 200))], ["one", "two"])
    cols, beta = found.beyond(["one"], "two", np.array([2.0]))
    assert cols.tolist() == [0, 1]
    np.testing.assert_allclose(beta, [-2.0, 2.0], rtol=1e-6)
    assert found.own_part(["one", "two"], "two", np.array([2.0]))[0] == pytest.approx(0.5, rel=1e-6)
    assert found.own_part(["two"], "two", np.array([2.0]))[0] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("lasting", [True, False])
def test_what_an_effect_promises_elsewhere_it_gains_there_and_what_one_environment_needs_it_does_not(lasting):
    """A coefficient of 0.5 on a variance of 1 promises and gains a quarter a sample; one of 2 in a tenth of the time
    alone promises elsewhere what it does not keep."""
    rng = np.random.default_rng(8 if lasting else 9)
    n = 4000
    x = coloured(n, 1.0, rng, pole=0.9)
    slope = 0.5 if lasting else np.where(np.arange(n) < n // 10, 2.0, 0.0)
    seen = regression([rows_of(slope * x + rng.standard_normal(n), x)], ["x"]).compare(["x"], [])
    if lasting:
        assert seen.promised.sum() == pytest.approx(0.25 * n, rel=0.15)
        assert seen.total == pytest.approx(seen.promised.sum(), rel=0.2)
        assert seen.transfer == pytest.approx(1.0, abs=0.15) and seen.won > 0.9
    else:
        assert seen.transfer < 0.6 and seen.won < 0.5


def with_knots(knots: int) -> Regression:
    """Two effects and a wind of so many knots in each of two runs, one of them held out; noisy regressors."""
    rng = np.random.default_rng(9)
    rows, noisy, size = [], [], 1600
    for k in range(2):
        x = np.stack([coloured(size, 1.0, rng, pole=0.9) for _ in range(2)], axis=1)
        hats = [np.interp(np.arange(size), np.linspace(0, size, knots), unit) for unit in np.eye(knots)]
        # A wind is felt through the second effect's own input: the two are far from orthogonal.
        winds = np.zeros((size, 2 * knots))
        winds[:, k * knots : (k + 1) * knots] = np.stack(hats, axis=1) * (1.0 + 0.3 * x[:, 1:])
        blown = winds[:, k * knots : (k + 1) * knots] @ rng.standard_normal(knots)
        y = x @ [0.5, -0.8] + blown + 0.3 * rng.standard_normal(size)
        for out, error in ((rows, 0.0), (noisy, 0.2)):
            read = np.concatenate([x + error * rng.standard_normal(x.shape), winds], axis=1)
            out.append(rows_of(y, *read.T, run=f"r{k}"))
    terms = [*terms_of("one", "two"), *(Term(f"wind{k}", "wind", "gust", size=knots, run=f"r{k}") for k in range(2))]
    return build(rows, terms, {0: np.array([3.0, -0.5])}, lambda run, t: run == "r0", 1.0, RATE_HZ, noisy)


def test_winds_taken_out_once_leave_every_fit_as_it_was():
    whole = with_knots(20)
    less, winds = whole.without_winds(), ["wind0", "wind1"]
    full, reduced = whole.fit(["one", "two", *winds]), less.fit(["one", "two"])
    np.testing.assert_allclose(reduced.beta, full.beta[:2], rtol=1e-8)
    # The robust covariance is raised to the plain one direction by direction, here of two and there of all.
    np.testing.assert_allclose(reduced.covariance, full.covariance[:2, :2], rtol=0.05)
    np.testing.assert_allclose(reduced.residual_square, full.residual_square, rtol=1e-7)
    gains = [r.fit(["one", "two", *w]).gain - r.fit(["one", *w]).gain for r, w in ((whole, winds), (less, []))]
    assert gains[0] == pytest.approx(gains[1], rel=1e-6)
    # Without the wind neither would be right: it is no small thing that was taken out.
    assert np.abs(whole.fit(["one", "two"]).beta - full.beta[:2]).max() > 0.02


def test_what_a_fit_costs_does_not_grow_with_the_knots_of_a_wind():
    """A fit handles a matrix of this size for every block of time, and a search makes thousands of fits."""
    few, many = (with_knots(k).without_winds() for k in (3, 40))
    assert few.gram.shape == many.gram.shape and few.gram.shape[1:] == (2, 2)
    assert with_knots(3).without_winds().terms == terms_of("one", "two")


def test_winds_that_do_not_stand_last_are_refused():
    rows = [rows_of(np.ones(400), np.ones(400), np.ones(400), run="a")]
    terms = [Term("w", "wind", "gust", run="a"), *terms_of("one")]
    with pytest.raises(ValueError, match="last"):
        build(rows, terms, {0: np.array([1.0])}, lambda run, t: True, 1.0, RATE_HZ).without_winds()


def test_a_stretch_shorter_than_the_whitening_says_nothing():
    """Three samples between two holes, a filter of eight: the fit is that of the long stretch alone."""
    rng = np.random.default_rng(8)
    x = np.zeros((400, 12, 1))
    x[:, 0, 0] = rng.standard_normal(400)
    y = np.full((400, 12), np.nan)
    y[:, 0] = 0.5 * x[:, 0, 0] + 0.1 * rng.standard_normal(400)
    time_s = np.arange(400) / RATE_HZ
    long, short = Rows("a", time_s, y, x), Rows("a", time_s[:3] + 100.0, 9.0 + y[:3], x[:3])
    filters = {0: np.array([1.0, *[0.0] * 7])}
    fits = [
        build(rows, [Term("x", "effect")], filters, lambda run, t: True, 1.0, RATE_HZ).fit(["x"])
        for rows in ([long], [long, short])
    ]
    assert fits[1].beta == pytest.approx(fits[0].beta, rel=1e-12)


def test_a_doubt_about_a_believed_value_is_no_larger_than_the_belief():
    """A value doubted by 0.4 of a one-sigma of 0.1: a quarter of it, and of what it does to the other (2 × 0.4)."""
    normal = np.array([[4.0, -2.0], [-2.0, 1.0]])
    doubt = trusted(np.array([0.4, 1.0]), normal, np.array([True, False]), np.array([100.0, 0.0]))
    np.testing.assert_allclose(doubt, [0.1, 1.0 - 0.75 * 0.8], rtol=1e-6)
    kept = trusted(np.array([0.05, 1.0]), normal, np.array([True, False]), np.array([100.0, 0.0]))
    np.testing.assert_array_equal(kept, [0.05, 1.0])


def test_the_noise_of_a_regressor_is_no_misfit():
    """Noise of variance 1: what x explains is 1 per row, not the 0.75 of what is read."""
    read, again = noisy_case(np.random.default_rng(21), 20_000, noise=1.0)
    made = regression([read], ["x"], noisy=[again])
    fit = made.fit(["x"])
    assert fit.beta[0] == pytest.approx(1.0, abs=0.05)
    assert fit.gain / 20_000 == pytest.approx(1.0, abs=0.08)
    assert made.explained(["x"]) == pytest.approx(fit.gain, rel=1e-9) and made.shown("x").all()


# --- terms that some channels alone estimate


def two_channels(seed: int, apart: tuple[str, ...]) -> Regression:
    """A sensor's error of 0.05 in the comparison (channel 9) and, with as much noise, in a moment (channel 3) that also
    holds what nobody modelled: −0.4 of the same signal. A second term acts in the moment alone."""
    rng, size = np.random.default_rng(seed), 8000
    x = np.stack([coloured(size, 1.0, rng, pole=0.9) for _ in range(2)], axis=1)
    y, columns = np.full((size, 12), np.nan), np.zeros((size, 12, 2))
    columns[:, 3], columns[:, 9, 0] = x, x[:, 0]
    y[:, 3] = (0.05 - 0.4) * x[:, 0] + 0.7 * x[:, 1] + coloured(size, 1.0, rng)
    y[:, 9] = 0.05 * x[:, 0] + coloured(size, 1.0, rng)
    filters = {c: np.array([1.25, -0.75]) for c in (3, 9)}
    rows = [Rows("a", np.arange(size) / RATE_HZ, y, columns)]
    return build(rows, terms_of("error", "other"), filters, lambda run, t: True, 1.0, RATE_HZ, None, (9,), apart)


def test_what_the_model_of_other_channels_lacks_does_not_reach_a_term_estimated_apart():
    joint, cut = two_channels(0, ()).fit(["error", "other"]), two_channels(0, ("error",)).fit(["error", "other"])
    assert joint.beta[0] == pytest.approx(-0.15, abs=0.03)
    assert cut.beta[0] == pytest.approx(0.05, abs=0.03) and cut.beta[1] == pytest.approx(0.7, abs=0.05)
    # It is scored on all channels: what it leaves of the moment is no gain.
    assert cut.gain < joint.gain


def test_intervals_of_a_term_estimated_apart_hold():
    away = []
    for seed in range(60):
        fit = two_channels(seed, ("error",)).fit(["error", "other"], jackknife=True)
        away.append((fit.beta - [0.05, 0.7]) / np.sqrt(np.diag(fit.covariance)))
    # Channel 9 alone knows the error: 95 % of 60 are 57 ± 1.7. The other absorbs none of what the moment lacks.
    assert 52 <= int((np.abs(np.array(away)[:, 0]) < 1.96).sum()) <= 60
    assert 52 <= int((np.abs(np.array(away)[:, 1]) < 1.96).sum()) <= 60


def test_left_out_runs_and_gains_use_the_same_coefficients():
    whole = two_channels(3, ("error",))
    keys = ["error", "other"]
    assert whole.explained(keys) == pytest.approx(whole.fit(keys).gain, rel=1e-9)
    _, betas = whole.left_out(keys, False)
    np.testing.assert_allclose(betas.mean(axis=0), whole.fit(keys).beta, atol=0.01)


def test_a_known_coefficient_is_taken_off_the_rows():
    rng, size = np.random.default_rng(4), 4000
    x = np.stack([coloured(size, 1.0, rng, pole=0.9) for _ in range(2)], axis=1)
    x[:, 1] += 0.5 * x[:, 0]
    y = x @ [0.5, -0.8] + 0.3 * rng.standard_normal(size)
    known = regression([rows_of(y, *x.T)], ["one", "two"]).given(np.array([0]), np.array([0.2])).fit(["two"])
    by_hand = regression([rows_of(y - 0.2 * x[:, 0], *x.T)], ["one", "two"]).fit(["two"])
    np.testing.assert_allclose(known.beta, by_hand.beta, rtol=1e-9)
    np.testing.assert_allclose(known.covariance, by_hand.covariance, rtol=1e-7)
    np.testing.assert_allclose(known.residual_square, by_hand.residual_square, rtol=1e-7)


@pytest.mark.parametrize("apart", [(), ("error",)])
def test_a_coefficient_that_is_known_at_its_fitted_number_changes_no_other(apart):
    whole = two_channels(5, apart)
    fit = whole.fit(["error", "other"])
    for k, key in ((0, "other"), (1, "error")):
        known = whole.given(np.array([k]), fit.beta[k : k + 1]).fit([key])
        np.testing.assert_allclose(known.beta, fit.beta[1 - k], rtol=1e-7)
