"""The report's tables from raw logs, recomputed by other code: a decoder of a page, numpy, and nothing of the project.

The means here are plainer than the pipeline's (no filters, no search for what is steady), so that numbers agree within
a stated part of their own uncertainty, and not to the last digit.
"""

import binascii
import csv
import gzip
import json
import re
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

pytestmark = pytest.mark.slow

GF_N = 9.80665e-3
FORMATS = {"bench": "<6i", "rotor": "<HHiHH", "wrench": "<6h", "jr3": "<6i", "quadrotor": "<5HB", "tensile": "<2i"}
"""A sample of each instrument (docs/wire-formats.md)."""
VOLTS_PER_COUNT = 2 * 2.5 / 64 / (2**23 - 1)
TARGETS = (
    "results/calibration/thesis.json", "results/calibration/campaign.json", "results/bench/static_series.csv",
    "results/bench/reconstruction.json", "results/bench/tensile.csv", "results/white_box/parameters.json",
    "results/stand/experiments.csv", "results/stand/weight.json", "results/grey_box/rotor.json",
)  # fmt: skip
STUDENT_975 = {6: 2.446912, 19: 2.093024, 22: 2.073873, 49: 2.009575, 78: 1.990847, 2: 4.302653}
"""Upper 2.5 % points of Student's t by degrees of freedom, from a printed table."""


def uncobs(block: bytes) -> bytes:
    out, i = bytearray(), 0
    while i < len(block):
        code = block[i]
        out += block[i + 1 : i + code]
        i += code
        if i < len(block) and code < 255:
            out.append(0)
    return bytes(out)


class Log(NamedTuple):
    """The samples of a raw log."""

    time: np.ndarray
    """Device's time since the first one, s, shape (n,)."""
    host: np.ndarray
    """When the host read it, s, shape (n,)."""
    number: np.ndarray
    """Of its frame, by which marks are given, shape (n,)."""
    counts: np.ndarray
    """Shape (n, k)."""


def decoded(path: Path, instrument: str) -> Log:
    """A raw log; every checksum is looked at, and a frame without its own is left out."""
    data = gzip.decompress(path.read_bytes())
    assert data.startswith(b"ROTORLOG1\n")
    place, line, frames = len(b"ROTORLOG1\n"), b"", []
    while place < len(data):
        tag, host_ns, length = struct.unpack_from("<BQH", data, place)
        chunk = data[place : place + 11 + length + 2]
        assert binascii.crc_hqx(chunk[:-2], 0xFFFF) == struct.unpack("<H", chunk[-2:])[0]
        place += len(chunk)
        if tag == ord("R"):
            line += chunk[11:-2]
            *whole, line = line.split(b"\0")
            frames += [(host_ns, uncobs(part)) for part in whole if part]
    clock, host, number, counts, turns, last = [], [], [], [], 0, 0
    for host_ns, frame in frames:
        whole = len(frame) > 8 and binascii.crc_hqx(frame[:-2], 0xFFFF) == struct.unpack("<H", frame[-2:])[0]
        if not whole or frame[0] != ord("D"):
            continue
        sequence, ticks = struct.unpack_from("<HI", frame, 1)
        if number and sequence == number[-1]:  # a frame that was sent twice
            continue
        turns += ticks < last
        last = ticks
        clock.append((ticks + turns * 2**32) / 1e6)
        host.append(host_ns / 1e9)
        number.append(sequence)
        counts.append(struct.unpack(FORMATS[instrument], frame[7:-2]))
    return Log(np.array(clock) - clock[0], np.array(host), np.array(number), np.array(counts, float))


class Campaign:
    """Index, logs and marks of the campaign."""

    def __init__(self, raw: Path) -> None:
        self.raw = raw
        with (raw / "sessions.tsv").open(newline="") as lines:
            self.rows = [row for row in csv.DictReader(lines, delimiter="\t") if row["file"]]

    def of(self, kind: str, **wanted: str) -> list[dict[str, str]]:
        return [r for r in self.rows if r["kind"] == kind and all(r[k] == v for k, v in wanted.items())]

    def log(self, row: dict[str, str]) -> Log:
        log = decoded(self.raw / row["file"], row["instrument"])
        assert len(log.time) == int(row["samples"])
        return log

    def meta(self, row: dict[str, str]) -> str:
        return (self.raw / row["metadata"]).read_text()

    def mark(self, row: dict[str, str], name: str) -> int | None:
        found = re.search(rf"^  '?{name}'?: (\d+)$", self.meta(row), re.MULTILINE)
        return int(found[1]) if found else None

    def loaded(self, row: dict[str, str]) -> tuple[np.ndarray, np.ndarray]:
        """Counts at rest and under load, each the mean over plain ranges of a recording, shape (k,)."""
        log = self.log(row)

        def mean(first: int, last: int) -> np.ndarray:
            return log.counts[(log.number >= first) & (log.number <= last)].mean(axis=0)

        if (load := self.mark(row, "tare_start")) is None:
            load = self.mark(row, "load")
            return mean(log.number[10], load - 2), mean(load + 60, log.number[-1])
        return mean(load, self.mark(row, "tare_stop")), mean(self.mark(row, "read_start"), self.mark(row, "read_stop"))


def line(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float]:
    """Intercept, slope and their standard errors."""
    dx = x - x.mean()
    slope = dx @ y / (dx @ dx)
    left = y - y.mean() - slope * dx
    variance = left @ left / (len(x) - 2)
    errors = np.sqrt(variance * (1 / len(x) + x.mean() ** 2 / (dx @ dx))), np.sqrt(variance / (dx @ dx))
    return float(y.mean() - slope * x.mean()), float(slope), float(errors[0]), float(errors[1])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the pipeline on the campaign, with the settings of the report."""
    from copied_project import Project

    project = Project(tmp_path_factory.mktemp("tables") / "project")
    project.snakemake(*TARGETS, "--configfile", "config.yaml")
    return project.root


@pytest.fixture(scope="module")
def campaign(made: Path) -> Campaign:
    return Campaign(made / "raw")


def result(made: Path, name: str):
    path = made / "results" / name
    if path.suffix == ".json":
        return json.loads(path.read_text())
    with path.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_the_thesis_calibration(made: Path) -> None:
    rows = list(csv.reader((made / "raw/thesis/table_2_7.csv").open(newline="")))[1:]
    weights = np.array([float(row[1]) for row in rows])
    for cell in result(made, "calibration/thesis.json")["cells"]:
        reading = np.array([float(row[1 + cell["cell"]]) for row in rows])
        a0, a1, e0, e1 = line(reading, weights)
        assert (cell["a0_gf"], cell["a1_gf_per_10uv"]) == pytest.approx((a0, a1), rel=1e-9, abs=1e-9)
        t = STUDENT_975[6]
        assert cell["a0_interval_95"] == pytest.approx([a0 - t * e0, a0 + t * e0], rel=1e-5)
        assert cell["a1_interval_95"] == pytest.approx([a1 - t * e1, a1 + t * e1], rel=1e-7)
        assert cell["r"] == pytest.approx(np.corrcoef(reading, weights)[0, 1], abs=1e-12)


def calibration(campaign: Campaign) -> dict[int, tuple[float, float, float, float]]:
    lines = {}
    for cell in range(1, 7):
        rows = campaign.of("calibration", cell=str(cell))
        assert len(rows) == 24
        ends = [campaign.loaded(row) for row in rows]
        reading = np.array([(high - low)[cell - 1] for low, high in ends]) * VOLTS_PER_COUNT / 1e-5
        lines[cell] = line(reading, np.array([float(row["load_gf"]) for row in rows]))
    return lines


def test_the_campaigns_calibration(made: Path, campaign: Campaign) -> None:
    found = {cell["cell"]: cell for cell in result(made, "calibration/campaign.json")["cells"]}
    for cell, (a0, a1, _, e1) in calibration(campaign).items():
        assert found[cell]["a1_gf_per_10uv"] == pytest.approx(a1, abs=0.1 * e1)
        assert found[cell]["a0_gf"] == pytest.approx(a0, abs=0.005)
        half = np.ptp(found[cell]["a1_interval_95"]) / 2
        assert half == pytest.approx(STUDENT_975[22] * e1, rel=0.05)


def reconstructed(made: Path, cells_n: np.ndarray) -> np.ndarray:
    """Equations 2.3 to 2.8 of the thesis, from the paper; cells (n, 6) and forces (n, 3) in N."""
    rows = list(csv.DictReader((made / "raw/thesis/table_2_3.csv").open(newline="")))
    d = {row["distance"]: float(row["value_mm"]) / 1000 for row in rows}
    c30, c45, c60 = (np.cos(np.radians(angle)) for angle in (30, 45, 60))
    f1, f2, f3, f4, f5, f6 = cells_n.T
    about_x = (f1 - f5) / c30 * d["D_135z"] + (f2 / (c60 * c45) - f4 / c45 + f6 / (c60 * c45)) * d["D_246z"]
    about_x += (f2 * d["D_2y"] + f4 * d["D_4y"] - f6 * d["D_6y"]) / c45
    about_y = ((f1 + f5) / c60 - f3) * d["D_135z"] + (f6 - f2) / (c30 * c45) * d["D_246z"]
    about_y += (f2 * d["D_2x"] - f4 * d["D_4x"] - f6 * d["D_6x"]) / c45
    along_z = -(np.abs(f1) + np.abs(f3) + np.abs(f5) + (f2 + f4 + f6) / c45)
    return np.column_stack([-about_y / d["L"], about_x / d["L"], along_z])


def bench_forces(made: Path, campaign: Campaign, rows: list[dict[str, str]]) -> np.ndarray:
    lines = calibration(campaign)
    per_count = np.array([lines[cell][1] for cell in range(1, 7)]) * VOLTS_PER_COUNT / 1e-5 * GF_N
    ends = [campaign.loaded(row) for row in rows]
    return reconstructed(made, np.array([(high - low) * per_count for low, high in ends]))


def direction(row: dict[str, str]) -> np.ndarray:
    """Of a load along one axis, or in equal parts along several, shape (3,)."""
    along = np.array([float(axis in row["axis"]) for axis in "xyz"])
    return along / np.linalg.norm(along)


@pytest.mark.parametrize(("platform", "axis"), [("al", "x"), ("al", "y"), ("al", "z"), ("pla", "z"), ("jr3", "z")])
def test_static_tests(made: Path, campaign: Campaign, platform: str, axis: str) -> None:
    rows = campaign.of("static", platform=platform, axis=axis)
    assert len(rows) == 80
    if platform == "jr3":
        ends = [campaign.loaded(row) for row in rows]
        forces = np.array([(high - low)[:3] for low, high in ends]) * 0.01
    else:
        forces = bench_forces(made, campaign, rows)
    applied = np.array([float(row["load_gf"]) for row in rows]) * GF_N
    along = forces[:, "xyz".index(axis)]
    along = along * np.sign(along.mean())
    (printed,) = (
        row
        for row in result(made, "bench/static_series.csv")
        if (row["platform"], row["axis"]) == (platform, axis) and row["method"] in ("equations", "sensor")
    )
    _, slope, _, error = line(applied, along)
    assert float(printed["slope"]) == pytest.approx(slope, abs=0.05 * error)
    assert float(printed["slope_high_95"]) - slope == pytest.approx(STUDENT_975[78] * error, rel=0.1)
    assert float(printed["rms_error_n"]) == pytest.approx(np.sqrt(np.mean((along - applied) ** 2)), rel=0.1)
    across = np.delete(forces, "xyz".index(axis), axis=1)
    assert float(printed["across_n"]) == pytest.approx(np.linalg.norm(across, axis=1).mean(), rel=0.1, abs=0.01)


def test_a_matrix_from_single_loads_gives_combined_ones(made: Path, campaign: Campaign) -> None:
    """Least squares of readings on loads along one axis up to 5 N, without weights, on loads along several axes."""
    sense = {}
    single = []
    for k, axis in enumerate("xyz"):
        rows = campaign.of("static", platform="al", axis=axis)
        sense[axis] = np.sign(bench_forces(made, campaign, rows)[:, k].mean())
        single += [row for row in rows if float(row["load_gf"]) * GF_N <= 5.0]
    combined = campaign.of("combined")
    assert len(combined) == 60
    signs = np.array([sense[axis] for axis in "xyz"])

    def loads(rows: list[dict[str, str]]) -> np.ndarray:
        return np.array([float(row["load_gf"]) * GF_N * direction(row) * signs for row in rows])

    def readings(rows: list[dict[str, str]]) -> np.ndarray:
        return np.array([high - low for low, high in map(campaign.loaded, rows)])

    answer = np.linalg.lstsq(loads(single), readings(single), rcond=None)[0]
    applied = loads(combined)
    by_matrix = readings(combined) @ np.linalg.pinv(answer)
    by_equations = bench_forces(made, campaign, combined)
    printed = result(made, "bench/reconstruction.json")["methods"]["several_axes"]
    for name, forces, allowed in (("matrix", by_matrix, 0.25), ("equations", by_equations, 0.02)):
        share = np.linalg.norm(forces - applied, axis=1) / np.linalg.norm(applied, axis=1)
        assert printed[name]["rms_share_of_load"] == pytest.approx(np.sqrt(np.mean(share**2)), rel=allowed)


def steady_thrust(campaign: Campaign, row: dict[str, str]) -> tuple[float, float]:
    time, _, _, counts = campaign.log(row)
    on = np.flatnonzero(counts[:, 0] > 0)
    start, stop = time[on[0]], time[on[-1]]
    steady = (time > start + 0.6) & (time < stop - 0.2)
    return counts[steady, 1].mean() * 2 * np.pi / 60, (
        counts[steady, 2].mean() - counts[time < start - 0.05, 2].mean()
    ) * 1e-3


def steady_torque(campaign: Campaign, drive: dict[str, str]) -> tuple[float, float]:
    time, host, _, counts = campaign.log(drive)
    on = np.flatnonzero(counts[:, 0] > 0)
    steady = (time > time[on[0]] + 0.6) & (time < time[on[-1]] - 0.6)
    (sensor,) = campaign.of("torque", group=drive["group"], instrument="wrench")
    began = [int(re.search(r"^host_start_ns: (\d+)$", campaign.meta(row), re.MULTILINE)[1]) for row in (drive, sensor)]
    _, seen, _, felt = campaign.log(sensor)
    seen = seen + (began[1] - began[0]) / 1e9
    moment = felt[:, 5] * 1e-3
    turning = (seen > host[on[0]] + 0.7) & (seen < host[on[-1]] - 0.7)
    rest = (moment[seen < host[on[0]] - 0.2].mean() + moment[seen > host[on[-1]] + 0.8].mean()) / 2
    return counts[steady, 1].mean() * 2 * np.pi / 60, abs(moment[turning].mean() - rest)


@pytest.mark.parametrize(("name", "kind", "number"), [("c_f", "thrust", 50), ("c_q", "torque", 20)])
def test_rotor_coefficients(made: Path, campaign: Campaign, name: str, kind: str, number: int) -> None:
    rows = campaign.of(kind, instrument="rotor")
    assert len(rows) == number
    take = steady_thrust if kind == "thrust" else steady_torque
    points = np.array([take(campaign, row) for row in rows])
    x, y = points[:, 0] ** 2, points[:, 1]
    value = x @ y / (x @ x)
    left = y - value * x
    error = np.sqrt(left @ left / (number - 1) / (x @ x))
    printed = result(made, "white_box/parameters.json")[name]
    assert printed["value"] == pytest.approx(value, abs=0.5 * error)
    assert np.ptp(printed["interval_95"]) / 2 == pytest.approx(STUDENT_975[number - 1] * error, rel=0.15)
    assert printed["residual_rms"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=0.15)


def test_tensile_strength_and_modulus(made: Path, campaign: Campaign) -> None:
    section_mm2, gauge_mm = 19.2, 40.0
    for printed in result(made, "bench/tensile.csv"):
        strengths, moduli = [], []
        for row in campaign.of("tensile", infill_percent=printed["infill_percent"]):
            counts = campaign.log(row).counts
            moved, force = counts[:, 0] * 1e-4, counts[:, 1] * 0.1
            strengths.append(force.max() / section_mm2)
            straight = (
                (force > 0.05 * force.max()) & (force < 0.2 * force.max()) & (np.arange(len(force)) < force.argmax())
            )
            moduli.append(line(moved[straight], force[straight])[1] * gauge_mm / section_mm2 / 1000)
        assert len(strengths) == 3
        assert float(printed["strength_mpa"]) == pytest.approx(np.mean(strengths), rel=1e-3)
        half = STUDENT_975[2] * np.std(strengths, ddof=1) / np.sqrt(3)
        assert float(printed["strength_mpa_high_95"]) == pytest.approx(np.mean(strengths) + half, rel=1e-3)
        assert float(printed["modulus_gpa"]) == pytest.approx(np.mean(moduli), rel=0.03)


def test_wrenches_of_the_stand(made: Path, campaign: Campaign) -> None:
    """Means over the middle of each plateau; the sines are left out (their mean needs whole cycles)."""
    columns = ["force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m"]
    scale = np.array([0.1, 0.1, 0.1, 1e-3, 1e-3, 1e-3])
    seen, weights = 0, []
    for printed in result(made, "stand/experiments.csv"):
        if printed["kind"] != "plateau":
            continue
        (vehicle,) = campaign.of("dynamics", group=printed["name"], instrument="quadrotor")
        (sensor,) = campaign.of("dynamics", group=printed["name"], instrument="wrench")
        _, host, _, sent = campaign.log(vehicle)
        _, when, _, felt = campaign.log(sensor)
        total = sent[:, :4].sum(axis=1)
        plateau, turning = host[total == total.max()], host[total > 0]
        middle = (when > plateau[0] + 0.8) & (when < plateau[-1] - 0.3)
        before, after = when < turning[0] - 0.3, when > turning[-1] + 0.8
        rest = (felt[before].mean(axis=0) + felt[after].mean(axis=0)) / 2 * scale
        mean = felt[middle].mean(axis=0) * scale - rest
        for column, own in zip(columns, mean, strict=True):
            half = float(printed[f"{column}_half_95"])
            assert float(printed[column]) == pytest.approx(own, abs=half + 0.001 * abs(own)), (printed["name"], column)
        weights.append(rest[2])
        seen += 1
    assert seen == 45
    assert result(made, "stand/weight.json")["mass_kg"] == pytest.approx(np.mean(weights) / 9.81, abs=5e-4)


@pytest.mark.parametrize("name", ["c_f", "c_q"])
def test_the_networks_coefficients_are_their_weights_and_end_at_least_squares(made: Path, name: str) -> None:
    found = result(made, "grey_box/rotor.json")[name]
    own = np.dot(found["w1"], found["w2"]) * found["k_x"] ** 2 / found["k_d"]
    assert found["network"] == pytest.approx(own, rel=1e-9)
    assert own == pytest.approx(result(made, "white_box/parameters.json")[name]["value"], rel=1e-5)
