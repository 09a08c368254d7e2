"""A table read in pieces is the table, is in the memory once, and may be text as Windows writes it."""

import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import tables
from rotorid.recordings.files import read_run
from rotorid.recordings.importers.mapping import Mapping, read_by_mapping
from rotorid.recordings.tables import numbers, read_cells
from tests.refusals import refused

MIXED = "time_s,count,word,truth,late,empty\n" + "\n".join(
    f"{0.5 * k},{k},{'a' if k % 3 else 'b'},{k > 7},{k if k < 17 else 'NONE'},{'' if k < 12 else k}" for k in range(40)
)


def in_pieces(path: Path, cells: int, monkeypatch: pytest.MonkeyPatch, **how) -> pd.DataFrame:
    monkeypatch.setattr(tables, "_PIECE_CELLS", cells)
    return read_cells(path, **how)


def test_pieces_are_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.csv"
    path.write_text(MIXED)
    whole = in_pieces(path, 10**6, monkeypatch)
    for rows in (1, 7, 16, 39):
        pieces = in_pieces(path, rows * len(whole.columns), monkeypatch)
        assert list(pieces) == list(whole) and len(pieces) == len(whole) == 40
        for name in ("time_s", "count", "late", "empty"):
            np.testing.assert_array_equal(numbers(pieces[[name]], path)[name], numbers(whole[[name]], path)[name])
        assert pieces["word"].tolist() == whole["word"].tolist() and pieces["truth"].tolist() == whole["truth"].tolist()


def test_truths_among_numbers_stay_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,height_m\n" + "\n".join(f"{k},{k if k < 6 else 'True'}" for k in range(12)))
    for rows in (2, 5, 100):
        said = refused(None, numbers, in_pieces(path, 2 * rows, monkeypatch), path)
        assert "line 8, column height_m" in said and "True" in said


def test_decimal_commas_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.csv"
    path.write_text("t;a\n" + "\n".join(f"{k},5;{'-' if k == 9 else f'{k},25'}" for k in range(12)))
    table = in_pieces(path, 6, monkeypatch, foreign=True)
    assert table["t"].tolist() == [k + 0.5 for k in range(12)]
    assert [float(v) for v in table["a"].drop(9)] == [k + 0.25 for k in range(12) if k != 9]


def test_only_the_columns_that_are_used(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("t,gx,gy,gz,note,more\n" + "\n".join(f"{k / 100},1,2,3,words,9" for k in range(50)))
    assert list(read_cells(path, used=("gx", "t"))) == ["t", "gx"]
    rate = {"columns": ["gx", "gy", "gz"], "unit": "rad/s"}
    mapping = {"channels": {"time": {"columns": ["t"], "unit": "s"}, "angular_velocity": rate}, "keep": ["more"]}
    table = read_by_mapping(path, Mapping.model_validate(mapping))[0]
    assert table["more"].eq(9).all() and len(table.columns) == 5
    mapping["keep"] = ["mor"]
    assert "did you mean more?" in refused(None, read_by_mapping, path, Mapping.model_validate(mapping))


def test_a_run_is_in_the_memory_once(tmp_path: Path) -> None:
    path, rows, columns = tmp_path / "r.csv", 400_000, 12
    names = ",".join(f"other_{k}" for k in range(1, columns))
    line = ",".join(["1.5"] * (columns - 1))
    path.write_text(f"time_s,{names}\n" + "".join(f"{k / 1000},{line}\n" for k in range(rows)))
    tracemalloc.start()
    try:
        run = read_run(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert run.table.shape == (rows, columns)
    assert most < 2.0 * 8 * rows * columns + 50e6


def test_latin_1_is_read_and_said(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    text = "t,gx (°/s),gy (°/s),gz (°/s),Höhe\n" + "\n".join(f"{k / 100},90,2,3,{k}" for k in range(50))
    found = {}
    for encoding in ("utf-8", "cp1252"):
        path.write_bytes(text.encode(encoding))
        rate = {"columns": ["gx (°/s)", "gy (°/s)", "gz (°/s)"], "unit": "deg/s"}
        mapping = {"channels": {"time": {"columns": ["t"], "unit": "s"}, "angular_velocity": rate}, "keep": ["Höhe"]}
        table, faults, _ = read_by_mapping(path, Mapping.model_validate(mapping))
        assert [f.kind for f in faults] == ([] if encoding == "utf-8" else ["encoding"])
        found[encoding] = table
    pd.testing.assert_frame_equal(found["utf-8"], found["cp1252"])
    assert found["cp1252"]["angular_velocity_x_rad_s"].iloc[0] == pytest.approx(np.pi / 2)
    path.write_bytes(text.encode("cp1252") + b"\n0.6,\x81,2,3,4")  # no sign of Windows' table
    assert "0x81" in refused(None, read_cells, path, foreign=True)


def test_latin_1_in_quotes(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_bytes(('"t";"Höhe"\n' + "\n".join(f'"{k},5";"{k},25"' for k in range(9))).encode("cp1252"))
    assert read_cells(path, foreign=True)["Höhe"].tolist() == [k + 0.25 for k in range(9)]
