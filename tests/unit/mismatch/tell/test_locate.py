"""Locations: nothing on noise, true edges of bursts and of what findings explain, the right regime. A channel far
above its noise floor is located, whatever was found; what values within their trust mend is none.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.tell.consistency import missing_places, verdict_word
from rotorid.mismatch.tell.locate import _regime_of, _separation, locate
from rotorid.mismatch.tell.places import size_at
from rotorid.mismatch.tell.verdict import Location, Regime
from tests.unit.mismatch.synthetic import DASH_S, LENGTH_S, analysis, drag_finding


@pytest.mark.parametrize("pole", [-0.6, 0.0, 0.6, 0.9])
def test_noise_of_any_colour_is_located_nowhere(pole):
    assert not any(locate(analysis(seed, pole=pole)) for seed in range(10))


def test_an_unexplained_burst_is_found_to_a_fraction_of_a_second():
    found = locate(analysis(bursts=[("b", "moment_y", 20.0, 23.0, 6.0)]))
    assert [(f.run, f.channel) for f in found] == [("b", "moment_y")]
    assert found[0].start_s == pytest.approx(20.0, abs=0.2)
    assert found[0].stop_s == pytest.approx(23.0, abs=0.2)
    # 120 samples at 37 σ² beside 1560 at 1 σ²: (120 · 37) / (1440 + 4440) = 0.76.
    assert found[0].energy_share == pytest.approx(0.76, abs=0.1) and found[0].p_value < 1e-6


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.9])
def test_the_same_noise_louder_for_a_while_is_a_sensor_and_no_mismatch(pole):
    """Three seconds of three times the noise in one run, in every channel."""
    for seed in range(5):
        made = analysis(seed, pole=pole)
        louder = [np.where((t.time_s > 20) & (t.time_s < 23) & (t.run == "b"), 3.0, 1.0) for t in made.traces]
        traces = [replace(t, named=t.named * x) for t, x in zip(made.traces, louder, strict=True)]
        assert not locate(replace(made, traces=tuple(traces)))


def test_drag_is_located_in_the_dash_and_its_regime_is_airspeed():
    found = locate(analysis(findings=[drag_finding()]))
    assert [(f.run, f.channel) for f in found] == [(r, "force_x") for r in "abc"]
    for f in found:
        assert f.start_s == pytest.approx(DASH_S[0], abs=0.3)
        assert f.stop_s == pytest.approx(DASH_S[1], abs=0.3) and f.regime.variable == "airspeed_m_s"
        assert 0 < f.regime.low < 5.0 <= f.regime.high + 0.1


def test_a_run_that_differs_from_the_others_is_located_as_a_whole():
    """Run b is off by 3 of its noise throughout; reported only where the analysis says that runs differ."""
    made = analysis(unexplained_depends_on=("run",))
    traces = tuple(
        replace(t, named=t.named + 3 * made.noise_floor[t.channel]) if (t.run, t.channel) == ("b", "moment_y") else t
        for t in made.traces
    )
    (found,) = locate(replace(made, traces=traces))
    assert (found.run, found.channel, found.regime) == ("b", "moment_y", None)
    assert (found.start_s, found.stop_s) == (0.0, pytest.approx(LENGTH_S - 0.01))
    assert found.energy_share == pytest.approx(1.0)


def test_windows_that_a_finding_states_are_taken_as_they_are():
    gust = drag_finding(id="gust", form=None, values=(), windows=(("c", 5.0, 8.0),))
    (found,) = locate(analysis(findings=[gust]))
    assert (found.run, found.channel) == ("c", "force_x")
    assert found.start_s == pytest.approx(5.0, abs=0.03)
    assert found.stop_s == pytest.approx(8.0, abs=0.03)


def test_a_wrong_value_is_wrong_throughout():
    made = analysis(findings=[drag_finding(status="absorbed")], values={"mass_kg": (0.6, 0.652, 0.65, 0.654)})
    found = locate(made)
    assert {f.channel for f in found} == {"force_x"}
    assert all((f.start_s, f.stop_s) == (0.0, pytest.approx(LENGTH_S - 0.01)) for f in found)


def test_the_same_analysis_gives_the_same_locations():
    made = analysis(3, findings=[drag_finding()], bursts=[("a", "moment_x", 5, 7, 6.0)])
    assert locate(made) == locate(made)


def test_samples_that_a_sensor_lost_are_located_where_no_residual_is_left():
    dropout = drag_finding(
        id="sensor_dropout",
        form=None,
        values=(),
        channels=("rotor_speed_2_rad_s", "specific_force_y_m_s2"),
        windows=(("b", 4.0, 5.5), ("b", 9.0, 9.5)),
    )
    found = locate(analysis(findings=[dropout]))
    assert {(f.run, f.channel, f.start_s, f.stop_s) for f in found} == {
        ("b", channel, start_s, stop_s)
        for channel in ("rotor_speed_2", "force_y")
        for start_s, stop_s in ((4.0, 5.5), (9.0, 9.5))
    }
    assert [f.energy_share for f in found if f.channel == "rotor_speed_2"] == pytest.approx([0.75, 0.25])


def test_two_wild_samples_are_no_mismatch():
    """Ten times the noise, as a reading gone wrong; half a second of four times the noise is one."""
    made = analysis()

    def spoiled(count, size):
        traces = []
        for t in made.traces:
            after = t.after.copy()
            if (t.run, t.channel) == ("b", "moment_y"):
                after[400 : 400 + count] += size * made.noise_floor[t.channel]
            traces.append(replace(t, named=after))
        return replace(made, traces=tuple(traces))

    assert not locate(spoiled(2, 10.0))
    assert [(f.run, f.channel) for f in locate(spoiled(40, 4.0))] == [("b", "moment_y")]


def test_nothing_turned_into_other_axes_is_nothing():
    """Loads of 1e-17 of the largest are one bin at zero: the range ends there, not at a rounding error."""
    rng = np.random.default_rng(0)
    value = np.concatenate([rng.uniform(-1e-17, 1e-17, 400), rng.uniform(1.0, 2.0, 400)])
    energy = np.where(value > 0.5, 1.0, 20.0) * rng.chisquare(20, 800) / 20
    _, _, low, high, _ = _separation(energy, value)
    assert low == 0.0 and 0.0 <= high <= 1.1


def back_and_forth(odd: bool):
    """Three runs with a forward speed of -4 to 4 m/s: an error of 0.2 N a m/s both ways, or flying forwards alone."""
    made, regimes, traces = analysis(), {}, []
    for name, known in made.regimes.items():
        speed = 4.0 * np.sin(0.7 * known["time_s"])
        regimes[name] = {"time_s": known["time_s"], "forward_speed_m_s": speed}
    for t in made.traces:
        speed = regimes[t.run]["forward_speed_m_s"]
        drag = -0.2 * (speed if odd else np.maximum(speed, 0.0)) * (t.channel == "force_x")
        traces.append(replace(t, before=t.after + drag, refitted=t.after + drag))
    return replace(made, traces=tuple(traces), regimes=regimes)


def test_the_regime_of_an_odd_effect_is_one_of_magnitudes():
    both = _regime_of(back_and_forth(odd=True), "force_x", True)
    assert (both.variable, both.either_sign) == ("forward_speed_m_s", True) and 1.0 < both.low < both.high < 4.1
    forwards = _regime_of(back_and_forth(odd=False), "force_x", True)
    assert (forwards.variable, forwards.either_sign) == ("forward_speed_m_s", False) and forwards.low > 0.5


def test_the_error_in_a_place_is_the_place_s_own():
    made = back_and_forth(odd=True)
    everywhere = dict(run="b", channel="force_x", start_s=0.0, stop_s=LENGTH_S, p_value=1e-9, energy_share=1.0)
    regime = Regime(variable="forward_speed_m_s", low=3.0, high=4.0, either_sign=True)
    # 0.2 N a m/s between 3 and 4 m/s of a sine: the speed's mean square is 13.2.
    assert size_at(made, Location(**everywhere, regime=regime)).rms == pytest.approx(
        np.sqrt(0.04 * 13.2 + 0.05**2), rel=0.02
    )
    # Over the whole run half of 16.
    assert size_at(made, Location(**everywhere, regime=None)).rms == pytest.approx(
        np.sqrt(0.04 * 8.0 + 0.05**2), rel=0.05
    )
    beyond = regime.model_copy(update={"low": 7.0, "high": 9.0})
    assert size_at(made, Location(**everywhere, regime=beyond)) is None


@pytest.mark.parametrize("alone", [True, False])
def test_what_the_accelerometer_alone_reads_is_located_nowhere(alone):
    """A burst of six noises in the force, that the velocity does not show, or does."""
    made = analysis(bursts=[("b", "force_y", 20.0, 23.0, 6.0)])
    (burst,) = [t for t in made.traces if (t.run, t.channel) == ("b", "force_y")]
    read = np.where((burst.time_s > 20.0) & (burst.time_s < 23.0), burst.after, 0.0) / made.improved.mass_kg
    sensors = replace(
        burst, channel="accelerometer_y", unit="m/s2", before=read, refitted=read, named=read * alone,
        after=read * alone,
    )  # fmt: skip
    found = locate(replace(made, force_source="accelerometer", between_sensors=(sensors,)))
    assert [(f.run, f.channel) for f in found] == ([] if alone else [("b", "force_y")])


def channel(before: float, after: float):
    errors = SimpleNamespace(before=before, named=after, after=after)
    return SimpleNamespace(noise_floor=1.0, rmse=SimpleNamespace(held_out=errors, training=errors))


@pytest.mark.parametrize(
    ("before", "after", "wrong_values", "samples", "located"),
    [
        (1.6, 1.6, {}, 1000, ["moment_x"]),
        (1.6, 1.6, {}, 50, []),  # by chance
        (2.6, 2.6, {}, 50, ["moment_x"]),
        (1.6, 1.0, {}, 1000, []),  # corrected within what was believed: no mismatch
        (1.6, 1.0, {"mass_kg": (1.0, 1.1, 1.05, 1.15)}, 1000, ["moment_x"]),
        (1.2, 1.2, {}, 1000, []),
    ],
)
def test_a_channel_that_stays_far_above_its_floor_is_located(before, after, wrong_values, samples, located):
    analysis = SimpleNamespace(findings=(), wrong_values=wrong_values, without={}, p_values={}, unexplained_channels=(),
                               noise_floor={"moment_x": 1.0})  # fmt: skip
    places = missing_places(analysis, (), {"moment_x": channel(before, after)}, {"moment_x": samples})
    assert [name for name, _ in places] == located
    if not wrong_values:
        assert verdict_word(analysis, places, 1.0, {}) == ("unexplained" if located else "no_mismatch")
