"""Exports whose heading is not their first line: motion captures, Blackbox Explorer, a line of units."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers.guessing import guess
from rotorid.recordings.importers.logfile import importer_of, read_log
from rotorid.recordings.importers.mapping import Mapping, read_by_mapping, read_columns
from tests.refusals import refused

TIME = np.arange(0, 20, 0.01)
PLACE = np.column_stack([np.sin(TIME), 1 + 0.1 * np.cos(3 * TIME), np.cos(TIME)])
TURN = np.column_stack([0.01 * np.sin(TIME), 0.02 * np.cos(TIME), 0 * TIME, 0 * TIME])
TURN[:, 3] = np.sqrt(1 - (TURN[:, :3] ** 2).sum(axis=1))


def rows(table: np.ndarray, sign: str = ",") -> str:
    return "\n".join(sign.join(f"{v:.6f}" for v in row) for row in table) + "\n"


def motive(bodies: int = 1, end: str = "\n") -> str:
    """Motive's export: lines of words above a heading that names columns alike."""
    kinds, names, ids, groups, axes = ["", ""], ["", ""], ["", ""], ["", ""], ["Frame", "Time (Seconds)"]
    for k in range(bodies):
        for group, letters in (("Rotation", "XYZW"), ("Position", "XYZ"), ("Mean Marker Error", " ")):
            for letter in letters:
                column = ("Rigid Body", f"Drone{k}", f"{k}", group, letter.strip())
                for row, cell in zip((kinds, names, ids, groups, axes), column, strict=True):
                    row.append(cell)
    head = ["Format Version,1.23,Take Name,a,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global", ""]
    head += [",".join(r) for r in (kinds, names, ids, groups, axes)]
    body = np.column_stack([np.arange(len(TIME)), TIME, *[np.column_stack([TURN, PLACE, 0 * TIME])] * bodies])
    return (("\n".join(head) + "\n") + rows(body)).replace("\n", end)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_motive(end: str, tmp_path: Path) -> None:
    path = tmp_path / "take.csv"
    path.write_bytes(motive(end=end).encode())
    table = read_columns(path)
    found = guess(table)
    assert found.mapping.channels["position"].columns == ("Position X", "Position Y", "Position Z")
    assert found.mapping.channels["time"].columns == ("Time (Seconds)",)
    assert found.mapping.channels["attitude"].columns == tuple(f"Rotation {a}" for a in "XYZW")
    assert found.mapping.channels["attitude"].form == "xyzw" and found.mapping.world != "enu"
    assert "Length Units" in " ".join(found.left_out)
    np.testing.assert_allclose(table["Position Y"], PLACE[:, 1], atol=1e-6)


def test_motive_of_two_bodies_names_each(tmp_path: Path) -> None:
    path = tmp_path / "take.csv"
    path.write_text(motive(2))
    names = list(read_columns(path))
    assert len(names) == len(set(names)) == 18 and all(any(f"{k} " in n for n in names[2:]) for k in (0, 1))


QTM = "NO_OF_FRAMES\t2000\nNO_OF_BODIES\t1\nFREQUENCY\t100\nTIME_STAMP\t2024-01-01, 12:00:00\nBODY_NAMES\tQuad\n"


def test_qtm(tmp_path: Path) -> None:
    path = tmp_path / "take.tsv"
    heading = "Frame\tTime\tX\tY\tZ\tRoll\tPitch\tYaw\tResidual\n"
    body = np.column_stack([np.arange(len(TIME)), TIME, 1000 * PLACE, 10 * TURN[:, :3], 0 * TIME])
    path.write_text(QTM + heading + rows(body, "\t"))
    found = guess(read_columns(path))
    assert found.mapping.channels["position"].columns == ("X", "Y", "Z")
    assert found.mapping.channels["attitude"].columns == ("Roll", "Pitch", "Yaw")


def test_an_export_without_a_heading_says_so(tmp_path: Path) -> None:
    path = tmp_path / "take.tsv"
    path.write_text(QTM + rows(np.column_stack([TIME, PLACE]), "\t"))
    refused("line 6: .*found numbers", read_columns, path)


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("t,ax,ay\n(s),(m/s2),(m/s2)\n", ["t (s)", "ax (m/s2)", "ay (m/s2)"]),
        ("t,ax,ay\ns,m/s2,m/s2\n", ["t s", "ax m/s2", "ay m/s2"]),
        ("my log\nt,ax,ay\n", ["t", "ax", "ay"]),
        ("# made by\n# somebody\n\nt,ax,ay\n", ["t", "ax", "ay"]),
        ("Test,7,Propeller,5x4\nt,ax,ay\n", ["t", "ax", "ay"]),
        ("a,b,c\n\nt,ax,ay\n", ["t", "ax", "ay"]),
        ("t,ax,ay\n", ["t", "ax", "ay"]),
    ],
)
def test_lines_above_a_heading_and_lines_of_units(head: str, names: list[str], tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text(head + rows(np.column_stack([TIME, TIME, PLACE[:, 0]])))
    table = read_columns(path)
    assert list(table) == names and len(table) == len(TIME)
    np.testing.assert_allclose(table[names[0]], TIME, atol=1e-6)


def test_a_cell_that_is_no_number_is_named_by_its_line_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text("my log\n\nt,ax\n0.0,1\n0.1,1\n0.2,1\n0.3,oops\n0.4,1\n")
    mapping = Mapping.model_validate({"channels": {"time": {"columns": ["t"]}}, "keep": ["ax"]})
    refused("line 7, column ax: expected a number, found 'oops'", read_by_mapping, path, mapping)
    path.write_text(path.read_text().replace("oops", "1"))
    _, faults, _ = read_by_mapping(path, mapping)
    assert "1 lines above the heading in line 3" in faults[0].sentence


EXPLORER = {
    "firmwareType": "3", "Firmware revision": '"Betaflight 4.5.1 (77d01ba3b) STM32F7X2"', "acc_1G": "2048",
    "gyroScale": "1.7453292519943295e-8", "motorOutput": '"158,2047"', "motor_poles": "12", "debug_mode": '""',
    "blackbox_high_resolution": "1",
}  # fmt: skip


@pytest.mark.parametrize("cut", [0, 9])
def test_blackbox_explorer(cut: int, tmp_path: Path) -> None:
    """The header of the log stands above the heading, so its units are known."""
    n = 1000
    table = {"loopIteration": np.arange(n), "time": 1e4 * np.arange(n)}
    table |= {f"gyroADC[{k}]": np.full(n, 573.0 * (k == 0)) for k in range(3)}
    table |= {f"accSmooth[{k}]": np.full(n, 2048.0 * (k == 2)) for k in range(3)}
    table |= {f"motor[{k}]": np.full(n, 1102.5) for k in range(4)} | {f"eRPM[{k}]": np.full(n, 30.0) for k in range(4)}
    table |= {"vbatLatest": np.full(n, 1600.0), "heading[0]": np.full(n, np.nan)}
    head = '"Product","Blackbox flight data recorder by Nicholas Sherlock"\n'
    head += "".join(f'"{k}",{v}\n' for k, v in EXPLORER.items())
    body = pd.DataFrame(table).to_csv(index=False, na_rep="NaN")
    path = tmp_path / "log.bbl.csv"
    path.write_text((head + body)[: -cut or None])
    assert importer_of(path).name == "betaflight"
    (run,) = read_log(path).runs.values()
    assert len(run) == n - (cut > 0)
    assert run[c.ANGULAR_VELOCITY[0]].mean() == pytest.approx(np.radians(57.3), rel=1e-6)
    assert run[c.SPECIFIC_FORCE[2]].mean() == pytest.approx(-9.80665)
    assert run["throttle_1"].mean() == pytest.approx(0.5)
    assert run["rotor_speed_1_rad_s"].mean() == pytest.approx(3000 / 6 * np.pi / 30)
    assert run[c.BATTERY_VOLTAGE].mean() == pytest.approx(16.0)
