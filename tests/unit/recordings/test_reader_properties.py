"""Properties of the readers: what is written comes back, and no bytes at all end in anything but one sentence.

Few examples by default; `HYPOTHESIS_PROFILE=long` tries many.
"""

import contextlib
import gzip
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rotorid.errors import InputError
from rotorid.io.text.writing import rounded
from rotorid.recordings import RecordingSet, Run, Vehicle, read_run, read_set, read_vehicle, write_set, write_vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.sufficient import sufficient
from tests.unit.recordings.wrong_inputs import RUN, VEHICLE, sound

LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"


def examples(few: int) -> Callable[[Any], Any]:
    """Number of examples of a test; the same ones each time."""
    return settings(
        max_examples=100 * few if LONG else few,
        deadline=None,
        derandomize=not LONG,
        database=None,
        suppress_health_check=list(HealthCheck),
    )


numbers = st.floats(-1e6, 1e6) | st.just(np.nan)
names = st.sampled_from([*sorted(c.FIXED - {c.TIME}), "my_sensor", "rotor_speed_1_rad_s", "throttle_4", "größe"])


@st.composite
def tables(draw: st.DrawFn) -> pd.DataFrame:
    """Any table that the contract allows."""
    count = draw(st.integers(2, 12))
    columns = {c.TIME: np.cumsum(draw(st.lists(st.floats(1e-4, 10.0), min_size=count, max_size=count)))}
    for name in draw(st.lists(names, unique=True, max_size=5)):
        columns[name] = np.array(draw(st.lists(numbers, min_size=count, max_size=count)))
    return pd.DataFrame(columns)


@st.composite
def vehicles(draw: st.DrawFn) -> Vehicle:
    """Any vehicle that flies."""
    positive = st.floats(1e-6, 10.0)
    xx, yy = draw(positive), draw(positive)
    count = draw(st.integers(1, 6))
    one = {"x_m": draw(st.floats(-1, 1)), "spin": draw(st.sampled_from(["ccw", "cw"]))}
    return Vehicle.model_validate(
        {
            "name": draw(st.text(st.characters(codec="utf-8", exclude_categories=["C"]), min_size=1, max_size=10)),
            "kind": "flight",
            "mass_kg": draw(positive),
            "inertia_kg_m2": {"xx": xx, "yy": yy, "zz": draw(st.floats(0.5, 1.0)) * (xx + yy)},
            "rotors": [one | {"y_m": 0.1 * k} for k in range(count)],
            "thrust_coefficient_n_s2": draw(st.lists(positive, min_size=count, max_size=count)),
            "torque_coefficient_n_m_s2": draw(positive),
            "trust": draw(st.dictionaries(st.sampled_from(["mass_kg", "inertia_kg_m2"]), st.floats(0, 1))),
        }
    )


@examples(15)
@given(table=tables(), suffix=st.sampled_from([".csv", ".csv.gz", ".parquet"]))
def test_a_run_that_is_written_comes_back_exactly(table: pd.DataFrame, suffix: str) -> None:
    vehicle = Vehicle(name="b", kind="bench")
    with tempfile.TemporaryDirectory() as place:
        folder = write_set(RecordingSet("set", vehicle, (Run("run", table),)), Path(place), suffix)
        again = read_run(folder / f"run{suffix}")
    pd.testing.assert_frame_equal(again.table, table, check_exact=True)


@examples(20)
@given(vehicle=vehicles())
def test_a_vehicle_that_is_written_comes_back_exactly(vehicle: Vehicle) -> None:
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "vehicle.yaml"
        write_vehicle(vehicle, path)
        assert read_vehicle(path) == vehicle


@examples(15)
@given(table=tables(), order=st.randoms(use_true_random=False))
def test_the_order_of_columns_is_no_matter(table: pd.DataFrame, order: Any) -> None:
    shuffled = list(table.columns)
    order.shuffle(shuffled)
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "run.csv"
        table[shuffled].to_csv(path, index=False)
        pd.testing.assert_frame_equal(read_run(path).table[list(table.columns)], table, check_exact=True)


def read_or_refuse(folder: Path) -> None:
    """Read a set; the only exception that may leave is one sentence."""
    with contextlib.suppress(InputError):
        sufficient(read_set(folder))


FILES = {
    "vehicle.yaml": VEHICLE.encode(),
    "run.csv": RUN.encode()[:4000],
    "run.csv.gz": gzip.compress(RUN.encode()[:4000], mtime=0),
    "split.yaml": b"held_out: [run]\n",
}


@pytest.mark.parametrize("name", FILES)
@examples(40)
@given(data=st.data())
def test_damage_to_a_file_ends_with_one_sentence_at_most(name: str, data: st.DataObject) -> None:
    content = bytearray(FILES[name])
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(content)))
        stop = data.draw(st.integers(start, min(start + 20, len(content))))
        content[start:stop] = data.draw(
            st.binary(max_size=12) | st.sampled_from([b"*a", b"&a ", b"[", b"{", b'"', b","])
        )
    with tempfile.TemporaryDirectory() as place:
        folder = sound(Path(place) / "set")
        if name == "run.csv.gz":
            (folder / "run.csv").unlink()
        (folder / name).write_bytes(bytes(content))
        read_or_refuse(folder)


@examples(10)
@given(data=st.data())
def test_damage_to_a_parquet_file_ends_with_one_sentence_at_most(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = sound(Path(place) / "set")
        path = folder / "run.parquet"
        read_run(folder / "run.csv").table.to_parquet(path, index=False)
        (folder / "run.csv").unlink()
        content = bytearray(path.read_bytes())
        for _ in range(3):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(bytes(content))
        read_or_refuse(folder)


yaml_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)


@examples(60)
@given(key=st.sampled_from([*Vehicle.model_fields, "else"]), value=yaml_values)
def test_no_value_of_any_key_ends_in_anything_but_one_sentence(key: str, value: Any) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = sound(Path(place) / "set")
        content = yaml.safe_load(VEHICLE) | {key: value}
        (folder / "vehicle.yaml").write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
        try:
            sufficient(read_set(folder))
        except InputError as error:
            assert str(error).isprintable()


@examples(50)
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_rounding_twice_is_rounding_once(value: float) -> None:
    once = rounded(value)
    assert rounded(once) == once and abs(once - value) <= 5.1e-6 * abs(value) + 5e-324
