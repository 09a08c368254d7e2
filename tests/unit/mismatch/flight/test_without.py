"""The model of a flight with fewer of its parts."""

from types import SimpleNamespace

import numpy as np

from rotorid.mismatch.evidence.rows import Term
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.flight import without
from rotorid.mismatch.flight.fitted import fitted
from rotorid.mismatch.flight.prepare import prepare
from rotorid.mismatch.flight.without import with_only, without_each
from tests.unit.mismatch.flights import recorded


def test_a_model_without_its_wind_has_the_terms_of_its_rows():
    """Terms that no column belongs to any more stopped the stage where believed values were judged anew."""
    made = recorded(1, 2, 3, flight={"square_drag": 0.06, "excitation": 1.5, "wind": (-1.0, 3.0)})
    found = fitted(prepare(parts_of(made, split_runs(made))[0]))
    assert found.model.wind is not None and "wind" in {t.kind for t in found.model.terms}
    calm = with_only(found, {"frame_drag"}, {}).model
    assert calm.wind is None and keys(calm.terms) == keys(calm.regression.terms)
    assert "wind" not in {t.kind for t in calm.terms}


def keys(terms: list[Term]) -> list[str]:
    """Keys of terms."""
    return [t.key for t in terms]


def test_what_a_lag_is_worth_is_asked_in_the_wind_that_was_found(monkeypatch):
    """Before, the stretches without it were made of those in still air."""
    asked = []
    monkeypatch.setattr(without, "chain_without", lambda *_: None)
    monkeypatch.setattr(without, "path_segments", lambda segments, *_: segments)
    monkeypatch.setattr(without, "rows_of", lambda _, segments: asked.extend(segments) or [])
    lagging = SimpleNamespace(result=SimpleNamespace(fit=SimpleNamespace(chain=[("motor_lag", None)])))
    model = SimpleNamespace(selection=SimpleNamespace(active=[]))
    found = SimpleNamespace(model=model, chain=lagging, commanded=True, measured=False)
    prepared = SimpleNamespace(segments=["in still air"], thinner=SimpleNamespace(cutoff_hz=20.0))
    seen = SimpleNamespace(
        prepared=prepared, segments=["in wind"], rows=[], wind=np.ones(2), gusts=(), unnamed=lambda columns: columns > 0
    )
    fit = SimpleNamespace(columns=np.zeros(0, int), beta=np.zeros(0))
    lag = SimpleNamespace(id="motor_lag", status="established")
    assert without_each(found, seen, {}, fit, [lag], ()) == {"motor_lag": ()} and asked == ["in wind"]
