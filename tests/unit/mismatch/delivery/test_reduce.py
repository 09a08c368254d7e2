"""The model of a flight with fewer of its parts."""

from rotorid.mismatch.delivery.usable import with_only
from rotorid.mismatch.model.fitted import fitted
from rotorid.mismatch.model.prepare import prepare
from rotorid.mismatch.plant.rows import Term
from rotorid.mismatch.plant.split import parts_of, split_runs
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
