"""Wrong recording sets, each with words that its one sentence must hold; made by code, none is kept as a file."""

import gzip
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet_file

from rotorid.recordings import columns as c

VEHICLE = """\
name: example
kind: flight
mass_kg: 0.652
inertia_kg_m2: {xx: 2.489e-3, yy: 2.5743e-3, zz: 4.6838e-3}
rotors:
  - {x_m: 0.0884, y_m: 0.0884, spin: ccw}
  - {x_m: 0.0884, y_m: -0.0884, spin: cw}
  - {x_m: -0.0884, y_m: -0.0884, spin: ccw}
  - {x_m: -0.0884, y_m: 0.0884, spin: cw}
thrust_coefficient_n_s2: 1.3877e-6
torque_coefficient_n_m_s2: 1.8558e-8
gravity_m_s2: 9.81
"""
SPEEDS = c.rotor_columns("rotor_speed", 4)
RATE_HZ = 20.0


def table(seconds: float = 10.0, seed: int = 0) -> pd.DataFrame:
    """A hover with noise in every sensor; five digits keep the files small."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE_HZ)
    columns = {"time_s": np.arange(count) / RATE_HZ}
    middle = dict.fromkeys(SPEEDS, 1073.0) | {"quaternion_w": 1.0, "specific_force_z_m_s2": -9.81}
    for name in (*SPEEDS, *c.QUATERNION, *c.ANGULAR_VELOCITY, *c.VELOCITY, *c.SPECIFIC_FORCE):
        columns[name] = middle.get(name, 0.0) + 0.02 * rng.standard_normal(count)
    return pd.DataFrame(columns).round(5)


RUN = table().to_csv(index=False)
LINES = RUN.splitlines()
WIDTH = LINES[0].count(",") + 1


@dataclass(frozen=True)
class Wrong:
    """One wrong set: `spoil` changes the folder of a sound one."""

    name: str
    spoil: Callable[[Path], object]
    said: tuple[str, ...]


def sound(folder: Path) -> Path:
    """A set of one run that is accepted."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.yaml").write_text(VEHICLE)
    (folder / "run.csv").write_text(RUN)
    return folder


def vehicle(old: str, new: str, *said: str) -> Wrong:
    """A vehicle in whose text something is changed."""
    assert old in VEHICLE, old
    return Wrong(
        f"vehicle {new.strip()[:60] or 'without ' + old.strip()[:40]}",
        _written("vehicle.yaml", VEHICLE.replace(old, new, 1)),
        ("vehicle.yaml", *said),
    )


def added(text: str, *said: str) -> Wrong:
    """A vehicle with a line more."""
    return Wrong(f"vehicle with {text[:60]}", _written("vehicle.yaml", VEHICLE + text + "\n"), ("vehicle.yaml", *said))


def file(name: str, content: str | bytes, what: str, *said: str) -> Wrong:
    """A file of the set with this content."""
    return Wrong(f"{name} {what}", _written(name, content), (name, *said))


def run(change: Callable[[list[str]], object], what: str, *said: str) -> Wrong:
    """A run whose lines are changed in place."""
    lines = list(LINES)
    change(lines)
    return Wrong(f"run {what}", _written("run.csv", "\n".join(lines) + "\n"), ("run.csv", *said))


def data(change: Callable[[pd.DataFrame], pd.DataFrame], what: str, *said: str) -> Wrong:
    """A run whose table is changed."""
    return Wrong(f"data {what}", _written("run.csv", change(table()).to_csv(index=False)), ("run.csv", *said))


def parquet(change: Callable[[pd.DataFrame], pd.DataFrame], what: str, *said: str) -> Wrong:
    """A run as Parquet whose table is changed."""
    spoil = _instead("run.parquet", lambda path: change(table()).to_parquet(path, index=False))
    return Wrong(f"parquet {what}", spoil, ("run.parquet", *said))


def zipped(content: bytes, what: str, *said: str) -> Wrong:
    """A gzipped run with these bytes."""
    spoil = _instead("run.csv.gz", lambda path: path.write_bytes(content))
    return Wrong(f"gzip {what}", spoil, ("run.csv.gz", *said))


def split(text: str, *said: str) -> Wrong:
    """A set of three runs with this split.yaml."""

    def spoil(folder: Path) -> None:
        for name in ("a", "b"):
            (folder / f"{name}.csv").write_text(RUN)
        (folder / "split.yaml").write_text(text)

    return Wrong(f"split {text.strip()[:50]!r}", spoil, ("split.yaml", *said))


def place(what: str, spoil: Callable[[Path], object], *said: str) -> Wrong:
    """A folder in which something is not what its name says."""
    return Wrong(f"folder {what}", spoil, said)


def _written(name: str, content: str | bytes) -> Callable[[Path], object]:
    data = content if isinstance(content, bytes) else content.encode()
    return lambda folder: (folder / name).write_bytes(data)


def _instead(name: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        (folder / ("run.csv" if name.startswith("run") else name)).unlink(missing_ok=True)
        make(folder / name)

    return spoil


def _renamed(old: str, new: str) -> Callable[[Path], object]:
    return lambda folder: (folder / old).rename(folder / new)


def vehicles() -> Iterator[Wrong]:
    """Wrong vehicles."""
    for key in ("mass_kg", "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "gravity_m_s2"):
        line = next(x for x in VEHICLE.splitlines() if x.startswith(key))
        for value in ("-1", "0", ".nan", ".inf", "1e300", "1e-300", "true", "heavy", "{a: 1}", "2024-01-01"):
            if (key, value) == ("torque_coefficient_n_m_s2", "{a: 1}"):
                continue
            yield vehicle(line, f"{key}: {value}", key)
        if key != "gravity_m_s2":
            yield vehicle(line + "\n", "", "needs", key)
            yield vehicle(line, f"{key}: null", "needs", key)
        yield vehicle(key, key[:-1], key[:-1], f"did you mean {key}?")
        yield vehicle(line, f"{line}\n{line}", "twice", key)
    for old, new, *said in (
        ("name: example\n", "", "name: is missing"),
        ("name: example", "name: [a, b]", "name", "expected text"),
        ("name: example", "name: {a: 1}", "name", "expected text"),
        ("name: example", "name: true", "name", "true"),
        ("name: example", "name: null", "name", "expected text"),
        ("kind: flight\n", "", "kind: is missing"),
        ("kind: flight", "kind: fly", "kind", "'fly'", "'flight'"),
        ("kind: flight", "kind: Flight", "kind", "'flight'"),
        ("kind: flight", "kind: [flight]", "kind"),
        ("kind: flight", "kind: [flight", "not valid YAML", "line"),
        ("kind: flight", "kind: flight\n\tx: 1", "line 3", "not valid YAML"),
        ("kind: flight", "kind: &a flight\nname: *b", "not valid YAML", "alias"),
        ("kind: flight", "kind: !!python/object/apply:os.system [exit]", "not valid YAML", "line 2"),
        ("kind: flight", "kind: flight\nKind: flight", "Kind: no such key", "did you mean kind?"),
        ("kind: flight", "kind: flight\n1: 2", "1: no such key"),
        ("kind: flight", "kind: flight\n? [a, b]\n: 2", "line 3", "where a key is expected"),
        ("xx: 2.489e-3, ", "", "inertia_kg_m2.xx: is missing"),
        ("xx: 2.489e-3", "xx: 0", "inertia_kg_m2.xx", "found 0"),
        ("xx: 2.489e-3", "xx: true", "xx", "true"),
        ("xx: 2.489e-3", "xx: .inf", "inertia_kg_m2.xx", "a finite number"),
        ("xx: 2.489e-3", "XX: 2.489e-3", "inertia_kg_m2", "did you mean xx?"),
        ("xx: 2.489e-3", "xx: 2.489e-3, xx: 1e-3", "xx is there twice"),
        ("xx: 2.489e-3", "xx: 2.489e-3, xy: 3e-3", "positive definite"),
        ("zz: 4.6838e-3", "zz: 4.6838e-2", "no body"),
        ("{xx: 2.489e-3, yy: 2.5743e-3, zz: 4.6838e-3}", "2.5e-3", "inertia_kg_m2"),
        ("{xx: 2.489e-3, yy: 2.5743e-3, zz: 4.6838e-3}", "[2.5e-3, 2.5e-3, 4e-3]", "inertia_kg_m2"),
        ("spin: ccw", "spin: left", "rotors.0.spin", "'ccw' or 'cw'"),
        ("spin: ccw", "spin: 1", "rotors.0.spin"),
        (", spin: ccw}", "}", "rotors.0.spin: is missing"),
        ("x_m: 0.0884, y_m: 0.0884", "x: 0.0884, y_m: 0.0884", "rotors.0", "x"),
        ("x_m: 0.0884, y_m: 0.0884", "x_m: a, y_m: 0.0884", "rotors.0.x_m", "a number"),
        ("x_m: 0.0884, y_m: 0.0884", "x_m: 88.4e3, y_m: 0.0884", "rotors.0.x_m", "at most 100"),
        ("x_m: 0.0884, y_m: 0.0884", "x_m: -0.0884, y_m: -0.0884", "rotors 1 and 3 are on one spot"),
        ("  - {x_m: 0.0884, y_m: 0.0884, spin: ccw}\n", "  - 5\n", "rotors.0"),
        ("thrust_coefficient_n_s2: 1.3877e-6", "thrust_coefficient_n_s2: [1e-6, 1e-6]", "2 values for 4 rotors"),
        ("thrust_coefficient_n_s2: 1.3877e-6", "thrust_coefficient_n_s2: [1e-6, 1e-6, 1e-6, -1e-6]", "positive"),
        ("thrust_coefficient_n_s2: 1.3877e-6", "thrust_coefficient_n_s2: [1e-6, 1e-6, 1e-6, x]", "thrust_coefficient"),
        ("thrust_coefficient_n_s2: 1.3877e-6", "thrust_coefficient_n_s2: [1e-6, 1e-6, 1e-6, true]", "true"),
        ("thrust_coefficient_n_s2: 1.3877e-6", "thrust_coefficient_n_s2: 1,3877e-6", "thrust_coefficient"),
        (VEHICLE, "", "expected keys with values, found nothing"),
        (VEHICLE, "- a\n", "expected keys with values, found a list"),
        (VEHICLE, "hello\n", "expected keys with values, found plain text"),
        (VEHICLE, "a: &a [*a]\n", "refers to itself"),
        (VEHICLE, "a: &a {b: *a}\n", "refers to itself"),
        (VEHICLE, "x: " + "[" * 400 + "]" * 400, "nested too deeply"),
        (VEHICLE, "x: " + "[" * 20000 + "]" * 20000, "nested too deeply"),
        (VEHICLE, "x: " + "{a: " * 300 + "1" + "}" * 300, "nested too deeply"),
        (VEHICLE, "---\na: 1\n---\nb: 2\n", "not valid YAML", "line 3"),
        (VEHICLE, "# x\n" * 3_000_000, "MB, expected at most 1 MB"),
        (VEHICLE, "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
            f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join(['*' + chr(97 + k)] * 9)}]\n" for k in range(9)),
         "more than 20000 values"),
        (VEHICLE, VEHICLE + "date: 2024-99-99\n", "not valid YAML", "month"),
        ("mass_kg: 0.652", "mass_kg: 0652", "line 3: found 0652, which YAML takes for 426"),
        ("mass_kg: 0.652", "mass_kg: 1:30", "line 3: found 1:30, which YAML takes for 90"),
        ("mass_kg: 0.652", "mass_kg: 1:30.5", "line 3: found 1:30.5, which YAML takes for 90.5"),
        ("mass_kg: 0.652", "mass_kg: 6_52.0", "line 3: found 6_52.0, which YAML takes for 652"),
        ("mass_kg: 0.652", "mass_kg: 1_0", "line 3: found 1_0, which YAML takes for 10"),
        ("mass_kg: 0.652", "mass_kg: 0x10", "line 3: found 0x10, which YAML takes for 16"),
        ("mass_kg: 0.652", "mass_kg: 0b101", "line 3: found 0b101, which YAML takes for 5"),
        ("mass_kg: 0.652", "mass_kg: !!int '0652'", "line 3: found 0652"),
        ("mass_kg: 0.652", "mass_kg: !!binary MC42NTI=", "line 3: found !!binary"),
        ("mass_kg: 0.652", "mass_kg: !!set {0.652}", "line 3: found !!set"),
        ("mass_kg: 0.652", "mass_kg: 08", "mass_kg: found '08', expected a number"),
        ("mass_kg: 0.652", "mass_kg: 6_52e-3", "mass_kg: found '6_52e-3', expected a number"),
        ("mass_kg: 0.652", "mass_kg: '6_52'", "mass_kg: found '6_52', expected a number"),
        ("mass_kg: 0.652", "mass_kg: '0.652'", "mass_kg: found '0.652', expected a number (without quotes"),
        ("mass_kg: 0.652", "mass_kg: ٠.٦٥٢", "mass_kg", "expected a number"),
        ("mass_kg: 0.652", "mass_kg: yes", "mass_kg: found true, expected a number"),
        ("name: example", "name: 0652", "line 1: found 0652", "in quotes where text is meant"),
        ("name: example", "name: !!binary aGVsbG8=", "line 1: found !!binary"),
    ):  # fmt: skip
        yield vehicle(old, new, *said)
    for text, *said in (
        ("colour: red", "colour: no such key is known"),
        ("trust: {mass: 0.1}", "trust.mass", "did you mean mass_kg?"),
        ("trust: {mass_kg: -0.1}", "trust of mass_kg is -0.1"),
        ("trust: {mass_kg: 1e160}", "trust of mass_kg is 1e+160", "0 to 100"),
        ("trust: {mass_kg: .nan}", "trust"),
        ("trust: {mass_kg: a}", "trust.mass_kg", "a number"),
        ("trust: {mass_kg: true}", "trust", "true"),
        ("trust: 0.1", "trust", "keys with values"),
        ("noise: {force: 0.1}", "noise.force", "did you mean force_n?"),
        ("noise: {force_n: -0.1}", "noise.force_n"),
        ("noise: {colour: 0.1}", "noise.colour: no such key"),
        ("effects: [{id: rotor_drag, form: x, parameters: {}}]", "effects", "improved_vehicle.yaml"),
        ("reading_gain: [1, 1, 1.1]", "reading_gain", "improved_vehicle.yaml"),
        ("rotor_radius_m: 0", "rotor_radius_m"),
        ("rotor_radius_m: 63.5e3", "rotor_radius_m", "at most 100"),
        ("rotor_inertia_kg_m2: -1", "rotor_inertia_kg_m2"),
        ("ground_z_m: .inf", "ground_z_m", "a finite number"),
        ("accelerometer_position_m: [0, 0]", "accelerometer_position_m"),
        ("accelerometer_position_m: [0, 0, 1e6]", "accelerometer_position_m.2", "at most 100"),
        ("accelerometer_position_m: 0.1", "accelerometer_position_m", "a list"),
        ("sensor_position_m: [0, 0, x]", "sensor_position_m.2", "a number"),
        ("sensor_mount: tilted", "sensor_mount", "'tilting'"),
        ("tared: maybe", "tared", "true or false"),
        ("tared: 'true'", "tared: found 'true', expected true or false"),
        ('tared: "no"', "tared: found 'no', expected true or false"),
        ("tared: 1", "tared: found 1, expected true or false"),
        ("trust: {mass_kg: '0.1'}", "trust.mass_kg: found '0.1', expected a number"),
        ("rotor_speed_limits_rad_s: [0, 2_500]", "line 13: found 2_500"),
        ("rotor_speed_limits_rad_s: [2500, 0]", "0 <= low < high"),
        ("rotor_speed_limits_rad_s: [0, 0]", "0 <= low < high"),
        ("rotor_speed_limits_rad_s: [-1, 2500]", "0 <= low < high"),
        ("rotor_speed_limits_rad_s: [0, .inf]", "rotor_speed_limits_rad_s"),
        ("rotor_speed_limits_rad_s: 2500", "rotor_speed_limits_rad_s", "a list"),
        ("rotor_speed_limits_rad_s: [0, 1, 2]", "rotor_speed_limits_rad_s"),
    ):
        yield added(text, *said)
    stand = "name: s\nkind: stand\n"
    yield file("vehicle.yaml", stand, "of a bare stand", "kind stand needs rotors and thrust_coefficient_n_s2")
    for encoding, said in (("utf-16", "UTF-16"), ("utf-16-le", "UTF-16"), ("utf-32", "UTF-16")):
        yield file("vehicle.yaml", VEHICLE.encode(encoding), f"as {encoding}", said)
    yield file("vehicle.yaml", VEHICLE.replace("example", "Übung").encode("latin-1"), "as Latin-1", "line 1", "0xdc")
    yield file("vehicle.yaml", VEHICLE.encode() + b"\0\0", "with zero bytes", "zero byte")
    yield file("vehicle.yaml", bytes(range(256)) * 20, "binary", "vehicle.yaml")
    yield file("vehicle.yaml", VEHICLE.replace("example", "a\x07b"), "with a bell in it", "not valid YAML")


def runs() -> Iterator[Wrong]:
    """Wrong runs as text."""
    head = LINES[0]
    yield file("run.csv", "", "empty", "is empty")
    yield file("run.csv", "\n\n\n", "of blank lines", "is empty")
    yield file("run.csv", head + "\n", "with a heading only", "too little data", "found 0")
    yield file("run.csv", "\n".join(LINES[:2]) + "\n", "with one sample", "too little data", "found 1")
    yield file("run.csv", "\n".join(LINES[:3]) + "\n", "with two samples", "too little data", "2 samples")
    yield file("run.csv", "\n".join(LINES[:21]) + "\n", "of one second", "too little data", "lasts 0.95 s")
    yield file("run.csv", "\n".join(LINES[:100]) + "\n", "of five seconds", "at least 9 s")
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        yield file("run.csv", RUN.encode(encoding), f"as {encoding}", "UTF-16")
    umlauts = RUN.replace("velocity_x_m_s", "größe_x_m", 1)
    yield file("run.csv", umlauts.encode("latin-1"), "as Latin-1", "line 1", "0xf6")
    yield file("run.csv", RUN.encode() + b"\xff\xfe", "with bytes that are no text", f"line {len(LINES) + 1}", "0xff")
    yield file("run.csv", RUN[:3000].encode() + b"\0" * 40 + RUN[3000:].encode(), "with zero bytes", "zero byte")
    yield file("run.csv", np.random.default_rng(0).bytes(20000), "binary", "run.csv")
    yield file("run.csv", b"\x7fELF" + bytes(2000), "a program", "zero byte")
    yield file("run.csv", gzip.compress(RUN.encode()), "gzipped without .gz", "run.csv")
    yield file("run.csv", RUN.replace(".", ";").replace(",", ".").replace(";", ","), "decimal commas", "run.csv")
    yield file("run.csv", RUN.replace(",", ";").replace(".", ","), "semicolons", "separated by semicolons")
    yield file("run.csv", RUN.replace(",", ";"), "semicolons and points", "separated by semicolons")
    yield file("run.csv", RUN.replace(",", "\t"), "tabs", "separated by tabs")
    yield file("run.csv", RUN.replace(",", "|"), "bars", "separated by bars")
    yield file("run.csv", RUN.replace(",", " "), "blanks", "run.csv")
    yield file("run.csv", "{}\n", "JSON", "time_s is missing")
    yield file("run.csv", "<html><body>404</body></html>\n", "HTML", "time_s is missing")
    yield file("run.csv", "\n".join(LINES[1:]) + "\n", "without a heading", "line 1", "found numbers")
    yield file("run.csv", "x" * 3_000_000, "one endless line", "line 1: is longer than 1 MB")
    yield file("run.csv", RUN[:-40], "cut off", f"line {len(LINES)}", "cut off")

    def cell(line: int, column: int, text: str) -> Callable[[list[str]], None]:
        def change(lines: list[str]) -> None:
            cells = lines[line - 1].split(",")
            cells[column] = text
            lines[line - 1] = ",".join(cells)

        return change

    for text in ("oops", "1.2.3", "12:30:00", "2024-01-01", "1_000", "0x10", "--", "1 000", "True"):
        yield run(cell(7, 3, text), f"with {text}", "line 7, column rotor_speed_3_rad_s", f"found {text!r}")
        yield run(cell(7, 0, text), f"with {text} in time_s", "line 7, column time_s", f"found {text!r}")
    yield run(cell(7, 3, "inf"), "with inf", "line 7, column rotor_speed_3_rad_s", "found inf")
    yield run(cell(7, 3, "-Infinity"), "with -Infinity", "line 7, column rotor_speed_3_rad_s", "found -inf")
    yield run(cell(7, 3, "1e300"), "with 1e300", "line 7, column rotor_speed_3_rad_s", "1e+300")
    yield run(cell(7, 3, "1e999"), "with 1e999", "line 7, column rotor_speed_3_rad_s", "found inf")
    yield run(cell(7, 3, "9" * 400), "with 400 nines", "line 7, column rotor_speed_3_rad_s")
    yield run(cell(7, 0, ""), "with a time that is empty", "line 7", "time_s is empty")
    yield run(cell(len(LINES), 0, "inf"), "that ends at inf", f"line {len(LINES)}", "time_s is inf")
    yield run(cell(7, 0, "0.3"), "with a time there twice", "line 8", "0.3 after 0.3", "increase strictly")
    yield run(cell(7, 0, "-5"), "with a time that goes back", "line 7", "increase strictly")

    def heading(old: str, new: str) -> Callable[[list[str]], None]:
        return lambda lines: lines.__setitem__(0, head.replace(old, new, 1))

    def line_5(change: Callable[[str], str]) -> Callable[[list[str]], None]:
        return lambda lines: lines.__setitem__(4, change(lines[4]))

    def all_but_heading(change: Callable[[str], str]) -> Callable[[list[str]], None]:
        return lambda lines: lines.__setitem__(slice(1, None), map(change, lines[1:]))

    yield run(heading("time_s", "time"), "time", "time_s is missing", "is time meant?")
    yield run(heading("time_s", "t"), "t", "time_s is missing", "is t meant?")
    yield run(heading("time_s", "Time_s"), "Time_s", "time_s is missing")
    yield run(heading("_x_m_s,", "_y_m_s,"), "same heading", "is there twice")
    yield run(heading("velocity_x_m_s", ""), "no heading", "has no name")
    yield run(line_5(lambda line: line + ",5"), "cell too many", "line 5", f"has {WIDTH + 1} cells")
    yield run(line_5(lambda line: line.rsplit(",", 1)[0]), "cell too few", "line 5", f"has {WIDTH - 1} cells")
    yield run(all_but_heading(lambda line: line + ",1"), "cells too many", "line 2", "cells")
    yield run(all_but_heading(lambda line: line + ","), "comma at each end", "line 2", "cells")
    yield run(all_but_heading(lambda line: "7," + line), "index", "line 2", "cells")
    yield run(line_5(lambda line: '"' + line), "quote never closed", "run.csv")
    yield run(heading("time_s", '"time_s\nx",time_s'), "heading over two lines", "run.csv")
    for column, name in ((1, "rotor_speed_0_rad_s"), (4, "rotor_speed_5_rad_s")):
        words = "numbered from 1" if name.endswith("0_rad_s") else "lists 4 rotors only"
        yield run(cell(1, column, name), name, f"column {name}", words)
    yield data(lambda t: t.assign(throttle_9=0.5), "throttle_9", "column throttle_9", "lists 4 rotors only")
    for old, new in (
        ("rotor_speed_1_rad_s", "rotor_speed1_rad_s"), ("rotor_speed_1_rad_s", "Rotor_Speed_1_rad_s"),
        ("rotor_speed_1_rad_s", "rotor_speed_01_rad_s"), ("velocity_x_m_s", "velocity_x_ms"),
        ("velocity_x_m_s", "velocty_x_m_s"), ("quaternion_w", "quarternion_w"),
        ("angular_velocity_z_rad_s", "angular_velocity_z_rads"), ("specific_force_x_m_s2", "specific_force_x_ms2"),
    ):  # fmt: skip
        rotor = old.startswith("rotor") and new != "rotor_speed_01_rad_s"
        said = "rotor" if rotor else new
        yield data(lambda t, o=old, n=new: t.rename(columns={o: n}), f"{new} for {old}", old, said)


def contents() -> Iterator[Wrong]:
    """Runs that are tables and hold nothing that can be compared."""

    def put(names: tuple[str, ...], value: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
        return lambda t: t.assign(**dict.fromkeys(names, value))

    def without(names: tuple[str, ...]) -> Callable[[pd.DataFrame], pd.DataFrame]:
        return lambda t: t.drop(columns=list(names))

    def at(row: int, names: tuple[str, ...], value: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
        return lambda t: t.assign(**{n: t[n].where(t.index != row, value) for n in names})

    def clock(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[pd.DataFrame], pd.DataFrame]:
        return lambda t: t.assign(time_s=change(t["time_s"].to_numpy()))

    for name in SPEEDS:
        yield data(without((name,)), f"without {name}", f"column {name} is missing", "lists 4 rotors")
        yield data(put((name,), np.nan), f"with {name} empty", f"column {name} is empty")
    yield data(without(SPEEDS), "without rotors", "no thrust can be predicted")
    yield data(put(SPEEDS, np.nan), "with rotors empty", "no thrust can be predicted", "empty")
    yield data(put(SPEEDS, 0.0), "with rotors at rest", "are 0 throughout")
    yield data(put(c.QUATERNION, 0.0), "with quaternions zero", "norm 0, expected 1")
    yield data(at(9, c.QUATERNION, 0.0), "with one quaternion zero", "line 11", "norm 0, expected 1")
    yield data(at(9, ("quaternion_w",), 57.3), "with one quaternion long", "line 11", "norm 57.3")
    yield data(lambda t: t[["time_s"]], "with the time alone", "no thrust can be predicted")
    yield data(lambda t: t[["time_s", *SPEEDS]], "with rotors alone", "nothing can be compared")
    yield data(lambda t: t[["time_s", *SPEEDS, *c.VELOCITY]], "with velocity alone", "nothing can be compared")
    yield data(put(tuple(LINES[0].split(",")[1:]), np.nan), "all empty", "no thrust can be predicted")
    yield data(put(tuple(LINES[0].split(",")[1:]), 0.0), "all zero", "run.csv")
    yield data(put(tuple(LINES[0].split(",")[5:]), 1.0), "all constant", "nothing can be compared")
    for name, most in (("velocity_x_m_s", 1e5), ("angular_velocity_x_rad_s", 1e6), ("specific_force_x_m_s2", 1e6)):
        said = f"line 11, column {name}", "expected a number of at most"
        yield data(at(9, (name,), most), f"{name} of {most:g}", *said)
    huge = np.where(table().index == 9, -1e300, 1)
    yield data(lambda t: t.assign(my_sensor=huge), "1e300 in my_sensor", "line 11", "my_sensor")
    yield data(clock(lambda t: t * 1e3), "in milliseconds", "step of 50 s", "milliseconds?")
    yield data(clock(lambda t: t * 1e6), "in microseconds", "step of 50000 s", "microseconds?")
    yield data(clock(lambda t: t * 1e9), "in nanoseconds", "nanoseconds?")
    yield data(clock(lambda t: t * 20), "at 1 Hz", "step of 1 s")
    yield data(clock(lambda t: t + 1e6 * (t > 5)), "with a jump of 1e6 s", "line 103", "jumps by 1e+06 s")
    yield data(clock(lambda t: t + 3600 * (t > 5)), "with a clock set to summer time", "line 103", "jumps by 3600.05 s")
    yield data(clock(lambda t: t + 1.7e9 * (t > 5)), "with the clock set", "line 103", "jumps by 1.7e+09 s")
    yield data(clock(lambda t: np.where(t > 9.9, 1e300, t)), "that ends at 1e300", "line 201", "jumps by 1e+300 s")
    holes = {n: table()[n].where(table().index % 40 < 20) for n in SPEEDS}
    yield data(lambda t: t.assign(**holes), "with holes", "longest stretch")
    yield data(lambda t: t.iloc[:60], "of three seconds", "too little data")


def tables() -> Iterator[Wrong]:
    """Wrong Parquet and gzip files."""
    text = pd.Series(["a"] * 200)
    yield parquet(lambda t: t.drop(columns="time_s"), "without time_s", "time_s is missing")
    yield parquet(lambda t: t.assign(velocity_x_m_s=text), "with text", "row 1, column velocity_x_m_s", "found 'a'")
    yield parquet(lambda t: t.assign(time_s=text), "with text as time", "row 1, column time_s", "found 'a'")
    yield parquet(lambda t: t.assign(mode=text), "with text in another column", "row 1, column mode")
    yield parquet(lambda t: t.assign(velocity_x_m_s=True), "with true", "row 1, column velocity_x_m_s")
    dates = pd.to_datetime(table()["time_s"], unit="s")
    yield parquet(lambda t: t.assign(time_s=dates), "with dates", "row 1, column time_s")
    yield parquet(lambda t: t.assign(x=[[1.0, 2.0]] * 200), "with lists", "row 1, column x")
    yield parquet(lambda t: t.assign(x=[{"a": 1}] * 200), "with mappings", "row 1, column x")
    yield parquet(lambda t: t.assign(x=[b"\0"] * 200), "with bytes", "row 1, column x")
    yield parquet(lambda t: t.iloc[:0], "without rows", "too little data")
    yield parquet(lambda t: t.iloc[:1], "with one row", "too little data")
    backwards = table()["time_s"].to_numpy()[::-1]
    yield parquet(lambda t: t.assign(time_s=backwards), "backwards", "row 2", "increase strictly")
    yield parquet(lambda t: t.assign(velocity_x_m_s=np.inf), "with inf", "row 1, column velocity_x_m_s", "found inf")
    yield parquet(lambda t: t.rename(columns={"velocity_x_m_s": ""}), "with a column without a name", "has no name")
    broken_name = {"velocity_x_m_s": "a\nb"}
    yield parquet(lambda t: t.rename(columns=broken_name), "with a line break in a name", "control character")

    def whole() -> bytes:
        return table().to_parquet(None, index=False)

    def broken(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
        return _instead("run.parquet", lambda path: path.write_bytes(change(whole())))

    for what, change in (
        ("cut off", lambda x: x[: len(x) // 2]),
        ("without its end", lambda x: x[:-4]),
        ("without its beginning", lambda x: x[100:]),
        ("with a byte of its data changed", lambda x: x[:200] + bytes([x[200] ^ 255] * 50) + x[250:]),
        ("with its footer changed", lambda x: x[:-300] + b"\xff" * 200 + x[-100:]),
        ("empty", lambda x: b""),
        ("CSV", lambda x: RUN.encode()),
    ):
        yield Wrong(f"parquet {what}", broken(change), ("run.parquet",))

    packed = gzip.compress(RUN.encode(), mtime=0)
    yield zipped(b"", "empty", "is empty")
    yield zipped(RUN.encode(), "not zipped at all", "no whole gzip file")
    yield zipped(packed[: len(packed) // 2], "cut off", "cut off")
    yield zipped(packed[:-4], "without its end", "cut off")
    yield zipped(packed[:-8] + b"\0" * 8, "with a wrong checksum", "no whole gzip file")
    yield zipped(packed + b"more", "with more behind it", "no whole gzip file")
    yield zipped(gzip.compress(RUN.encode("utf-16")), "as UTF-16", "UTF-16")
    yield zipped(gzip.compress(b"\0" * 150_000_000), "bomb of zero bytes", "run.csv.gz")
    rows = LINES[0].encode() + b"\n" + b"0," * (WIDTH - 1) + b"0\n"
    yield zipped(gzip.compress(rows * 900_000), "bomb of lines", "unpacks to more than 100 MB")
    yield zipped(packed + bytes(3_000_000), "with zero bytes behind it", "more than 1 MB of zero bytes")
    yield zipped(gzip.compress(b""), "of nothing", "is empty")
    yield zipped(gzip.compress(RUN.replace(",", ";").encode()), "semicolons", "semicolons")
    yield zipped(gzip.compress(gzip.compress(RUN.encode())), "twice", "run.csv.gz")


def splits() -> Iterator[Wrong]:
    """Wrong splits."""
    for text, *said in (
        ("held_out: 5\n", "expected a list of runs"), ("held_out: run\n", "found run, expected a list of runs"),
        ("held_out:\n", "found nothing"), ("held_out: []\n", "names no run"), ("held_out: {run: 1}\n", "found keys"),
        ("held_out: [[a]]\n", "expected names of runs"), ("held_out: [x]\n", "names run x, which is not in the set"),
        ("held_out: [runn]\n", "names run runn", "did you mean run?"),
        ("held_out: [run.csv]\n", "names run run.csv", "did you mean run?"), ("held_out: [002]\n", "names run 002"),
        ("held_out: [yes]\n", "names run yes"), ("held_out: [1e3]\n", "names run 1e3"),
        ("held_out: [!!binary YQ==]\n", "line 1: found !!binary"), ("held_out: [a, a]\n", "names run a twice"),
        ("held_out: [a, b, run]\n", "every run is held out"),
        ("held_out: [a]\ntraining: [b]\n", "training: no such key is known"),
        ("heldout: [a]\n", "heldout: no such key is known", "did you mean held_out?"),
        ("held_out: [a]\nheld_out: [b]\n", "twice", "line 2"), ("- a\n", "expected keys with values, found a list"),
        ("", "found nothing"), ("held_out: [a\n", "not valid YAML"), ("held_out: &a [*a]\n", "refers to itself"),
        ("held_out: ['a\n', b]\n", "held_out"),
    ):  # fmt: skip
        yield split(text, *said)


def places() -> Iterator[Wrong]:
    """Folders, links, pipes and names."""
    yield place("without a vehicle", lambda f: (f / "vehicle.yaml").unlink(), "vehicle.yaml: file is missing")
    yield place("with vehicle.yml", _renamed("vehicle.yaml", "vehicle.yml"), "did you mean vehicle.yml?")
    yield place("with Vehicle.yaml", _renamed("vehicle.yaml", "Vehicle.yaml"), "did you mean Vehicle.yaml?")
    yield place("without a run", lambda f: (f / "run.csv").unlink(), "no run found")
    yield place("with run.CSV", _renamed("run.csv", "run.CSV"), "small letters")
    yield place("with run.txt", _renamed("run.csv", "run.txt"), "no run found")
    yield place("with split.yml", _written("split.yml", "held_out: [run]\n"), "expected the name split.yaml")
    yield place("with one run twice", _written("run.csv.gz", gzip.compress(RUN.encode())), "run run is there twice")
    yield place("with a line break in a name", _renamed("run.csv", "a\nb.csv"), "line break")
    yield place("with a bell in a name", _renamed("run.csv", "a\ab.csv"), "control character")
    for name in ("vehicle.yaml", "run.csv", "run.csv.gz", "run.parquet", "split.yaml"):
        yield place(f"as {name}", _instead(name, Path.mkdir), name, "is a folder")
        yield place(f"pipe as {name}", _instead(name, os.mkfifo), name, "is a pipe")
        yield place(f"loop of links as {name}", _instead(name, lambda p: p.symlink_to(p)), name, "cannot be opened")
        dangling = _instead(name, lambda p: p.symlink_to("nowhere"))
        yield place(f"dangling link as {name}", dangling, name, "where no file is")
    device = _instead("run.csv", lambda p: p.symlink_to("/dev/zero"))
    yield place("zero device as run.csv", device, "run.csv", "is a pipe")


def instruments() -> Iterator[Wrong]:
    """Benches and stands that hold nothing to compare."""

    def instrument(kind: str, count: int, noise: float) -> Callable[[Path], None]:
        def spoil(folder: Path) -> None:
            rest = VEHICLE.split("\n", 2)[2] if kind == "stand" else ""
            (folder / "vehicle.yaml").write_text(f"name: x\nkind: {kind}\n{rest}tared: true\n")
            rng = np.random.default_rng(0)
            columns = {"time_s": np.arange(count) / RATE_HZ}
            loads = SPEEDS if kind == "stand" else c.REFERENCE_FORCE
            columns |= {name: np.full(count, 900.0 if kind == "stand" else 2.0) for name in loads}
            columns |= {name: 2.0 + noise * rng.standard_normal(count) for name in c.FORCE}
            pd.DataFrame(columns).to_csv(folder / "run.csv", index=False)

        return spoil

    for kind in ("bench", "stand"):
        one_value = "one value in every run", "force_x_n = 2"
        yield place(f"{kind} that reads one value", instrument(kind, 200, 0.0), *one_value)
        for count in (10, 40, 65):
            said = "run.csv", "too little data", "at least 3.6 s", "its last third"
            yield place(f"{kind} of {count} rows", instrument(kind, count, 0.1), *said)


def large() -> Iterator[Wrong]:
    """Sets that are small on the disk, or quickly made, and larger than any recording."""

    def case(what: str, name: str, make: Callable[[Path], object], *said: str) -> Wrong:
        return Wrong(f"large {what}", _instead(name, make), (name, *said))

    def sparse(content: bytes, size: int) -> Callable[[Path], None]:
        def make(path: Path) -> None:
            path.write_bytes(content)
            os.truncate(path, size)

        return make

    def columns(count: int, **others: pa.Array) -> Callable[[Path], None]:
        return lambda path: parquet_file.write_table(pa.table({"time_s": np.arange(count) / 100.0, **others}), path)

    def zeros(path: Path) -> None:
        names = ["time_s", *(f"x{k}" for k in range(24))]
        part = pa.table(dict.fromkeys(names, pa.array(np.zeros(1_000_000))))
        options = {"compression": "zstd", "use_dictionary": False}
        with parquet_file.ParquetWriter(path, part.schema, **options) as writer:
            for _ in range(6):
                writer.write_table(part)

    def plain_text(path: Path) -> None:
        text = pa.array(["x" * 1_000_000] * 200)
        options = {"compression": "zstd", "use_dictionary": False}
        parquet_file.write_table(pa.table({"time_s": np.arange(200) / 20.0, "note": text}), path, **options)

    def more_runs(folder: Path) -> None:
        for number in range(3000):
            os.link(folder / "run.csv", folder / f"run{number:04}.csv")

    words = pa.DictionaryArray.from_arrays(pa.array(np.zeros(5000, "i4")), pa.array(["x" * 1_000_000]))
    lists = pa.concat_arrays([pa.array([[0.0] * 100_000] * 10)] * 25)
    end, samples = gzip.compress(b"", mtime=0), "has more than 5000000 samples"
    packed = gzip.compress(RUN.encode(), mtime=0)
    yield case("parquet of 1.2 GB of zeros", "run.parquet", zeros, samples)
    yield case("parquet of 5 GB of text", "run.parquet", columns(5000, note=words), "column note", "found 'xxx")
    yield case("parquet of 200 MB of text", "run.parquet", plain_text, "unpacks to more than 100 MB")
    yield case("parquet of 200 MB of lists", "run.parquet", columns(250, x=lists), "column x", "found list")
    yield case("parquet of 10 million rows", "run.parquet", columns(10_000_000), samples)
    yield case("CSV of 10 million rows", "run.csv", lambda p: p.write_bytes(b"time_s,x\n" + b"0,0\n" * 10**7), samples)
    parts = packed + end * 300_000
    yield case("gzip of 300 000 parts", "run.csv.gz", lambda p: p.write_bytes(parts), "20000 gzipped parts")
    yield case("sparse file of 3 GB", "run.csv", sparse(b"", 3 * 10**9), "has 3000 MB, expected at most 2500 MB")
    yield case("sparse file of 2 GB", "run.csv", sparse(RUN.encode(), 2 * 10**9), f"line {len(LINES) + 1}", "zero byte")
    yield case("sparse gzip of 2 GB", "run.csv.gz", sparse(packed, 2 * 10**9), "more than 1 MB of zero bytes")
    yield case("sparse parquet of 3 GB", "run.parquet", sparse(b"PAR1", 3 * 10**9), "cannot be read as a table")
    no_room = sparse(VEHICLE.encode(), 3 * 10**9)
    yield place(
        "large sparse vehicle of 3 GB", lambda f: no_room(f / "vehicle.yaml"), "vehicle.yaml", "expected at most 1 MB"
    )
    yield place("large for its 3000 runs", more_runs, "has 3001 runs, expected at most 1000")


def all_wrong() -> list[Wrong]:
    """Every wrong set, each with a name of its own."""
    groups = (vehicles, runs, contents, tables, splits, places, instruments, large)
    found = [wrong for group in groups for wrong in group()]
    return [replace(wrong, name=f"{k:03d} {wrong.name}") for k, wrong in enumerate(found, 1)]
