"""A payload on a cable that the second set alone carries."""

import pytest

from rotorid.mismatch.changes.compare import changes_between
from tests.unit.mismatch.flights import recorded


@pytest.mark.slow
def test_a_payload_that_came_to_hang_below_the_vehicle_is_named_with_its_mass():
    """80 g on 0.6 m below a vehicle of 652 g that is thrown about, out to the side when the recording begins."""
    without = recorded(1, 2, flight={"excitation": 1.5})
    carrying = recorded(3, 4, flight={"load": (0.08, 0.6), "excitation": 1.5})
    (payload,) = [c for c in changes_between(without, carrying).changes if c.status == "established"]
    assert payload.id == "payload"
    mass = next(p for p in payload.parameters if p.symbol == "m_p")
    assert mass.value == pytest.approx(0.08, rel=0.1) and mass.low < 0.08 < mass.high


@pytest.mark.slow
def test_without_a_payload_nothing_hangs():
    found = changes_between(recorded(1, 2), recorded(3, 4, flight={"excitation": 1.5}))
    assert "payload" not in {i for c in found.changes for i in (c.id, *c.alternatives)}
