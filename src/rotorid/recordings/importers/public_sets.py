"""The public recordings as contract sets: which files make which set, and through which importer.

`build` writes one set: `vehicle.yaml` (copied with its comments on where each value comes from), one Parquet
file a run, and `import_report.json` with every fault met on the way.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet, Run, read_vehicle, write_set
from rotorid.recordings.importers import crazyflie
from rotorid.recordings.importers.imrc_bench_csv import read_imrc_bench
from rotorid.recordings.importers.neurobem import read_neurobem
from rotorid.recordings.importers.obtain import Obtained
from rotorid.recordings.importers.rcbenchmark import read_rcbenchmark
from rotorid.recordings.importers.report import Fault, ImportReport
from rotorid.recordings.importers.vicon_csv import read_vicon_csv

Runs = dict[str, tuple[pd.DataFrame, list[Fault]]]

PROPELLERS = {"1": "t5040c", "2": "t5045c", "5": "hq5x4", "6": "lumenier5x45"}
"""5-inch propellers: Cyclone T5040C and T5045C (3 blades), HQ 5x4 (4 blades), Lumenier 5x4.5 (2 blades)."""
MOTORS = "abcdefghijklm"
CELLS = {"7": "2s", "11": "3s"}
FLU = "body forward-left-up and world z up, turned by half a turn about x into FRD and NED"


@dataclass(frozen=True)
class PublicSet:
    """Recipe of one set: source folder, files in it, how to read them, vehicle file, words for the report."""

    source: str
    files: tuple[str, ...]
    read: Callable[[Path, str], Runs]
    vehicle: str
    axes: str
    held_out: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()


def _whole(reader: Callable[[Path], tuple[pd.DataFrame, list[Fault]]]) -> Callable[[Path, str], Runs]:
    """A file is one run, named after the file."""
    return lambda path, name: {name.rsplit("/")[-1].split(".")[0].lower(): reader(path)}


def _neurobem(path: Path, name: str) -> Runs:
    return {Path(name).stem.removeprefix("bemnn"): read_neurobem(path)}


def _crazyflie(path: Path, prefix: str, stretches: list[tuple[float, float]] | None = None) -> Runs:
    """Flights of a uSD log, each with the faults of the whole log and its own."""
    tables, faults = crazyflie.flights(path, prefix, stretches, crazyflie.in_the_air)
    return {run: (table, [f for f in faults if f.run in ("", run)]) for run, table in tables.items()}


def _imrc_brushless(path: Path, name: str) -> Runs:
    """The controller's map of thrust to PWM is published: it gives the commanded speed of each rotor."""
    return {
        run: (with_commanded_speed(table), faults) for run, (table, faults) in _crazyflie(path, Path(name).name).items()
    }


PWM_OF_GRAMS = (0.16609668469985447, 0.02297914810965436, 0.0001878280261246769)
"""Coefficients d00, d10, d20 of PWM fraction over grams of thrust, as flown (upstream README)."""
BRUSHLESS_C_F = 3.91e-8


def with_commanded_speed(table: pd.DataFrame) -> pd.DataFrame:
    """Throttles replaced by commanded rotor speeds, by the flight controller's own map from thrust to PWM.

    u = d00 + d10 f + d20 f² with f in grams of thrust; solved for f, and ω = sqrt(f g / C_F).
    """
    d00, d10, d20 = PWM_OF_GRAMS
    table = table.copy()
    for i, throttle in enumerate(crazyflie.THROTTLES, start=1):
        u = table[throttle].to_numpy()
        grams = (-d10 + np.sqrt(d10**2 - 4 * d20 * np.minimum(d00 - u, 0))) / (2 * d20)
        speed = np.sqrt(grams * 1e-3 * 9.81 / BRUSHLESS_C_F)
        place = table.columns.get_loc(throttle)
        table.insert(place, f"rotor_command_{i}_rad_s", speed)
        table = table.rename(columns={throttle: f"pwm_fraction_{i}"})
    return table


def _crazypad(path: Path, name: str) -> Runs:
    return _crazyflie(path, Path(name).name)


def _scale(path: Path, name: str) -> Runs:
    return {Path(name).name.removesuffix(".csv").replace(".", "_"): read_imrc_bench(path)}


def _bench(path: Path, name: str) -> Runs:
    motor, voltage = re.fullmatch(r"([a-m])\d_(7|11)\.csv", Path(name).name).groups()
    return {f"{motor}_{CELLS[voltage]}": read_rcbenchmark(path)}


def _public_sets() -> dict[str, PublicSet]:
    flights = ("20210218170320seg2", "20210218171908seg2", "20210223104803seg2", "20210223114138seg3")
    brushless = ("00", "01", "12", "13", "17", "18", "22", "24", "27")
    pad = {
        "normal": ("normal_flight", range(5)),
        "weight": ("add_weight_W1_near_M3", range(4, 7)),
        "cut": ("cut_propeller_M3_3mm", range(3)),
    }
    sets = {
        "neurobem": PublicSet(
            "neurobem",
            tuple(f"bemnn{f}.mat" for f in flights),
            _neurobem,
            "neurobem",
            FLU,
            notes=(
                "columns neurobem_force_*_n and neurobem_moment_*_n_m are NeuroBEM's own prediction",
                "columns angular_acceleration_*_rad_s2 come from the files",
            ),
        ),
        "appius-ground-effect": PublicSet(
            "appius-ground-effect",
            ("HOVERING.csv", "VERTICAL_SPEEDS.csv"),
            _whole(read_vicon_csv),
            "appius-ground-effect",
            "attitude and rates forward-right-down over x north, y east (lateral accelerations are -g pitch "
            "and +g roll); only z is turned over",
            notes=("rotor speeds arrive at about 3 Hz, poses at about 9 Hz: repeats are empty cells",),
        ),
        "imrc-brushless": PublicSet(
            "imrc-crazyflie-rpm",
            tuple(f"brushless_flights/eckart{n}" for n in brushless),
            _imrc_brushless,
            "imrc-brushless",
            FLU,
            notes=(
                "rotor_command is the speed for the thrust that the controller asked for, from its published "
                "map of thrust to PWM; the PWM itself rides along as pwm_fraction",
            ),
        ),
        "imrc-brushed": PublicSet(
            "imrc-crazyflie-rpm",
            ("brushed_flights/jana01", "brushed_flights/jana24"),
            lambda path, name: _crazyflie(path, Path(name).name),
            "imrc-brushed",
            FLU,
        ),
        "crazyflie-arpl-log10": PublicSet(
            "crazyflie-arpl",
            ("log10",),
            lambda path, name: _crazyflie(path, "log10", [(35.0, 65.0)]),
            "crazyflie-arpl",
            FLU,
            notes=(
                "thrust window 35-65 s as upstream",
                "upstream's notebook takes g as 9.18 (cell 6): its published thrust is 6.4 % low",
            ),
        ),
        "crazyflie-arpl-log15": PublicSet(
            "crazyflie-arpl",
            ("log15",),
            lambda path, name: _crazyflie(path, "log15", [(55.0, 90.0)]),
            "crazyflie-arpl",
            FLU,
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
        sets[f"imrc-bench-{name}"] = PublicSet(
            "imrc-crazyflie-rpm",
            tuple(f"{bench}/{file}.csv" for file in files),
            _scale,
            f"imrc-bench-{vehicle}",
            "thrust of the whole vehicle along -z of the body",
        )
    for label, (folder, numbers) in pad.items():
        sets[f"crazypad-{label}"] = PublicSet(
            "crazypad",
            tuple(f"{folder}/E9_log{n:02d}" for n in numbers),
            _crazypad,
            "crazypad",
            FLU,
            notes=("specific force is the state estimate's world acceleration turned into the body",),
        )
    for digit, propeller in PROPELLERS.items():
        for motor in (None, *MOTORS):
            runs = [(m, v) for m in (motor or MOTORS) for v in CELLS]
            name = f"strawson-{propeller}" + (f"-{motor}" if motor else "")
            sets[name] = PublicSet(
                "strawson-5inch-bench",
                tuple(f"rawdata/{m}{digit}_{v}.csv" for m, v in runs),
                _bench,
                "strawson-5inch-bench",
                "thrust along -z of the body, passed on to the sensor",
                held_out=(f"{motor}_2s",) if motor else tuple(f"{m}_2s" for m in MOTORS),
                notes=("held out: the runs on two cells, so that supply voltage is predicted, not fitted",),
            )
    return sets


PUBLIC_SETS = _public_sets()


def build(name: str, obtained: Obtained, source: dict, vehicles: Path, parent: Path) -> Path:
    """Write the set `name` below `parent`; returns its folder.

    Where a file could not be had, the folder holds `import_report.json` alone, which says so. Until all files are read
    there is no folder.

    Parameters
    ----------
    obtained
        The files of the set's source, already checked.
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
    lost = [file for file in recipe.files if file not in obtained.files]
    if lost:
        reason = obtained.missing.get(lost[0], f"{lost[0]} is not in the manifest")
        folder.mkdir(parents=True, exist_ok=True)
        ImportReport(name, False, **origin, reason=f"{len(lost)} files could not be had: {reason}").write(folder)
        return folder
    runs, faults = [], []
    for file in recipe.files:
        for run, (table, found) in recipe.read(obtained.folder / file, file).items():
            runs.append(Run(run, table))
            faults += [fault.in_run(run) for fault in found]
    believed = Path(vehicles) / f"{recipe.vehicle}.yaml"
    ordered = tuple(sorted(runs, key=lambda run: run.name))
    write_set(RecordingSet(name, read_vehicle(believed), ordered, recipe.held_out), Path(parent))
    shutil.copyfile(believed, folder / "vehicle.yaml")
    sums = {file["path"]: file["sha256"] for file in source["files"]}
    ImportReport(
        name,
        True,
        **origin,
        files={file: sums[file] for file in recipe.files},
        axes=recipe.axes,
        faults=tuple(faults),
        notes=recipe.notes,
    ).write(folder)
    return folder


def sets_of(source: str) -> list[str]:
    """Names of the sets made from one source."""
    return [name for name, recipe in PUBLIC_SETS.items() if recipe.source == source]
