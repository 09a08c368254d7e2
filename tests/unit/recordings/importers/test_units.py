"""Units as headings and names of columns write them, and the exports of thrust stands in every one of them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import columns as c
from rotorid.recordings.importers.guessing import guess
from rotorid.recordings.importers.guessing.names import families
from rotorid.recordings.importers.logfile import importer_of, set_of_logs
from rotorid.recordings.importers.mapping import SPELLINGS, UNITS, bracketed, converted, read_columns, stated, unit_of
from rotorid.recordings.importers.rcbenchmark import HEADINGS, read_rcbenchmark
from tests.refusals import refused

POUND, OUNCE, FOOT, INCH = 4.44822161526, 0.278013850954, 0.3048, 0.0254
WRITTEN = {  # kind: a text and what 1 of it is in the contract's unit
    "force": {"N": 1, "newton": 1, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "kg": 9.80665, "kp": 9.80665,
              "gf": 9.80665e-3, "g": 9.80665e-3, "grams": 9.80665e-3, "gram-force": 9.80665e-3, "lbf": POUND,
              "lb": POUND, "lbs": POUND, "ozf": OUNCE, "oz": OUNCE},
    "torque": {"N·m": 1, "Nm": 1, "N*m": 1, "N m": 1, "N-m": 1, "N.m": 1, "N⋅m": 1, "N·cm": 1e-2, "Ncm": 1e-2,
               "N·mm": 1e-3, "mN·m": 1e-3, "mNm": 1e-3, "kgf·m": 9.80665, "kgf·cm": 0.0980665, "kg-cm": 0.0980665,
               "gf·cm": 9.80665e-5, "lbf·ft": POUND * FOOT, "ft-lb": POUND * FOOT, "ft·lbf": POUND * FOOT,
               "lbf·in": POUND * INCH, "in-lb": POUND * INCH, "ozf·in": OUNCE * INCH, "oz-in": OUNCE * INCH,
               "in·oz": OUNCE * INCH},
    "rotor": {"RPM": np.pi / 30, "rpm": np.pi / 30, "rad/s": 1, "rad/sec": 1, "rad·s⁻¹": 1, "Hz": 2 * np.pi,
              "rev/s": 2 * np.pi, "rps": 2 * np.pi, "1/s": 2 * np.pi, "rev/min": np.pi / 30, "1/min": np.pi / 30,
              "U/min": np.pi / 30},
    "voltage": {"V": 1, "volts": 1, "mV": 1e-3, "cV": 1e-2, "dV": 0.1},
    "current": {"A": 1, "amps": 1, "mA": 1e-3, "cA": 1e-2},
    "time": {"s": 1, "sec": 1, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "Âµs": 1e-6, "ns": 1e-9},
    "rate": {"rad/s": 1, "deg/s": np.pi / 180, "°/s": np.pi / 180, "dps": np.pi / 180, "deg/sec": np.pi / 180,
             "mrad/s": 1e-3},
    "angle": {"rad": 1, "deg": np.pi / 180, "°": np.pi / 180, "degrees": np.pi / 180, "mrad": 1e-3,
              "cdeg": np.pi / 18000},
    "acceleration": {"m/s²": 1, "m/s^2": 1, "m/s2": 1, "m s⁻²": 1, "m/s/s": 1, "g": 9.80665, "G": 9.80665,
                     "mg": 9.80665e-3},
    "velocity": {"m/s": 1, "cm/s": 1e-2, "mm/s": 1e-3},
    "length": {"m": 1, "cm": 1e-2, "mm": 1e-3, "ft": FOOT},
    "share": {"%": 0.01, "percent": 0.01},
}  # fmt: skip
CASES = [(kind, text, factor) for kind, texts in WRITTEN.items() for text, factor in texts.items()]


@pytest.mark.parametrize(("kind", "text", "factor"), CASES)
def test_every_unit_however_it_is_written(kind: str, text: str, factor: float) -> None:
    unit = unit_of(text, kind)
    assert unit and float(converted(np.array(1.0), kind, unit)) == pytest.approx(factor, rel=1e-9)
    assert stated(f"Some Quantity ({text})", kind) == stated(f"quantity [{text}]", kind) == unit


@pytest.mark.parametrize(
    ("text", "read", "celsius"),
    [("°C", 25, 25), ("C", 25, 25), ("degC", 25, 25), ("°F", 77, 25), ("F", 32, 0), ("K", 298.15, 25),
     ("kelvin", 0, -273.15)],
)  # fmt: skip
def test_temperatures_have_their_zeros(text: str, read: float, celsius: float) -> None:
    unit = unit_of(text, "temperature")
    assert float(converted(np.array(float(read)), "temperature", unit)) == pytest.approx(celsius)


def test_every_unit_has_its_own_spelling() -> None:
    assert {kind: set(units) for kind, units in UNITS.items()} == {k: set(u) for k, u in SPELLINGS.items()}
    for kind, units in UNITS.items():
        assert [unit_of(unit, kind) for unit in units] == list(units)


@pytest.mark.parametrize(
    ("name", "kind", "unit"),
    [
        ("battery_current_mA", "current", "mA"), ("battery_cV", "voltage", "cV"), ("vbat_mv", "voltage", "mV"),
        ("temperature_K", "temperature", "K"), ("temp_degF", "temperature", "degF"),
        ("temperature_c", "temperature", "degC"), ("voltage", "voltage", ""), ("battery_volts", "voltage", "V"),
        ("v", "voltage", ""), ("voltageV", "voltage", "V"),
        ("height_cm", "length", "cm"), ("rotor speed rad/s", "rotor", "rad/s"), ("omega_rad_s", "rate", "rad/s"),
        ("motor[0]", "rotor", ""), ("force (?)", "force", ""), ("current [bananas]", "current", ""),
    ],
)  # fmt: skip
def test_units_in_the_names_of_columns(name: str, kind: str, unit: str) -> None:
    assert stated(name, kind) == unit


@pytest.mark.parametrize(
    ("heading", "parts"),
    [
        ("Thrust (kgf)", ("Thrust", "kgf")), ("Thrust[N]", ("Thrust", "N")), (" Voltage  ( V ) ", ("Voltage", "V")),
        ("motor[0]", ("motor[0]", "")), ("gyroADC[0] (deg/s)", ("gyroADC[0]", "deg/s")), ("Time", ("Time", "")),
        ("Thrust ()", ("Thrust", "")), ("Torque (N·m)", ("Torque", "N·m")),
    ],
)  # fmt: skip
def test_a_heading_and_its_unit(heading: str, parts: tuple[str, str]) -> None:
    assert bracketed(heading) == parts


# RCbenchmark --------------------------------------------------------------------------------------

STEPS = np.arange(0, 22, 0.1)
SHARE = np.minimum(np.floor(STEPS / 2) / 10, 1.0)
TRUE = {"Time": STEPS, "ESC signal": 1000 + 1000 * SHARE, "Thrust": 5.8 * SHARE**1.6, "Torque": 0.1 * SHARE**1.6,
        "Voltage": 16.0 - 0.6 * SHARE, "Current": 25 * SHARE**2,
        "Motor Electrical Speed": 2000 * SHARE**0.8}  # fmt: skip
USUAL = {"Time": "s", "ESC signal": "µs", "Thrust": "N", "Torque": "N·m", "Voltage": "V", "Current": "A",
         "Motor Electrical Speed": "rad/s"}  # fmt: skip
COLUMNS = {"Time": c.TIME, "Thrust": "force_z_n", "Torque": "moment_z_n_m", "Voltage": c.BATTERY_VOLTAGE,
           "Current": c.BATTERY_CURRENT, "Motor Electrical Speed": "rotor_speed_1_rad_s"}  # fmt: skip
KINDS = {title: kind for title, (_, kind, _) in HEADINGS.items()}


def stand_file(folder: Path, spin: str) -> Path:
    """The vehicle file of a stand whose one rotor turns so."""
    (folder / "stand.yaml").write_text(
        "name: stand\nkind: stand\nmass_kg: 0.05\ninertia_kg_m2: {xx: 1.0e-5, yy: 1.0e-5, zz: 1.0e-5}\n"
        f"rotors:\n  - {{x_m: 0.0, y_m: 0.0, spin: {spin}}}\nthrust_coefficient_n_s2: 1.45e-6\n"
        "torque_coefficient_n_m_s2: 2.5e-8\ntared: true\n"
    )
    return folder / "stand.yaml"


def export(path: Path, more=(), drop=(), **units: str | None) -> Path:
    """An export in which the quantities are in these units (None: the heading names none)."""
    table = {}
    for title, values in TRUE.items():
        if title in drop:
            continue
        unit = units.get(title, USUAL[title])
        factor = WRITTEN.get(KINDS[title], {}).get(unit, 1.0) if title != "ESC signal" else 1.0
        table[f"{title} ({unit})" if unit is not None else title] = values / factor
    pd.DataFrame(table | dict(more)).to_csv(path, index=False, float_format="%.12g")
    return path


STATED = [(title, text, factor) for title in COLUMNS for text, factor in WRITTEN[KINDS[title]].items()]


@pytest.mark.parametrize(("title", "text", "factor"), STATED)
def test_an_export_in_any_unit_that_its_heading_names(tmp_path: Path, title: str, text: str, factor: float) -> None:
    table, _ = read_rcbenchmark(export(tmp_path / "a.csv", **{title: text}))
    expected = TRUE[title] * (-1 if title == "Thrust" else 1)
    np.testing.assert_allclose(table[COLUMNS[title]], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("title", "usual"), [("Thrust", 9.80665e-3), ("Motor Electrical Speed", np.pi / 30)])
def test_a_heading_without_a_unit_is_said_to_be_assumed(tmp_path: Path, title: str, usual: float) -> None:
    table, faults = read_rcbenchmark(export(tmp_path / "a.csv", **{title: None}))
    assert abs(table[COLUMNS[title]]).max() == pytest.approx(TRUE[title].max() * usual)
    assert f"the heading {title!r} names no unit" in " ".join(f.sentence for f in faults)


@pytest.mark.parametrize("title", [t for t in COLUMNS if t != "Time"])
def test_an_unknown_unit_is_refused_by_name(tmp_path: Path, title: str) -> None:
    path = export(tmp_path / "a.csv", **{title: "stone"})
    refused(rf"column {title} \(stone\): no known unit", read_rcbenchmark, path)


def test_a_1580_has_torque_and_columns_that_begin_alike(tmp_path: Path) -> None:
    """Load cells' own voltages and a cutoff begin with the words of a measurement."""
    more = {"Thrust Load Cell (mV)": STEPS, "Current Cutoff (A)": 40 + 0 * STEPS, "Torque Load Cell (mV)": STEPS}
    table, _ = read_rcbenchmark(export(tmp_path / "a.csv", more))
    np.testing.assert_allclose(table["force_z_n"], -TRUE["Thrust"])
    np.testing.assert_allclose(table[c.BATTERY_CURRENT], TRUE["Current"], atol=1e-9)
    np.testing.assert_allclose(table["moment_z_n_m"], TRUE["Torque"])


@pytest.mark.parametrize("counted", [1, -1])
@pytest.mark.parametrize(("spin", "sign"), [("ccw", 1), ("cw", -1)])
def test_the_torque_has_the_sign_of_the_stated_spin(tmp_path: Path, counted: int, spin: str, sign: int) -> None:
    table = pd.read_csv(export(tmp_path / "a.csv"))
    table["Torque (N·m)"] *= counted
    table.to_csv(tmp_path / "a.csv", index=False)
    found = set_of_logs([tmp_path / "a.csv"], "stand", vehicle_file=stand_file(tmp_path, spin))
    np.testing.assert_allclose(found.runs["a"]["moment_z_n_m"], sign * TRUE["Torque"], atol=1e-12)
    assert any(spin in sentence and "torque" in sentence for sentence in found.sentences)


def test_an_optical_speed_alone_is_taken(tmp_path: Path) -> None:
    speed = TRUE["Motor Electrical Speed"]
    path = export(tmp_path / "a.csv", {"Motor Optical Speed (Hz)": speed / 2 / np.pi}, drop=["Motor Electrical Speed"])
    np.testing.assert_allclose(read_rcbenchmark(path)[0]["rotor_speed_1_rad_s"], speed)


def test_an_export_cut_off_in_its_last_line_keeps_the_others(tmp_path: Path) -> None:
    path = export(tmp_path / "a.csv")
    path.write_text(path.read_text().rstrip()[:-12])
    table, faults = read_rcbenchmark(path)
    assert len(table) == len(STEPS) - 1 and "cut off" in " ".join(f.sentence for f in faults)


def test_a_command_in_per_cent(tmp_path: Path) -> None:
    table = pd.read_csv(export(tmp_path / "a.csv")).rename(columns={"ESC signal (µs)": "ESC signal (%)"})
    table["ESC signal (%)"] = 100 * SHARE
    table.to_csv(tmp_path / "a.csv", index=False)
    np.testing.assert_allclose(read_rcbenchmark(tmp_path / "a.csv")[0]["throttle_1"], SHARE)


# Other stands, by a mapping -----------------------------------------------------------------------


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(
    ("thrust", "torque", "speed", "current"),
    [
        ("Thrust (kgf)", "Torque (N·m)", "RPM", "Current (A)"),
        ("thrust_g", "torque_Nmm", "motor_speed_rad_s", "current_mA"),
        ("Thrust [lbf]", "Torque [lbf·in]", "Motor Speed [Hz]", "Current [A]"),
        ("Load cell (oz)", "torque_oz_in", "rpm", "Current (mA)"),
        ("Propeller Thrust, N", "Propeller Torque, N·cm", "Rotation speed (rev/min)", "current"),
    ],
)
def test_a_table_of_another_stand(
    thrust: str, torque: str, speed: str, current: str, separator: str, tmp_path: Path
) -> None:
    """Units stand in the headings; thrust is taken along -z, the torque by the spin of the stated rotor."""
    share = np.linspace(0, 1, 200)
    true = {"force_z_n": -8 * share**2, "moment_z_n_m": -0.1 * share**2, "rotor_speed_1_rad_s": 2000 * share}
    wrote = {"Time (s)": 0.1 * np.arange(200), "Throttle (%)": 100 * share}
    for name, kind, values in (
        (thrust, "force", -true["force_z_n"]),
        (torque, "torque", -true["moment_z_n_m"]),
        (speed, "turns", true["rotor_speed_1_rad_s"]),
        (current, "current", 20 * share),
    ):
        wrote[name] = values / UNITS[kind][stated(name, kind) or {"current": "A", "rpm": "rpm"}[name.lower()]]
    path = tmp_path / "stand.csv"
    pd.DataFrame(wrote).to_csv(path, index=False, sep=separator)
    found = guess(read_columns(path))
    assert not found.open, (found.open, found.evidence)
    refused("needs --vehicle", set_of_logs, [path], "stand", mapping=found.mapping)
    vehicle = stand_file(tmp_path, "cw")
    run = set_of_logs([path], "stand", vehicle_file=vehicle, mapping=found.mapping).runs["stand"]
    for name, values in true.items():
        np.testing.assert_allclose(run[name], values, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(run[c.BATTERY_CURRENT], 20 * share, atol=1e-9)
    np.testing.assert_allclose(run["throttle_1"], share, atol=1e-9)


def test_a_stand_whose_heading_names_no_unit_is_asked() -> None:
    table = {"t_s": 0.1 * np.arange(100), "thrust": np.linspace(0, 9, 100), "rpm": np.linspace(0, 9e3, 100)}
    assert set(guess(pd.DataFrame(table)).open) == {"thrust"}


def test_a_flight_with_a_column_called_thrust_is_no_stand() -> None:
    table = pd.DataFrame({"t_s": 0.01 * np.arange(300), "thrust": 0.5} | {f"acc_{a}": 9.8 * (a == "z") for a in "xyz"})
    assert "thrust" not in guess(table).mapping.channels


STEADY = np.repeat(np.linspace(0, 1, 20), 3)
"""Shares of the largest speed of a stand that is read once in half a second."""


@pytest.mark.parametrize(
    ("name", "factor", "unit"), [("Time (s)", 1, "s"), ("t_s", 1, "s"), ("t_ms", 1e3, "ms"), ("t", 1, "?")]
)
@pytest.mark.parametrize(
    ("speed", "turns", "unit_of_speed"),
    [("Rotation speed (krpm)", 19.1, "krpm"), ("erpm", 133700.0, "erpm"), ("omega (rad/s)", 2000.0, "rad/s")],
)
def test_steady_points_of_a_stand(name: str, factor: float, unit: str, speed: str, turns: float, unit_of_speed) -> None:
    """2 Hz are no 2 kHz; what the program of another stand calls an ESC signal is no export of RCbenchmark's."""
    table = {name: 0.5 * factor * np.arange(60), "ESC signal (%)": 100 * STEADY}
    table |= {"Thrust (N)": 8 * STEADY**2, speed: turns * STEADY}
    found = guess(pd.DataFrame(table)).mapping.channels
    assert found["time"].unit == unit and found["rotor_speed"].unit == unit_of_speed
    assert found["throttle"].range == (0.0, 100.0)


@pytest.mark.parametrize(
    "heading", ["ESC signal A (µs),Thrust A (N),Motor Electrical Speed A (RPM)", "ESC signal,Thrust"]
)
def test_an_export_of_another_stand_is_a_table(tmp_path: Path, heading: str) -> None:
    (tmp_path / "a.csv").write_text(f"Time (s),{heading}\n0,1,2,3\n")
    assert importer_of(tmp_path / "a.csv").name == "table"
    assert importer_of(export(tmp_path / "b.csv")).name == "rcbenchmark"


@pytest.mark.parametrize(("sign", "body"), [(1, "flu"), (-1, "frd")])
@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("F{}", "M{}"), ("?", "?")),
        (("F{} [N]", "T{} [N.m]"), ("N", "N.m")),
        (("f_{}_lbf", "tau_{}_mNm"), ("lbf", "mN.m")),
    ],
)
def test_a_load_cell_of_six_axes(sign: int, body: str, names, units) -> None:
    """The rotor pulls along -z of forward-right-down."""
    table = {"t_s": 0.5 * np.arange(60), "rpm": 19100 * STEADY}
    table |= {names[0].format(a): sign * 8 * STEADY**2 * (a == "z") for a in "xyz"}
    table |= {names[1].format(a): 0.1 * STEADY**2 * (a == "z") for a in "xyz"}
    found = guess(pd.DataFrame(table)).mapping
    assert (found.channels["force"].unit, found.channels["moment"].unit) == units and found.body == body
    assert "specific_force" not in found.channels and "rotor_speed" in found.channels


@pytest.mark.parametrize("turns", ["°/s", "º/s", "deg/s"])
@pytest.mark.parametrize("pushes", ["m/s²", "m/s2"])
def test_signs_of_units_in_names(turns: str, pushes: str) -> None:
    names = [f"gyro_{a} ({turns})" for a in "xyz"] + [f"acc_{a} [{pushes}]" for a in "xyz"]
    found = {family.stem: family.unit for family in families(names, "xyz")}
    assert found == {"gyro": "deg/s", "acc": "m/s2"}
