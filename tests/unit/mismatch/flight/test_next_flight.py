"""What to do next: for the first open class, without a column that is recorded and without a number."""

import re
from dataclasses import replace

import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.describe import RECORDABLE, advice
from rotorid.mismatch.decide.findings import Finding, NextFlight, next_flight
from rotorid.recordings import RecordingSet, Run
from tests.unit.mismatch.flights import recorded


def of(name: str, *alternatives: str, status: str = "ambiguous") -> Finding:
    return Finding(name, status, alternatives=alternatives)


def with_column(recordings: RecordingSet, name: str) -> RecordingSet:
    """The set with one more column in every run."""
    runs = (Run(r.name, r.table.assign(**{name: 12.0})) for r in recordings.runs)
    return replace(recordings, runs=tuple(runs))


def test_only_an_open_class_is_worth_a_flight():
    recordings = recorded(1)
    assert next_flight([of("rotor_drag", status="established")], recordings) == NextFlight()
    first, second = of("rotor_drag", "frame_drag", "rotor_drag"), of("com_offset", "com_offset", "unequal_rotors")
    found = next_flight([of("payload", status="established"), first, second], recordings)
    assert found.separates == ("frame_drag", "rotor_drag") and "speed sweep" in found.manoeuvre


def test_a_column_that_is_recorded_is_not_asked_for():
    bare = recorded(1)
    sag = [of("battery_sag", "battery_sag", "throttle_curve")]
    assert "record the battery's voltage" in next_flight(sag, bare).manoeuvre
    asked = next_flight(sag, with_column(bare, "battery_voltage_v")).manoeuvre
    assert asked == "rest the battery and repeat the same hover"
    # A column in some of the runs alone is still worth recording.
    mixed = replace(bare, runs=(*with_column(bare, "battery_voltage_v").runs, Run("last", bare.runs[0].table)))
    assert "record the battery's voltage" in next_flight(sag, mixed).manoeuvre


@pytest.mark.parametrize("effect", [e for e in catalogue().values() if e.separating_columns], ids=lambda e: e.id)
def test_what_to_record_is_known_and_asked_for_where_it_lacks(effect):
    assert set(effect.separating_columns) <= set(RECORDABLE)
    for name in effect.separating_columns:
        words = RECORDABLE[name][0]
        assert words in advice(effect)
        full = recorded(1)
        for column in RECORDABLE[name][1](4):
            full = with_column(full, column)
        assert words not in advice(effect, full)


def test_no_manoeuvre_asks_for_a_column_by_itself():
    columns = "position|rotor speed|temperature|voltage|current"
    for effect in catalogue().values():
        assert not re.search(f"record[^,;]*({columns})|({columns})s? recorded", effect.separating_manoeuvre), effect.id
