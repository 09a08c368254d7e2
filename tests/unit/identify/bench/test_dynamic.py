"""Dynamic tests: which recordings are one set, and that two flights are never taken for one."""

import numpy as np
import pandas as pd
import pytest

from rotorid.errors import InputError
from rotorid_lab.bench_tests import agreement, sets_of


def sessions(*rows: tuple[str, str, str, int]) -> pd.DataFrame:
    """Recordings (id, group, platform, repeat), a minute after each other."""
    table = pd.DataFrame(rows, columns=["id", "group", "platform", "repeat"])
    return table.assign(started=[f"2024-03-06T09:{minute:02d}:00" for minute in range(len(table))])


def test_a_set_is_one_repeat_on_each_platform() -> None:
    flown = sessions(("a1", "s1", "al", 1), ("p1", "s1", "pla", 1), ("a2", "s2", "al", 2), ("p2", "s2", "pla", 2))
    assert sets_of(flown) == {"a1": 1, "p1": 1, "a2": 2, "p2": 2}
    alone = sessions(("a1", "a1", "al", 1), ("p1", "p1", "pla", 1))
    assert sets_of(alone) == {"a1": 1, "p1": 1}


def test_one_more_flight_of_a_platform_is_a_set_of_its_own() -> None:
    """Before: its samples were joined to those of the flight that was there, and both judged as one."""
    flown = sessions(("a1", "s1", "al", 1), ("p1", "s1", "pla", 1), ("a2", "s2", "al", 2), ("p9", "mine", "pla", 1))
    later = flown["id"] == "p9"
    flown.loc[later, "started"] = "2024-03-07T09:00:00"
    assert sets_of(flown) == {"a1": 1, "p1": 1, "a2": 2, "p9": 3}


def test_a_platform_twice_in_a_group_is_refused() -> None:
    with pytest.raises(InputError, match="p1, p2: group s1 holds the same platform and repeat twice"):
        sets_of(sessions(("p1", "s1", "pla", 1), ("p2", "s1", "pla", 1)))


def test_a_set_without_the_base_compares_nothing() -> None:
    time_s = np.arange(0, 6, 0.02)
    thrust = np.where((time_s > 1) & (time_s < 5), 0.5, 0.0)
    flight = {"time_s": time_s, "thrust_n": thrust, "zero_phase_n": thrust}
    flown = [pd.DataFrame(flight | {"set": n, "platform": p}) for n, p in ((1, "al"), (1, "pla"), (2, "pla"))]
    assert set(agreement(pd.concat(flown, ignore_index=True))["set"]) == {1}
