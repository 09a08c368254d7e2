"""What a finding contributes to each trace: one series a trace, whatever the others have."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.effects import amplifier_filter
from rotorid.effects.contract import Form
from rotorid.mismatch.decide import sizes


def test_there_is_a_series_for_each_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: a run without the group, or a trace that is too short, shifted or lengthened the list."""
    found = {"long": {"force": (np.arange(5.0), np.ones((5, 3)))}, "other": {}}
    monkeypatch.setattr(sizes, "_series", lambda finding, segments, vehicle: found[segments[0].run])
    finding = SimpleNamespace(status="established", windows=(), form=object.__new__(Form))
    analysis = SimpleNamespace(findings=(finding,), improved=None)
    traces = [SimpleNamespace(run=run, time_s=np.arange(0.0, 3.0)) for run in ("other", "long", "unheard")]
    segments = [SimpleNamespace(run="long"), SimpleNamespace(run="other")]
    got = sizes.shares(analysis, segments, {"force_x": traces, "moment_x": traces, "force": traces})
    assert list(got) == [0] and list(got[0]) == ["force_x"]
    np.testing.assert_array_equal(got[0]["force_x"], [np.zeros(3), np.ones(3), np.zeros(3)])


def test_a_cutoff_above_half_the_rate_of_a_slow_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    load = np.sin(np.arange(60.0))[:, None] * np.ones(6)
    monkeypatch.setattr(amplifier_filter, "since_the_first", lambda loading: load)
    monkeypatch.setattr(amplifier_filter, "unsmoothed", lambda load: load)
    late = amplifier_filter._fourth_order(SimpleNamespace(dt_s=0.16), None, np.array([5.0])).reading
    assert np.isfinite(late).all()
