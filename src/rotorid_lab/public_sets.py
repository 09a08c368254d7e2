"""The public recordings: how they are had, which files make which contract set, and tables of them for the report.

Files come from a folder that is there or by download; SHA-256 is always checked. One that cannot be had is named with
the reason, and the pipeline goes on without. `build` writes one set: `vehicle.yaml` (copied with its comments on where
each value comes from), one Parquet file a run, and `import_report.json` with every fault met on the way.

Two formats are of single laboratories, and read here: a Crazyflie on a scale (IMRCLab), `read_imrc_bench`, and a Vicon
room with a PX4 vehicle (A. Appius, ground-effect flights), `read_vicon_csv`.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.writing import all_or_none
from rotorid.recordings import RecordingSet, Run, read_set, read_vehicle, write_set
from rotorid.recordings import columns as c
from rotorid.recordings.check import check_set
from rotorid.recordings.files import sha256
from rotorid.recordings.importers import crazyflie
from rotorid.recordings.importers.faults import (
    ImportFault,
    ImportReport,
    blank_held,
    cut,
    drop_repeated_times,
    fault_where,
    read_report,
    report_gaps,
    true_stretches,
)
from rotorid.recordings.importers.mapping import RPM, quaternion_from_euler_frd
from rotorid.recordings.importers.neurobem import read_neurobem
from rotorid.recordings.importers.rcbenchmark import read_rcbenchmark
from rotorid.recordings.tables import numbers, place, read_cells

_FAULT_NAMES = {
    "byte_order_mark": "byte-order mark",
    "encoding": "encoding",
    "line_ends": "line ends",
    "cut_off": "last line or event cut off",
    "no_lock": "motion capture not locked",
    "no_telemetry": "no telemetry yet",
    "held": "last value repeated",
    "gap": "gaps in the clock",
    "repeated_time": "clock stands still",
    "speed_missing": "rotor speed 0 under thrust",
    "speed_lost": "rotor speed too low for its thrust",
    "speed_dropout": "rotor speed drops to 0",
    "tare": "thrust at rest",
    "flipped_sign": "sign of the thrust flipped",
    "stuck": "reading never moves",
    "unit": "unit",
    "superseded": "superseded columns",
    "derived": "derived, not measured",
    "no_pitch": "pitch not recorded",
    "on_ground": "rest, take-off and landing",
    "cut": "only the flight kept",
    "checksum": "checksum",
    "unknown_event": "unknown event",
    "dropout": "logger dropout",
    "no_command": "no command logged",
    "no_clock": "no clock",
    "second_sensor": "second sensor",
    "estimate": "estimate that did not fly the vehicle",
}
_HOW_TO_HAVE = {
    "folder": "ROTORID_PUBLIC_DATA names a folder and files are taken from there alone, so put the missing ones where "
    "the list says and run again, or unset it and run again where the network reaches their repositories",
    "network": "ROTORID_PUBLIC_DATA is not set and files are downloaded, so run again where the network reaches their "
    "repositories, after deleting results/public/<source>.json, or set it to a folder that holds the files",
}
"""What to do about files that are missing, by where they were looked for."""
_OF_A_SOURCE = "source repository place licence contents citation files obtained reason taken_from".split()
_CHOICES = {"cut", "on_ground"}
"""Kinds that note what part of a log was kept, which is no fault of the log."""
_VICON_COLUMNS = 25
_GROUND_MARGIN_M = 0.015
"""Height above the resting height from which the vehicle counts as in the air."""
_RAW_FILES = "https://raw.githubusercontent.com"
_TIMEOUT_S = 20.0
_GRAM_FORCE_N = 9.80665e-3
_FULL_SCALE = 65536.0
_SPEEDS = ("rpm1", "rpm2", "rpm3", "rpm4")
_Runs = dict[str, tuple[pd.DataFrame, list[ImportFault]]]

_PROPELLERS = {"1": "t5040c", "2": "t5045c", "5": "hq5x4", "6": "lumenier5x45"}
"""5-inch propellers: Cyclone T5040C and T5045C (3 blades), HQ 5x4 (4 blades), Lumenier 5x4.5 (2 blades)."""
_MOTORS = "abcdefghijklm"
_CELLS = {"7": "2s", "11": "3s"}
_FLU = "body forward-left-up and world z up, turned by half a turn about x into FRD and NED"


@dataclass(frozen=True)
class _PublicSet:
    """Recipe of one set: source folder, files in it, how to read them, vehicle file, words for the report."""

    source: str
    files: tuple[str, ...]
    read: Callable[[Path, str], _Runs]
    vehicle: str
    axes: str
    held_out: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()


def _flights(path: Path, name: str, stretches: list[tuple[float, float]] | None = None) -> _Runs:
    """Flights of a uSD log, each with the faults of the whole log and its own."""
    tables, faults = crazyflie.flights(path, Path(name).name, stretches, crazyflie.in_the_air)
    return {run: (table, [f for f in faults if f.run in ("", run)]) for run, table in tables.items()}


def _imrc_brushless(path: Path, name: str) -> _Runs:
    """The controller's map of thrust to PWM is published: it gives the commanded speed of each rotor."""
    return {run: (_with_commanded_speed(table), faults) for run, (table, faults) in _flights(path, name).items()}


_PWM_OF_GRAMS = (0.16609668469985447, 0.02297914810965436, 0.0001878280261246769)
"""Coefficients d00, d10, d20 of PWM fraction over grams of thrust, as flown (upstream README)."""
_BRUSHLESS_C_F = 3.91e-8


def _with_commanded_speed(table: pd.DataFrame) -> pd.DataFrame:
    """Throttles replaced by commanded rotor speeds, by the flight controller's own map from thrust to PWM.

    u = d00 + d10 f + d20 f² with f in grams of thrust; solved for f, and ω = sqrt(f g / C_F).
    """
    d00, d10, d20 = _PWM_OF_GRAMS
    table = table.copy()
    for i, throttle in enumerate(crazyflie.THROTTLES, start=1):
        u = table[throttle].to_numpy()
        grams = (-d10 + np.sqrt(d10**2 - 4 * d20 * np.minimum(d00 - u, 0))) / (2 * d20)
        speed = np.sqrt(grams * 1e-3 * 9.81 / _BRUSHLESS_C_F)
        place = table.columns.get_loc(throttle)
        table.insert(place, f"rotor_command_{i}_rad_s", speed)
        table = table.rename(columns={throttle: f"pwm_fraction_{i}"})
    return table


def _bench(path: Path, name: str) -> _Runs:
    motor, voltage = re.fullmatch(r"([a-m])\d_(7|11)\.csv", Path(name).name).groups()
    return {f"{motor}_{_CELLS[voltage]}": read_rcbenchmark(path)}


def _public_sets() -> dict[str, _PublicSet]:
    flights = ("20210218170320seg2", "20210218171908seg2", "20210223104803seg2", "20210223114138seg3")
    brushless = ("00", "01", "12", "13", "17", "18", "22", "24", "27")
    pad = {
        "normal": ("normal_flight", range(5)),
        "weight": ("add_weight_W1_near_M3", range(4, 7)),
        "cut": ("cut_propeller_M3_3mm", range(3)),
    }
    sets = {
        "neurobem": _PublicSet(
            "neurobem",
            tuple(f"bemnn{f}.mat" for f in flights),
            lambda path, name: {Path(name).stem.removeprefix("bemnn"): read_neurobem(path)},
            "neurobem",
            _FLU,
            notes=(
                "columns neurobem_force_*_n and neurobem_moment_*_n_m are NeuroBEM's own prediction",
                "columns angular_acceleration_*_rad_s2 come from the files",
            ),
        ),
        "appius-ground-effect": _PublicSet(
            "appius-ground-effect",
            ("HOVERING.csv", "VERTICAL_SPEEDS.csv"),
            lambda path, name: {Path(name).stem.lower(): read_vicon_csv(path)},
            "appius-ground-effect",
            "attitude and rates forward-right-down over x north, y east (lateral accelerations are -g pitch "
            "and +g roll); only z is turned over",
            notes=("rotor speeds arrive at about 3 Hz, poses at about 9 Hz: repeats are empty cells",),
        ),
        "imrc-brushless": _PublicSet(
            "imrc-crazyflie-rpm",
            tuple(f"brushless_flights/eckart{n}" for n in brushless),
            _imrc_brushless,
            "imrc-brushless",
            _FLU,
            notes=(
                "rotor_command is the speed for the thrust that the controller asked for, from its published "
                "map of thrust to PWM; the PWM itself rides along as pwm_fraction",
            ),
        ),
        "imrc-brushed": _PublicSet(
            "imrc-crazyflie-rpm", ("brushed_flights/jana01", "brushed_flights/jana24"), _flights, "imrc-brushed", _FLU
        ),
        "crazyflie-arpl-log10": _PublicSet(
            "crazyflie-arpl",
            ("log10",),
            lambda path, name: _flights(path, name, [(35.0, 65.0)]),
            "crazyflie-arpl",
            _FLU,
            notes=(
                "thrust window 35-65 s as upstream",
                "upstream's notebook takes g as 9.18 (cell 6): its published thrust is 6.4 % low",
            ),
        ),
        "crazyflie-arpl-log15": _PublicSet(
            "crazyflie-arpl",
            ("log15",),
            lambda path, name: _flights(path, name, [(55.0, 90.0)]),
            "crazyflie-arpl",
            _FLU,
            notes=("roll and pitch window 55-90 s as upstream",),
        ),
    }
    bench = "system-id/data"
    scales = {
        "stock": ("brushed", ("cf21_bitcraze2021/cf2.1-stock-prop", "cf21_bitcraze2021/cf21_stock2")),
        "plus": (
            "brushed",
            tuple(
                f"cf21plus/data_feb_24_2026_{battery}"
                for battery in ("250mah_battery0", "350mah_battery0", "350mah_battery1")
            ),
        ),
        "guards": ("brushless", ("cf21bl_guards/feb25_2026_0",)),
    }
    for name, (vehicle, files) in scales.items():
        sets[f"imrc-bench-{name}"] = _PublicSet(
            "imrc-crazyflie-rpm",
            tuple(f"{bench}/{file}.csv" for file in files),
            lambda path, name: {Path(name).name.removesuffix(".csv").replace(".", "_"): read_imrc_bench(path)},
            f"imrc-bench-{vehicle}",
            "thrust of the whole vehicle along -z of the body",
        )
    for label, (folder, logs) in pad.items():
        sets[f"crazypad-{label}"] = _PublicSet(
            "crazypad",
            tuple(f"{folder}/E9_log{n:02d}" for n in logs),
            _flights,
            "crazypad",
            _FLU,
            notes=("specific force is the state estimate's world acceleration turned into the body",),
        )
    for digit, propeller in _PROPELLERS.items():
        for motor in (None, *_MOTORS):
            runs = [(m, v) for m in (motor or _MOTORS) for v in _CELLS]
            name = f"strawson-{propeller}" + (f"-{motor}" if motor else "")
            sets[name] = _PublicSet(
                "strawson-5inch-bench",
                tuple(f"rawdata/{m}{digit}_{v}.csv" for m, v in runs),
                _bench,
                "strawson-5inch-bench",
                "thrust along -z of the body, passed on to the sensor",
                held_out=(f"{motor}_2s",) if motor else tuple(f"{m}_2s" for m in _MOTORS),
                notes=("held out: the runs on two cells, so that supply voltage is predicted, not fitted",),
            )
    return sets


PUBLIC_SETS = _public_sets()


def build(name: str, obtained: tuple[Path, dict[str, str]], source: dict, vehicles: Path, parent: Path) -> Path:
    """Write the set `name` below `parent`; returns its folder.

    Where a file could not be had, the folder holds `import_report.json` alone, which says so. Until all files are read
    there is no folder.

    `obtained` is what `obtain` gives of the set's source, `source` the source's entry in the manifest, `vehicles` the
    folder with the believed vehicle files.
    """
    recipe = PUBLIC_SETS[name]
    folder = Path(parent) / name
    origin = {
        "source": f"https://github.com/{source['repository']} at {source['commit']}",
        "licence": source["licence"],
        "citation": source["citation"],
    }
    (files, missing), sums = obtained, {file["path"]: file["sha256"] for file in source["files"]}
    lost = [file for file in recipe.files if file in missing or file not in sums]
    if lost:
        reason = missing.get(lost[0], f"{lost[0]} is not in the manifest")
        folder.mkdir(parents=True, exist_ok=True)
        ImportReport(name, False, **origin, reason=f"{len(lost)} files could not be had: {reason}").write(folder)
        return folder
    runs, faults = [], []
    for file in recipe.files:
        for run, (table, found) in recipe.read(files / file, file).items():
            runs.append(Run(run, table))
            faults += [fault.in_run(run) for fault in found]
    believed = Path(vehicles) / f"{recipe.vehicle}.yaml"
    ordered = tuple(sorted(runs, key=lambda run: run.name))
    write_set(RecordingSet(name, read_vehicle(believed), ordered, recipe.held_out), Path(parent))
    shutil.copyfile(believed, folder / "vehicle.yaml")
    more = {"axes": recipe.axes, "faults": tuple(faults), "notes": recipe.notes}
    ImportReport(name, True, **origin, files={file: sums[file] for file in recipe.files}, **more).write(folder)
    return folder


def sets_of(source: str) -> list[str]:
    """Names of the sets made from one source."""
    return [name for name, recipe in PUBLIC_SETS.items() if recipe.source == source]


def read_imrc_bench(path: Path) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One bench run in contract columns (kind stand, thrust along -z), and its faults.

    `pwm,vbat[V],rpm1..4,thrust[g]` with steady points in random order, or
    `weight[g],pwm,vbat[V],rpm1..4,v[V],i[A],p[W]` as a sweep. Neither has a clock: rows are counted as seconds.
    """
    raw = numbers(read_cells(Path(path)), path)
    thrust = next((name for name in ("thrust[g]", "weight[g]") if name in raw), None)
    missing = [name for name in ("pwm", "vbat[V]", *_SPEEDS) if name not in raw]
    if thrust is None or missing:
        raise InputError(f"{path}, line 1: expected the column {missing[0] if missing else 'thrust[g]'}")
    for name in ("pwm", "vbat[V]", *_SPEEDS, thrust):
        if raw[name].isna().any():
            row = int(np.flatnonzero(raw[name].isna())[0])
            raise InputError(f"{path}, {place(path, row)}, column {name}: is empty, expected a number")
    columns = {c.TIME: np.arange(len(raw), dtype=float)}
    throttle = raw["pwm"].to_numpy(float) / _FULL_SCALE
    columns |= {name: throttle for name in c.rotor_columns("throttle", 4)}
    for name, column in zip(_SPEEDS, c.rotor_columns("rotor_speed", 4), strict=True):
        columns[column] = raw[name].to_numpy(float) * RPM
    columns["force_z_n"] = -raw[thrust].to_numpy(float) * _GRAM_FORCE_N
    columns[c.BATTERY_VOLTAGE] = raw["vbat[V]"].to_numpy(float)
    if "i[A]" in raw:
        columns[c.BATTERY_CURRENT] = raw["i[A]"].to_numpy(float)
    table = pd.DataFrame(columns)
    faults = [ImportFault("no_clock", c.TIME, "rows have no time", "rows counted as seconds", len(table))]
    for column in c.rotor_columns("rotor_speed", 4):
        lost = (table[column] == 0) & (throttle > 0.3)
        found = f"speed reads 0 in {int(lost.sum())} rows while the motor is driven"
        faults += fault_where(lost, "speed_dropout", column, found, "kept as recorded")
    return table, faults


def address(source: dict, file: dict, base: str = _RAW_FILES) -> str:
    """Where a file of the manifest is downloaded: repository, commit and path upstream."""
    path = urllib.parse.quote(file.get("upstream", file["path"]))
    return f"{base}/{source['repository']}/{source['commit']}/{path}"


def _download(url: str, wanted: str, path: Path) -> None:
    with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer:
        data = answer.read()
    found = hashlib.sha256(data).hexdigest()
    if found != wanted:
        raise InputError(f"{url}: SHA-256 is {found}, expected {wanted}")
    with all_or_none(path) as (part,):
        part.write_bytes(data)


def _in_folder(path: Path, file: dict) -> str:
    """Why a file of the manifest is not there; empty where it is."""
    if not path.is_file():
        return f"{path} is not there"
    return "" if sha256(path) == file["sha256"] else f"{path} is not the file of the manifest (SHA-256 differs)"


def _downloaded(source: dict, folder: Path, base: str) -> dict[str, str]:
    """To the files that could not be had the reason; after one without an answer none is asked for."""
    missing, offline = {}, ""
    for file in source["files"]:
        path = folder / file["path"]
        if not _in_folder(path, file):
            continue
        if offline:
            missing[file["path"]] = offline
            continue
        url = address(source, file, base)
        try:
            _download(url, file["sha256"], path)
        except InputError as error:
            missing[file["path"]] = str(error)
        except urllib.error.HTTPError as error:
            missing[file["path"]] = f"{url}: the server answers {error.code}"
        except OSError as error:
            host = urllib.parse.urlsplit(base).netloc
            offline = missing[file["path"]] = f"no answer from {host} ({getattr(error, 'reason', error)})"
    return missing


def obtain(
    name: str, source: dict, folder: Path | None, cache: Path, base: str = _RAW_FILES
) -> tuple[Path, dict[str, str]]:
    """The folder of one source of the manifest, its files checked, and to those that could not be had the reason.

    `folder` has the public recordings (what ROTORID_PUBLIC_DATA names); None downloads them into `cache`.
    """
    if folder is None:
        return Path(cache) / name, _downloaded(source, Path(cache) / name, base)
    own = Path(folder) / name
    reasons = {file["path"]: _in_folder(own / file["path"], file) for file in source["files"]}
    return own, {path: reason for path, reason in reasons.items() if reason}


def _vicon_matrix(path: Path) -> tuple[np.ndarray, list[ImportFault]]:
    """The numbers of a header-less CSV, shape (n, 25); the last row may be cut off."""
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    rows, faults = [], []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        cells = line.rstrip(",").split(",")
        last = number == len(lines)
        values = []
        for column, cell in enumerate(cells, start=1):
            try:
                values.append(float(cell))
            except ValueError:
                if not last:
                    where = f"{path}, line {number}, column {column}"
                    raise InputError(f"{where}: expected a number, found {cell!r}") from None
                values = []
                break
        if len(values) != _VICON_COLUMNS:
            if not last:
                raise InputError(f"{path}, line {number}: expected {_VICON_COLUMNS} columns, found {len(values)}")
            faults.append(
                ImportFault("cut_off", "", f"last line has {len(cells)} of {_VICON_COLUMNS} columns", "left out", 1)
            )
            continue
        rows.append(values)
    if len(rows) < 2:
        raise InputError(f"{path}: expected at least two rows of {_VICON_COLUMNS} numbers")
    return np.array(rows), faults


def _of_vicon(matrix: np.ndarray) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of the flown part of a log, clock from zero at its start."""
    time, position, velocity = matrix[:, 0], matrix[:, 1:4], matrix[:, 4:7]
    roll, pitch, yaw = np.radians(matrix[:, 7:10]).T
    columns = {c.TIME: time}
    columns |= dict(zip(c.POSITION, (position * [1, 1, -1]).T, strict=True))
    columns |= dict(zip(c.VELOCITY, (velocity * [1, 1, -1]).T, strict=True))
    columns[c.HEIGHT] = position[:, 2]
    quaternion = quaternion_from_euler_frd(roll, pitch, yaw)
    columns |= dict(zip(c.QUATERNION, quaternion.T, strict=True))
    columns |= dict(zip(c.ANGULAR_VELOCITY, matrix[:, 10:13].T, strict=True))
    columns |= dict(zip(c.rotor_columns("rotor_speed", 4), (matrix[:, 13:17] * RPM).T, strict=True))
    columns[c.BATTERY_VOLTAGE] = matrix[:, 17:21].mean(axis=1)
    columns[c.BATTERY_CURRENT] = matrix[:, 21:25].sum(axis=1)
    table = pd.DataFrame(columns)
    unlocked = table[list(c.POSITION)].isna().any(axis=1)
    table.loc[unlocked, [*c.POSITION, *c.VELOCITY, c.HEIGHT]] = np.nan
    faults = fault_where(unlocked, "no_lock", ", ".join(c.POSITION), "motion capture not locked (nan)", "made empty")
    rotors = list(c.rotor_columns("rotor_speed", 4))
    unpowered = (table[c.BATTERY_VOLTAGE] == 0) & (table[rotors].abs().sum(axis=1) == 0)
    faults += fault_where(unpowered, "no_telemetry", c.BATTERY_VOLTAGE, "speed controllers report 0 V", "made empty")
    table.loc[unpowered, [c.BATTERY_VOLTAGE, c.BATTERY_CURRENT]] = np.nan
    table, repeated = drop_repeated_times(table)
    height = table[c.HEIGHT].to_numpy()
    resting = np.nanmedian(height[: max(10, int(np.argmax(table[rotors[0]].to_numpy() > 3000 * RPM)))])
    flying = (table[rotors].mean(axis=1) > 4000 * RPM).to_numpy() & (height > resting + _GROUND_MARGIN_M)
    stretches = true_stretches(flying, table[c.TIME].to_numpy(), 5.0)
    if not stretches:
        raise InputError("no stretch of 5 s in the air found (rotors above 4000 rpm and off the ground)")
    start, stop = max(stretches, key=lambda s: s[1] - s[0])
    before = len(table)
    table = cut(table, start + 1.0, stop)
    found = f"in the air from {start:.1f} to {stop:.1f} s"
    ground = ImportFault("on_ground", "", found, "rest, take-off and landing left out", before - len(table))
    faults += [*repeated, ground, *report_gaps(table)]
    groups = {
        "pose": [*c.POSITION, *c.VELOCITY, c.HEIGHT],
        "attitude": [*c.QUATERNION, *c.ANGULAR_VELOCITY],
        "rotor speed": rotors,
        "battery": [c.BATTERY_VOLTAGE, c.BATTERY_CURRENT],
    }
    table, held = blank_held(table, groups)
    return table, faults + held


def read_vicon_csv(path: Path) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One flight in contract columns, and its faults.

    25 columns without a heading: time, position (m, Vicon, z up), velocity, roll, pitch, yaw (deg), body rates (rad/s),
    four rotor speeds (rpm), four voltages, four currents. The lateral accelerations are −g·pitch along x and +g·roll
    along y, so attitude and rates are forward-right-down over x north, y east, and only the height is turned over.
    Rotors in PX4's order. Each group of columns is held at its own slower rate.
    """
    matrix, faults = _vicon_matrix(path)
    try:
        table, more = _of_vicon(matrix)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return table, faults + more


def sources(status_files: Sequence[Path]) -> pd.DataFrame:
    """One row a source: repository, commit, licence, citation, contents, whether it was had, and from where."""
    rows = []
    for path in status_files:
        status = json.loads(Path(path).read_text(encoding="utf-8"))
        status["place"] = f"{status['repository']} at {status['commit'][:10]}"
        status["files"] -= status["files_missing"]
        status["obtained"] = "yes" if status["available"] else "no"
        rows.append({key: status[key] for key in _OF_A_SOURCE})
    return pd.DataFrame(rows)


def recordings(folders: Sequence[Path]) -> pd.DataFrame:
    """One row a set that is there: kind, runs, duration (s), rate (Hz), faults met."""
    rows = []
    for folder in folders:
        report = read_report(Path(folder))
        if not report["available"]:
            continue
        check = check_set(read_set(Path(folder)))
        length_s, rates = sum(run.duration_s for run in check.runs), sorted(run.rate_hz for run in check.runs)
        found = (check.name, check.kind, check.rotors, len(check.runs), length_s, rates[len(rates) // 2])
        rows.append((*found, len(report["faults"])))
    return pd.DataFrame(rows, columns=["set", "kind", "rotors", "runs", "duration_s", "rate_hz", "faults"])


def faults(folders: Sequence[Path]) -> pd.DataFrame:
    """One row a source and kind of fault: in how many runs, an example of what was seen and what was done."""
    rows: dict[tuple[str, str], dict] = {}
    for folder in folders:
        report = read_report(Path(folder))
        for fault in report["faults"]:
            if fault["kind"] in _CHOICES:
                continue
            source, kind = PUBLIC_SETS[report["set"]].source, fault["kind"]
            row = {"source": source, "fault": _FAULT_NAMES.get(kind, kind), "runs": set()}
            row = rows.setdefault((source, kind), row | {k: fault[k] for k in ("found", "action")})
            row["runs"].add((report["set"], fault["run"]))
    table = [{**row, "runs": len(row["runs"])} for row in rows.values()]
    return pd.DataFrame(table, columns=["source", "fault", "runs", "found", "action"])


def state(table: pd.DataFrame) -> dict:
    """What the report's text needs to know of the table of sources."""
    missing = table[table["obtained"] == "no"]
    places = set(missing["taken_from"])
    return {
        "available": bool((table["obtained"] == "yes").all()),
        "sources": len(table),
        "obtained": int((table["obtained"] == "yes").sum()),
        "missing": missing[["source", "reason"]].to_dict("records"),
        "how": "; ".join(how for place, how in _HOW_TO_HAVE.items() if place in places),
    }
