"""The campaign: the same bytes twice, all of it there, and the thesis's numbers in it."""

import csv
import gzip
import hashlib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from rotorid_acquire.campaign import COMBINATIONS, PARTS, run_campaign, weight_gf
from rotorid_acquire.emulators.truth import SLOPE, body_forces, cell_forces
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.session import read_index, read_session

RAW = Path(__file__).parents[2] / "raw"
SEALED = Path(__file__).parents[1] / "sealed" / "campaign_truth.yaml"


def quiet(text: str) -> None:
    """The campaign's progress is not wanted here."""


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def index():
    return [row for row in read_index(RAW) if row["file"].startswith("campaign/")]


def test_the_same_seed_gives_the_same_bytes_and_another_gives_others(tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        run_campaign(tmp_path / name / "raw", tmp_path / name / "sealed.yaml", seed, ["tensile"], say=quiet)
    a, b, c = (all_bytes(tmp_path / name) for name in "abc")
    assert a == b and a != c and len(a) == 2 * 12 + 3


def test_the_truth_may_not_lie_in_raw(tmp_path):
    with pytest.raises(ValueError, match="must lie outside"):
        run_campaign(tmp_path, tmp_path / "deep" / "sealed.yaml", 5, [], say=quiet)


def test_the_committed_campaign_is_what_the_recorders_make(tmp_path):
    run_campaign(tmp_path / "raw", tmp_path / "sealed.yaml", parts=["tensile"], say=quiet)
    for path in sorted((tmp_path / "raw" / "campaign" / "tensile").glob("*.yaml")):
        assert path.read_bytes() == (RAW / "campaign" / "tensile" / path.name).read_bytes()
    assert (tmp_path / "sealed.yaml").read_bytes() == SEALED.read_bytes()


def test_the_campaign_is_whole(index):
    assert Counter(row["kind"] for row in index) == {
        "calibration": 6 * 8 * 3, "static": 5 * 8 * 10, "dynamic": 3 * 3, "thrust": 50, "torque": 2 * 20,
        "dynamics": 2 * 48, "tensile": 4 * 3, "combined": 4 * 3 * 5,
    }  # fmt: skip
    assert {row["ended"] for row in index} == {"finished"} and {row["source"] for row in index} == {"emulator"}
    assert {row["kind"] for row in index} == set(PARTS)
    assert len({row["id"] for row in index}) == len(index)
    loads = {float(row["load_gf"]) for row in index if row["kind"] == "static"}
    assert loads == {35.715, 72.33, 108.48, 255.07, 343.445, 500.48, 751.0325, 957.5475}
    assert loads == {weight_gf(items) for items in COMBINATIONS}
    size = sum(p.stat().st_size for p in (RAW / "campaign").rglob("*") if p.is_file())
    assert size < 40e6


def test_logs_are_the_bytes_that_were_recorded(index):
    for row in index[::25]:
        session = read_session(RAW / row["metadata"])
        unpacked = gzip.decompress((RAW / row["file"]).read_bytes())
        assert hashlib.sha256(unpacked).hexdigest() == session.log_sha256
        log = read_log(RAW / row["file"])
        assert log.cut_at is None and len(log.table) == int(row["samples"]) and log.missing == int(row["missing"])
        assert log.session.setup.air is not None


def test_no_truth_in_raw():
    text = (RAW / "sessions.tsv").read_text() + "".join(p.read_text() for p in RAW.glob("campaign/*/*-1*.yaml"))
    for word in ("compliance", "crosstalk", "com_offset", "thrust_factors", "creep"):
        assert word not in text


def test_calibration_recovers_the_thesis_slope(index):
    rows = [row for row in index if row["kind"] == "calibration" and row["cell"] == "4"]
    volts, weights = [], []
    for row in rows:
        reading = read_log(RAW / row["file"]).table.cell_4_v.to_numpy()
        volts.append((reading[200:400].mean() - reading[:48].mean()) * 1e5)
        weights.append(float(row["load_gf"]))
    slope, _ = np.polyfit(volts, weights, 1)
    assert slope == pytest.approx(SLOPE[3], rel=2e-4)


def test_thrust_recovers_the_thesis_coefficient(index):
    speed, thrust = [], []
    for row in index:
        if row["kind"] == "thrust":
            log = read_log(RAW / row["file"])
            table, marks = log.table.set_index("index"), log.session.marks
            steady = table.loc[marks["on"] + 75 : marks["off"]]
            speed.append(steady.speed_rpm.mean() * np.pi / 30)
            thrust.append(steady.thrust_n.mean() - table.loc[: marks["on"] - 1].thrust_n.mean())
    speed, thrust = np.array(speed), np.array(thrust)
    assert len(speed) == 50
    assert (speed**2 @ thrust) / (speed**4).sum() == pytest.approx(1.3877e-6, rel=5e-4)


def test_static_reading_by_the_recorders_marks():
    log = read_log(RAW / "campaign/static/static-al-z-w6-r01.rlog.gz")
    table, marks = log.table.set_index("index"), log.session.marks
    cells = list(log.instrument.columns)
    tare = table.loc[marks["tare_start"] : marks["tare_stop"], cells].mean()
    assert len(table.loc[marks["tare_start"] : marks["tare_stop"]]) == 25
    assert tare.to_dict() == pytest.approx(log.session.tare)
    reading = table.loc[marks["read_start"] : marks["read_stop"], cells].mean() - tare
    force = body_forces(cell_forces(reading.to_numpy()))
    assert force[2] == pytest.approx(-500.48 * 9.80665e-3, rel=0.005)


def test_the_workflow_never_names_the_sealed_truth():
    root = RAW.parent
    files = [root / "Snakefile", root / "config.yaml", *(root / "workflow").rglob("*"), *(root / "src").rglob("*.py")]
    files = [p for p in files if "rotorid_acquire" not in p.parts]  # the emulator, which writes it
    texts = {p: p.read_text(errors="replace") for p in files if p.is_file() and p.suffix != ".pyc"}
    assert [p for p, text in texts.items() if "campaign_truth" in text] == []


def test_index_is_a_table():
    with open(RAW / "sessions.tsv", newline="") as file:
        widths = {len(row) for row in csv.reader(file, delimiter="\t")}
    assert len(widths) == 1
