"""A channel far above its noise floor is located, whatever was found; what values within their trust mend is none."""

from types import SimpleNamespace

import pytest

from rotorid.mismatch.tell.consistency import missing_places, verdict_word


def channel(before: float, after: float):
    errors = SimpleNamespace(before=before, named=after, after=after)
    return SimpleNamespace(noise_floor=1.0, rmse=SimpleNamespace(held_out=errors, training=errors))


@pytest.mark.parametrize(
    ("before", "after", "wrong_values", "located"),
    [
        (1.6, 1.6, {}, ["moment_x"]),
        (1.6, 1.0, {}, []),  # corrected within what was believed: no mismatch
        (1.6, 1.0, {"mass_kg": (1.0, 1.1, 1.05, 1.15)}, ["moment_x"]),
        (1.2, 1.2, {}, []),
    ],
)
def test_a_channel_that_stays_far_above_its_floor_is_located(before, after, wrong_values, located):
    analysis = SimpleNamespace(findings=(), wrong_values=wrong_values, without={}, p_values={}, unexplained_channels=())
    places = missing_places(analysis, (), {"moment_x": channel(before, after)})
    assert [name for name, _ in places] == located
    if not wrong_values:
        assert verdict_word(analysis, places, 1.0) == ("unexplained" if located else "no_mismatch")
