"""Obtaining the public recordings, the sets made of them, and the importers on the real bytes."""

import functools
import hashlib
import http.server
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from rotorid.recordings import columns as c
from rotorid.recordings import read_set, read_vehicle
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import public_sets
from rotorid_lab.public_list import of_one_motor, read_manifest
from rotorid_lab.public_sets import PUBLIC_SETS, address, build, obtain, sha256
from rotorid_proof.plantings import sow
from rotorid_proof.plantings.flights import FLIGHTS as PLANTED
from tests.public_logs import built

ROOT = Path(__file__).parents[4]
MANIFEST = read_manifest(ROOT / "workflow" / "public_data.yaml")
VEHICLES = ROOT / "workflow" / "vehicles"


def source_of(content: bytes) -> dict:
    entry = {"path": "a b (c)/x.bin", "sha256": hashlib.sha256(content).hexdigest()}
    return {
        "repository": "someone/something", "commit": "c0ffee", "licence": "MIT", "citation": "Someone",
        "contents": "x", "files": [entry],
    }  # fmt: skip


def test_an_address_is_built_of_repository_commit_and_path() -> None:
    source = source_of(b"")
    there = "https://raw.githubusercontent.com/someone/something/c0ffee/a%20b%20%28c%29/x.bin"
    assert address(source, source["files"][0]) == there
    renamed = {**source["files"][0], "upstream": "data/y.bin"}
    assert address(source, renamed).endswith("/c0ffee/data/y.bin")


def test_files_of_a_folder_are_checked(tmp_path: Path) -> None:
    source = source_of(b"right")
    path = tmp_path / "s" / "a b (c)" / "x.bin"
    _, missing = obtain("s", source, tmp_path, tmp_path / "cache")
    assert "is not there" in missing["a b (c)/x.bin"]
    path.parent.mkdir(parents=True)
    path.write_bytes(b"wrong")
    assert "SHA-256 differs" in obtain("s", source, tmp_path, tmp_path)[1]["a b (c)/x.bin"]
    path.write_bytes(b"right")
    assert obtain("s", source, tmp_path, tmp_path) == (tmp_path / "s", {})
    assert sha256(path) == source["files"][0]["sha256"]


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path):
    root = tmp_path / "server"
    (root / "someone" / "something" / "c0ffee" / "a b (c)").mkdir(parents=True)
    handler = functools.partial(_Quiet, directory=root)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}", root
        running.shutdown()


def test_a_download_is_checked_kept_and_not_repeated(tmp_path: Path, server) -> None:
    base, root = server
    upstream = root / "someone" / "something" / "c0ffee" / "a b (c)" / "x.bin"
    source = source_of(b"right")
    cache = tmp_path / "cache"
    _, missing = obtain("s", source, None, cache, base)
    assert "the server answers 404" in missing["a b (c)/x.bin"]
    upstream.write_bytes(b"tampered")
    _, missing = obtain("s", source, None, cache, base)
    assert "SHA-256 is" in missing["a b (c)/x.bin"]
    assert not list(cache.rglob("*.bin"))
    upstream.write_bytes(b"right")
    assert not obtain("s", source, None, cache, base)[1]
    upstream.unlink()
    assert not obtain("s", source, None, cache, base)[1]


def test_without_a_network_the_reason_is_told_once_for_all_files(tmp_path: Path) -> None:
    source = source_of(b"")
    source["files"] = [{"path": f"{n}", "sha256": "0"} for n in range(3)]
    _, missing = obtain("s", source, None, tmp_path, "http://127.0.0.1:1")
    assert len(missing) == 3 and len(set(missing.values())) == 1
    assert missing["0"].startswith("no answer from 127.0.0.1:1")


def test_a_set_that_cannot_be_had_says_so(tmp_path: Path) -> None:
    entry = MANIFEST["neurobem"]
    found = obtain("neurobem", entry, tmp_path / "nothing", tmp_path)
    folder = build("neurobem", found, entry, VEHICLES, tmp_path / "sets")
    assert [path.name for path in folder.iterdir()] == ["import_report.json"]
    report = read_report(folder)
    assert report["available"] is False and report["reason"].startswith("4 files could not be had: ")
    assert report["licence"].startswith("none stated")


def test_an_import_that_stops_while_it_reads_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: an empty folder stayed, which was taken for a set."""

    def stopped(*_) -> None:
        assert not (tmp_path / "sets").exists()
        raise KeyboardInterrupt

    monkeypatch.setitem(PUBLIC_SETS, "neurobem", replace(PUBLIC_SETS["neurobem"], read=stopped))
    found = tmp_path, {}
    with pytest.raises(KeyboardInterrupt):
        build("neurobem", found, MANIFEST["neurobem"], VEHICLES, tmp_path / "sets")
    assert not (tmp_path / "sets").exists()


def test_the_manifest_and_the_recipes_agree() -> None:
    """On the files; test_manifest.py has the rest."""
    for entry in MANIFEST.values():
        paths = [file["path"] for file in entry["files"]]
        assert len(paths) == len(set(paths))
        assert all(set(PUBLIC_SETS[name].files) <= set(paths) for name in entry["sets"])


@pytest.mark.parametrize("path", sorted(VEHICLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_believed_vehicle_fits_the_contract_and_says_its_sources(path: Path) -> None:
    vehicle = read_vehicle(path)
    assert vehicle.rotor_count in (1, 4)
    if vehicle.kind == "flight":
        assert vehicle.rotor_positions_m()[:, :2].sum(axis=0) == pytest.approx([0, 0], abs=1e-9)
        assert vehicle.yaw_signs().sum() == 0
    for line in path.read_text().splitlines():
        if line.startswith(("mass_kg", "thrust_coefficient", "torque_coefficient")):
            assert "#" in line, f"{path.name}: {line} has no source"
    assert yaml.safe_load(path.read_text())["name"]


def test_neurobem_beliefs_are_the_issue_s() -> None:
    vehicle = read_vehicle(VEHICLES / "neurobem.yaml")
    assert vehicle.thrust_coefficient_n_s2 == 1.5625e-6
    assert vehicle.torque_coefficient_n_m_s2 == pytest.approx(0.022 * 1.5625e-6)


# On the real bytes ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory):
    """Build sets from the real files, each once."""
    parent = tmp_path_factory.mktemp("sets")

    @functools.cache
    def made(name: str):
        folder = built(name, MANIFEST, VEHICLES, parent)
        return read_set(folder), read_report(folder)

    made.parent = parent
    return made


@pytest.mark.parametrize("name", [name for name in PUBLIC_SETS if not of_one_motor(name)])
def test_a_real_set_fits_the_contract_and_repeats_byte_for_byte(name: str, real, tmp_path: Path) -> None:
    recordings, report = real(name)
    assert report["available"]
    assert recordings.runs
    assert all(fault["sentence"].endswith(".") for fault in report["faults"])
    again = built(name, MANIFEST, VEHICLES, tmp_path)
    assert set(report["files"]) == set(PUBLIC_SETS[name].files)
    for path in sorted(again.iterdir()):
        assert path.read_bytes() == (real.parent / name / path.name).read_bytes()


FLIGHTS = ["neurobem", "imrc-brushless", "imrc-brushed", "appius-ground-effect", "crazypad-normal"]


def _dense(run, names) -> np.ndarray:
    return run.table[list(names)].interpolate(limit_direction="both").to_numpy(float)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_axes_agree_with_each_other(name: str, real) -> None:
    """The derivative of the position is the velocity, and thrust along -z of the body explains most of it."""
    for run in real(name)[0].runs:
        up = Rotation.from_quat(_dense(run, c.QUATERNION)[:, [1, 2, 3, 0]]).apply([0, 0, -1.0])
        velocity = _dense(run, c.VELOCITY)
        window = max(3, int(0.3 / np.median(np.diff(run.time_s))))
        smooth = np.ones(window) / window
        inner = slice(window, -window)
        climbed = np.convolve(np.gradient(_dense(run, c.POSITION)[:, 2], run.time_s), smooth, "same")[inner]
        climbing = np.convolve(velocity[:, 2], smooth, "same")[inner]
        if np.std(climbing) > 0.1:
            assert np.corrcoef(climbed, climbing)[0, 1] > 0.95, run.name
        velocity = np.column_stack([np.convolve(v, smooth, "same") for v in velocity.T])
        acceleration = np.gradient(velocity, run.time_s, axis=0)[inner]
        for axis in range(2):
            pushed = np.convolve(up[:, axis], smooth, "same")[inner]
            if np.std(acceleration[:, axis]) > 0.3:
                assert np.corrcoef(pushed, acceleration[:, axis])[0, 1] > 0.6, (run.name, axis)


@pytest.mark.parametrize("name", ["neurobem", "imrc-brushless", "appius-ground-effect"])
def test_the_believed_thrust_carries_the_weight(name: str, real) -> None:
    recordings, _ = real(name)
    vehicle = recordings.vehicle
    for run in recordings.runs:
        thrust = _dense(run, c.rotor_columns("rotor_speed", 4)) ** 2 @ vehicle.thrust_coefficients_n_s2()
        tilt = Rotation.from_quat(_dense(run, c.QUATERNION)[:, [1, 2, 3, 0]]).apply([0, 0, 1.0])[:, 2]
        assert np.mean(thrust * tilt) == pytest.approx(vehicle.mass_kg * 9.81, rel=0.06)


@pytest.mark.parametrize("name", ["neurobem", "imrc-brushless", "imrc-brushed"])
def test_rotors_stand_and_spin_where_the_vehicle_file_says(name: str, real) -> None:
    """Joint regression of the angular acceleration on all squared speeds, 2 to 15 Hz."""
    from scipy.signal import butter, sosfiltfilt

    recordings, _ = real(name)
    signs = {"x": [], "y": [], "z": []}
    for run in recordings.runs:
        if run.name == "jana24":  # its first rotor's speed sensor fails
            continue
        rate = 1 / np.median(np.diff(run.time_s))
        band = butter(2, [1, 15], "bandpass", fs=rate, output="sos")
        squared = sosfiltfilt(band, _dense(run, c.rotor_columns("rotor_speed", 4)) ** 2, axis=0)
        rates = _dense(run, c.ANGULAR_VELOCITY)
        acceleration = sosfiltfilt(band, np.gradient(rates, run.time_s, axis=0), axis=0)
        for axis, column in zip("xyz", acceleration.T, strict=True):
            signs[axis].append(np.linalg.lstsq(squared, column, rcond=None)[0])
    x, y, _ = recordings.vehicle.rotor_positions_m().T
    assert (np.sign(np.median(signs["x"], axis=0)) == np.sign(-y)).all()
    assert (np.sign(np.median(signs["y"], axis=0)) == np.sign(x)).all()
    if name != "neurobem":  # its yaw is known by the speeds' derivatives only
        assert (np.sign(np.median(signs["z"], axis=0)) == recordings.vehicle.yaw_signs()).all()


def test_the_traps_of_the_real_files_are_caught(real) -> None:
    def faults(name):
        return {(f["run"], f["column"], f["kind"]) for f in real(name)[1]["faults"]}

    assert ("jana24", "rotor_speed_1_rad_s", "speed_dropout") in faults("imrc-brushed")
    assert ("jana24", "battery_voltage_v", "stuck") in faults("imrc-brushed")
    assert ("jana01", "rotor_speed_1_rad_s", "speed_dropout") not in faults("imrc-brushed")
    assert ("20210218170320seg2", "battery_voltage_v", "unit") in faults("neurobem")
    assert ("hovering", ", ".join(c.POSITION), "no_lock") in faults("appius-ground-effect")
    assert {kind for _, _, kind in faults("appius-ground-effect")} >= {"held", "cut_off", "no_telemetry"}
    assert ("a_2s", "rotor_speed_1_rad_s", "speed_missing") in faults("strawson-t5040c")
    assert ("i_2s", "rotor_speed_1_rad_s", "speed_lost") in faults("strawson-t5040c")
    assert ("a_2s", "", "byte_order_mark") in faults("strawson-t5040c")
    assert {kind for _, _, kind in faults("crazypad-cut")} >= {"no_pitch", "cut"}


def test_the_tables_of_the_report_count_runs_not_sets_twice(real, tmp_path: Path) -> None:
    folders = []
    for name in ("imrc-brushed", "crazypad-normal", "crazypad-cut"):
        real(name)
        folders.append(built(name, MANIFEST, VEHICLES, tmp_path))
    table = public_sets.faults(folders)
    pitch = table[table["fault"] == "pitch not recorded"]
    assert pitch[["source", "runs"]].to_numpy().tolist() == [["crazypad", 16]]
    assert public_sets.recordings(folders)["runs"].tolist() == [2, 10, 6]


def test_the_list_of_plantings_is_that_of_the_public_sets(real) -> None:
    for flight in PLANTED:
        real(flight.set)
    assert sow.list_text(real.parent) == (ROOT / "workflow/plantings.tsv").read_text()
