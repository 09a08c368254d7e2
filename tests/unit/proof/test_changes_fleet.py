"""What counts as right in a fleet's history: the change that is there, since the flight that first has it."""

import pandas as pd
import pytest

from rotorid.report.fleet import EVENTS
from rotorid_proof.changes import fleet
from rotorid_proof.concealed import pairs

TRUTH = {
    "changes": [{"id": "mass_kg", "parameters": [], "equivalent": [], "need_not_be_found": False}],
    "fair": ["payload"],
}


@pytest.mark.parametrize(
    ("since", "events", "right", "others"),
    [
        (4, [(4, "lift/all")], 1, 0), (4, [(4, "share/1")], 0, 1), (4, [], 0, 0), (4, [(5, "lift/all")], 0, 1),
        (4, [(4, "lift/all"), (6, "noise/gyroscope")], 0, 1), (None, [], 1, 0), (None, [(7, "lift/all")], 0, 1),
    ],
)  # fmt: skip
def test_the_change_since_its_first_flight_and_nothing_else(monkeypatch, since, events, right, others):
    stated = pd.DataFrame([{"set": fleet.day_of(day), "id": name} for day, name in events], columns=EVENTS)
    truth = TRUTH if since is not None else {"changes": [], "fair": []}
    monkeypatch.setattr(pairs, "flown", lambda *args: pairs.Flown((), since, truth))
    monkeypatch.setattr(fleet, "history", lambda sets, good: (None, stated))
    row = fleet.row_of(fleet.Case("a/001"))
    assert (row.right, row.others, row.compared) == (right, others, 7)
