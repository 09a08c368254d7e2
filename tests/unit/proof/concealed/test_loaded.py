"""A session recorded by the simulator of a bench or stand."""

import numpy as np
import pandas as pd
import pytest

from rotorid_proof.concealed import loaded


def test_draws_of_two_releases_differ() -> None:
    first, second = loaded.look_alikes("0285341c", 0), loaded.look_alikes("1285341c", 0)
    assert not {c.seed for c in first} & {c.seed for c in second}
    assert len({c.seed for c in first}) == len(first)


def test_a_bench_is_loaded_as_asked() -> None:
    case = next(c for c in loaded.look_alikes("development", 0) if c.truth == ("compliance",))
    _, answer, _ = loaded.make(case.settings, case.seed)
    t = np.arange(0, 12, 1 / case.settings.rate_hz)
    load = -8.0 * np.clip(np.minimum(t - 2, 10 - t), 0, 1)
    session = pd.DataFrame({"run": "step01", "time_s": t, "reference_force_z_n": load})
    (table,) = loaded.record(case, answer, session).runs.values()
    assert len(table) == len(t)
    assert table["reference_force_z_n"].to_numpy() == pytest.approx(load, abs=1e-9)
    assert table["force_z_n"].to_numpy() == pytest.approx(load, abs=1.0)


def test_a_stand_turns_as_asked_and_leans_as_asked() -> None:
    case = next(c for c in loaded.look_alikes("development", 0) if c.truth == ("com_offset",))
    _, answer, _ = loaded.make(case.settings, case.seed)
    t = np.arange(0, 12, 1 / case.settings.rate_hz)
    speed = {f"rotor_speed_{i + 1}_rad_s": np.full(len(t), 900.0 + 10 * i) for i in range(4)}
    session = pd.DataFrame({"run": "step01", "time_s": t, **speed, "roll_rad": 0.1, "pitch_rad": 0.0})
    (table,) = loaded.record(case, answer, session).runs.values()
    for name, values in speed.items():
        assert table[name].to_numpy() == pytest.approx(values, rel=0.01)
    assert (table["roll_rad"] == 0.1).all()
