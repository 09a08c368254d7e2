"""Tables of one's own, as `rotorid import` reads them: by the reader of sets, and nothing is lost in silence."""

import gzip
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import read_set
from rotorid.recordings.importers.guessing import guess
from rotorid.recordings.importers.logfile import read_log
from rotorid.recordings.importers.mapping import Mapping, read_by_mapping, read_columns
from tests.command_line import answer, refusal
from tests.refusals import refused
from tests.unit.recordings.wrong_inputs import LINES, RUN, SPEEDS, WIDTH, table

WORDS = table().assign(angular_velocity_x_rad_s="oops").to_csv(index=False)
DECIMAL_COMMAS = "\n".join([LINES[0], *(line.replace(".", ",") for line in LINES[1:])]) + "\n"
POINTS = RUN.replace(",", ";").replace(".", ",").replace("\n0,05;", "\n1.000,05;")
SHIFTED = "\n".join([LINES[0], *("7," + line for line in LINES[1:])]) + "\n"
CUT = RUN[:-40]
SUMMER_TIME = table().assign(time_s=lambda t: t["time_s"] + 3600 * (t["time_s"] > 5)).to_csv(index=False)
WRONG = (
    ("words in a column", WORDS, "line 2, column angular_velocity_x_rad_s: expected a number, found 'oops'"),
    ("a word in a cell", RUN.replace("0.05,", "soon,", 1), "line 3, column time_s: expected a number, found 'soon'"),
    ("decimal commas", DECIMAL_COMMAS, "the heading has 18 (are decimals written with commas? expected points)"),
    ("decimal commas and thousands' points", POINTS, "line 3, column time_s: expected a number, found '1.000,05'"),
    ("a cell too many at each start", SHIFTED, f"line 2: has {WIDTH + 1} cells, the heading has {WIDTH}"),
    ("a cell too many in a line", RUN.replace("\n0.05,", "\n0.05,7,"), f"line 3: has {WIDTH + 1} cells"),
    ("a column twice", RUN.replace("velocity_y_m_s", "velocity_x_m_s", 1), "column velocity_x_m_s is there twice"),
    ("no heading", "\n".join(LINES[1:]) + "\n", "line 1: expected the names of the columns, found numbers"),
    ("an underscore in a number", RUN.replace("\n0.05,", "\n0_0.05,"), "line 3, column time_s: expected a number"),
    ("a clock set to summer time", SUMMER_TIME, "line 103: time_s jumps by 3600.05 s"),
    ("a clock that stands still", table().assign(time_s=3.0).to_csv(index=False), "time_s moves on in 1 of 200 rows"),
)
MAPPING = Mapping.model_validate(
    {
        "channels": {
            "time": {"columns": ["time_s"], "unit": "s"},
            "angular_velocity": {"columns": [f"angular_velocity_{a}_rad_s" for a in "xyz"], "unit": "rad/s"},
            "rotor_speed": {"columns": list(SPEEDS), "unit": "rad/s"},
        }
    }
)


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gzipped"])
@pytest.mark.parametrize("mapping", [None, MAPPING], ids=["by names", "by mapping"])
@pytest.mark.parametrize(("text", "said"), [(text, said) for _, text, *said in WRONG], ids=[w[0] for w in WRONG])
def test_a_wrong_table_is_one_sentence(
    text: str, said: list[str], mapping: Mapping | None, packed: bool, tmp_path: Path
) -> None:
    path = tmp_path / ("own.csv.gz" if packed else "own.csv")
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    told = refused(None, read_by_mapping, path, mapping)
    assert told.startswith(str(path)) and told.isprintable() and all(words in told for words in said), told


@pytest.mark.parametrize("command", ["import", "verdict"])
@pytest.mark.parametrize("text", [WORDS, DECIMAL_COMMAS, SHIFTED], ids=["words", "commas", "shifted"])
def test_the_commands_say_so_and_write_nothing(command: str, text: str, tmp_path: Path) -> None:
    """Before: exit code 0, a column emptied, 797 of 800 rows dropped, columns moved by one."""
    path, out = tmp_path / "own.csv", tmp_path / "out"
    path.write_text(text)
    assert str(path) in refusal(command, path, "--like", "thesis", "-o", out) and not out.exists()


@pytest.mark.parametrize("sign", [",", ";", "\t", "|", " "], ids=["commas", "semicolons", "tabs", "bars", "blanks"])
def test_columns_may_be_separated_by_other_signs(sign: str, tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text(RUN.replace(",", sign))
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", None)
    pd.testing.assert_frame_equal(found, table())
    assert faults == []


@pytest.mark.parametrize("sign", [";", "\t", "|"], ids=["semicolons", "tabs", "bars"])
@pytest.mark.parametrize(
    "above", ["", "Logger 2;of today\n\n", "# one\n# two\n#"], ids=["plain", "lines above", "comment"]
)
def test_decimal_commas_are_read_where_no_comma_parts_columns(sign: str, above: str, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(above + RUN.replace(",", sign).replace(".", ","))
    pd.testing.assert_frame_equal(read_by_mapping(path, None)[0], table())


@pytest.mark.parametrize("mapping", [None, MAPPING], ids=["by names", "by mapping"])
@pytest.mark.parametrize("order", ["shuffled", "one late"])
def test_rows_that_come_late_are_sorted(mapping, order, tmp_path) -> None:
    own = table()
    late = pd.concat([own[:50], own[60:70], own[50:60], own[70:]])
    (own.sample(frac=1, random_state=1) if order == "shuffled" else late).to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", mapping)
    assert np.allclose(np.diff(found["time_s"]), 0.05)
    names = list(SPEEDS)
    np.testing.assert_array_equal(found[names], own[names])
    assert [f.kind for f in faults] == ["order"]


@pytest.mark.parametrize("mapping", [None, MAPPING], ids=["by names", "by mapping"])
@pytest.mark.parametrize("back", [3600.0, 5.0, 2.0, 0.5], ids=["an hour", "begins anew", "seconds", "half a second"])
def test_what_follows_a_clock_that_was_set_back_is_kept_behind_a_gap(mapping, back, tmp_path) -> None:
    """Before: rows were left out until the clock had caught up, and the flight jumped there within a step."""
    own = table()
    own.loc[100:, "time_s"] -= back
    own.to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", mapping)
    names, steps = list(SPEEDS), np.diff(found["time_s"])
    np.testing.assert_array_equal(found[names], own[names])
    assert np.allclose(np.delete(steps, 99), 0.05) and steps[99] > 1.0
    assert faults[0].kind == "clock_set_back" and f"{back - 0.05:.4g}" in faults[0].found


def test_rows_that_are_sent_twice_are_no_clock_set_back(tmp_path) -> None:
    own = table()
    pd.concat([own[:100], own[60:100], own[100:]]).to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", None)
    assert len(found) == len(own) and "clock_set_back" not in [f.kind for f in faults]


@pytest.mark.parametrize("seed", range(3))
def test_stamps_that_jitter_are_no_clock_set_back(seed: int, tmp_path) -> None:
    own = table()
    own["time_s"] += np.random.default_rng(seed).choice([0.0, 0.06], len(own), p=[0.98, 0.02])
    own.to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", None)
    assert len(found) == len(own) and "clock_set_back" not in [f.kind for f in faults]
    assert np.diff(found["time_s"]).max() < 0.2


def test_a_first_line_of_zeros_is_no_part_of_a_log(tmp_path) -> None:
    own = table().assign(time_s=lambda t: t["time_s"] + 1000)
    pd.concat([own[:1] * 0, own]).to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", None)
    assert np.allclose(found["time_s"], own["time_s"] - 1000) and [f.kind for f in faults] == ["apart"]


@pytest.mark.parametrize(("scale", "kept"), [([1, 1, -1, -1], [1, 1, 1, 1]), ([1, 1, -1, -1], [0.5, 1, 1, 1])])
def test_speeds_of_a_mapping_have_sizes_and_what_turns_backwards_is_told(scale, kept, tmp_path) -> None:
    own = table()
    signed = own.copy()
    signed[list(SPEEDS)] *= scale
    signed.loc[50 : 50 + 200 * (kept[0] < 1), SPEEDS[0]] *= np.sign(kept[0] - 0.7)
    signed.to_csv(tmp_path / "own.csv", index=False)
    found, faults, _ = read_by_mapping(tmp_path / "own.csv", MAPPING)
    np.testing.assert_allclose(found[SPEEDS[3]], own[SPEEDS[3]])
    told = [f.column for f in faults if "turns backwards" in f.found]
    assert told == ([SPEEDS[0]] if kept[0] < 1 else [])


def test_each_side_of_a_clock_that_was_set_back_is_a_run(tmp_path) -> None:
    own = table()
    own["time_s"] *= 2
    own.loc[100:, "time_s"] -= 2.0
    own.to_csv(tmp_path / "own.csv", index=False)
    assert list(read_log(tmp_path / "own.csv").runs) == ["own_1", "own_2"]


@pytest.mark.parametrize("sign", [";", "\t"], ids=["semicolons", "tabs"])
def test_commas_between_thousands_are_no_decimal_commas(sign: str, tmp_path: Path) -> None:
    """Before: a speed of 10,153 turns was 10.153."""
    path = tmp_path / "own.csv"
    thousands = [f"{10 + k // 1000},{k % 1000:03d}" for k in range(len(table()))]
    table().assign(turns=thousands).to_csv(path, sep=sign, index=False)
    refused("has '10,000' next to '0.0.*', expected nothing between thousands", read_by_mapping, path, None)


def test_a_column_without_a_name_is_kept_by_its_number(tmp_path: Path) -> None:
    """pandas writes the index so, and many a logger a separator at the end of each line."""
    path = tmp_path / "own.csv"
    table().to_csv(path)
    found, _, _ = read_by_mapping(path, None)
    assert found["column_1"].tolist() == list(range(200))


def test_text_that_no_channel_names_is_no_fault_and_the_proposal_says_what_it_leaves_out(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    table().assign(mode="HOVER", armed=True).to_csv(path, index=False)
    found, _, _ = read_by_mapping(path, MAPPING)
    assert found["angular_velocity_x_rad_s"].notna().all()
    found = guess(read_columns(path))
    assert "mode" not in found.mapping.keep and "armed" in found.mapping.keep
    assert any(re.search(r"column mode: .*'HOVER'", sentence) for sentence in found.left_out)


def test_a_parquet_is_read_by_the_same_rules(tmp_path: Path) -> None:
    path = tmp_path / "own.parquet"
    table().assign(velocity_x_m_s="oops").to_parquet(path, index=False)
    refused("row 1, column velocity_x_m_s: expected a number, found 'oops'", read_by_mapping, path, None)
    assert read_by_mapping(path, MAPPING)[0]["angular_velocity_x_rad_s"].notna().all()


def test_a_log_with_a_jump_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text(SUMMER_TIME)
    refusal("import", tmp_path / "own.csv", "--like", "thesis", "-o", tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_sound_table_comes_back_exactly(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text(RUN)
    answer("import", tmp_path / "own.csv", "--like", "thesis", "-o", tmp_path / "set")
    again = read_set(tmp_path / "set").runs[0].table
    np.testing.assert_array_equal(again.to_numpy(), table().to_numpy())


@pytest.mark.parametrize("cut", range(1, 120, 7))
@pytest.mark.parametrize("quoted", [False, True])
def test_a_last_line_that_is_cut_off_is_left_out_and_named(cut: int, quoted: bool, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    text = RUN.replace("time_s", '"time_s"', 1) if quoted else RUN
    path.write_text(text.rstrip()[:-cut])
    found, faults, _ = read_by_mapping(path, None)
    whole = path.read_text().count("\n") - 1 + (path.read_text().rsplit("\n", 1)[1].count(",") == WIDTH - 1)
    assert len(found) == whole
    assert any("cut off" in f.sentence for f in faults) == (whole < len(LINES) - 1)
