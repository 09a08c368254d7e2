"""The public recordings as contract sets: which files make which set, and through which importer.

`build` writes one set: `vehicle.yaml` (copied with its comments on where each value comes from), one Parquet
file a run, and `import_report.json` with every fault met on the way.

Crazyflie on a scale (IMRCLab): CSV of PWM, battery, four rotor speeds and the thrust of the whole vehicle.

Two layouts: `pwm,vbat[V],rpm1..4,thrust[g]` with steady points in random order, and
`weight[g],pwm,vbat[V],rpm1..4,v[V],i[A],p[W]` as a sweep. Neither has a clock: rows are counted as seconds.

Getting the public recordings: from a folder that is there or by download; SHA-256 is always checked.

Nothing here is fatal: a file that cannot be had is named with the reason, and the pipeline goes on without.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run, read_vehicle, write_set
from rotorid.recordings import columns as c
from rotorid.recordings.files import sha256
from rotorid.recordings.importers import crazyflie
from rotorid.recordings.importers.faults import ImportFault, ImportReport, fault_where
from rotorid.recordings.importers.neurobem import read_neurobem
from rotorid.recordings.importers.rcbenchmark import read_rcbenchmark
from rotorid.recordings.importers.units import RPM
from rotorid.recordings.importers.vicon_csv import read_vicon_csv
from rotorid.recordings.tables import place, read_csv

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
            "imrc-crazyflie-rpm",
            ("brushed_flights/jana01", "brushed_flights/jana24"),
            _flights,
            "imrc-brushed",
            _FLU,
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
    for label, (folder, numbers) in pad.items():
        sets[f"crazypad-{label}"] = _PublicSet(
            "crazypad",
            tuple(f"{folder}/E9_log{n:02d}" for n in numbers),
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

    Parameters
    ----------
    obtained
        What `obtain` gives of the set's source.
    source
        The source's entry in the manifest (licence, repository, commit, citation).
    vehicles
        Folder with the believed vehicle files.
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
    """One bench run in contract columns (kind stand, thrust along -z), and its faults."""
    raw = read_csv(Path(path))
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
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(data)
    partial.rename(path)


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

    Parameters
    ----------
    name, source
        Name and entry of the source in the manifest.
    folder
        A folder with the public recordings (what ROTORID_PUBLIC_DATA names), or None to download.
    cache
        Where downloads are kept.
    base
        Server of raw files.
    """
    if folder is None:
        return Path(cache) / name, _downloaded(source, Path(cache) / name, base)
    own = Path(folder) / name
    reasons = {file["path"]: _in_folder(own / file["path"], file) for file in source["files"]}
    return own, {path: reason for path, reason in reasons.items() if reason}
