"""The newcomer's way: an emulator in one process, a recorder in another, a log that the pipeline reads."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from rotorid_acquire import procedures
from rotorid_acquire.cli import app, stable_name, udev_rule, who_is_there
from rotorid_acquire.emulators.truth import GF_N, body_forces, cell_forces
from rotorid_acquire.io.logs import read_log, read_tables
from rotorid_acquire.io.session import read_index
from rotorid_acquire.view import Plot, bench_forces, braille, panel, watch
from rotorid_lab import clocks
from rotorid_lab.stand import read_pairs
from tests.acquire.conftest import ACQUIRE
from tests.acquire.fault_table import seen
from tests.command_line import answer, invoke


@pytest.fixture
def emulator(tmp_path):
    """Start `emulate` with some arguments; its ports are there when it returns."""
    processes = []

    def start(what: str, *names: str, more: tuple[str, ...] = ()) -> list[str]:
        links = [str(tmp_path / name) for name in names]
        options = [word for link in links for word in ("--link", link)]
        process = subprocess.Popen([*ACQUIRE, "emulate", what, *options, *more], stdout=subprocess.PIPE, text=True)
        processes.append(process)
        for _ in links:
            assert "Ctrl-C ends it" in process.stdout.readline()
        return links

    yield start
    for process in processes:
        process.terminate()
        process.wait()
        process.stdout.close()


def run(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([*ACQUIRE, *arguments], capture_output=True, text=True, timeout=60)


def recorded(arguments: str, folder: Path, name: str) -> str:
    """Record by the command line into a folder; what it said."""
    done = run(*arguments.split(), "--out", str(folder), "--id", name)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_static_test_in_two_terminals(emulator, tmp_path):
    (port,) = emulator("bench", "ttyBENCH", more=("--load", "z:500.48@3", "--speed", "20"))
    out = tmp_path / "raw" / "campaign" / "local"
    words = f"bench --port {port} --test static --axis z --load-gf 500.48 --place-s 4 --air 23,95400,0.5 --operator me"
    said = recorded(words, out, "mine")
    assert "mine.rlog: " in said and "0 missing" in said
    log = read_log(out / "mine.rlog")
    table, marks = log.table.set_index("index"), log.session.marks
    cells = list(log.instrument.columns)
    tare, reading = (
        table.loc[marks[f"{step}_start"] : marks[f"{step}_stop"], cells].mean() for step in ("tare", "read")
    )
    force = body_forces(cell_forces((reading - tare).to_numpy()))
    assert -force[2] / GF_N == pytest.approx(500.48, rel=0.01)
    assert log.session.setup.operator == "me" and log.session.setup.air.temperature_c == 23
    checked = run("check", str(out / "mine.rlog"), "--csv", str(tmp_path / "mine.csv"))
    assert "missing 0 in 0 gaps" in checked.stdout and (tmp_path / "mine.csv").exists()
    assert "1 recordings" in run("index", str(tmp_path / "raw")).stdout
    assert read_index(tmp_path / "raw")[0]["id"] == "mine"


def test_experiment_with_two_instruments_and_two_clocks(emulator, tmp_path):
    ports = emulator("stand", "ttyQUAD", "ttyWRENCH", more=("--experiment", "27", "--speed", "20"))
    recorded(f"experiment 27 --quadrotor-port {ports[0]} --wrench-port {ports[1]}", tmp_path, "e27")
    vehicle, sensor = read_log(tmp_path / "e27-quadrotor.rlog"), read_log(tmp_path / "e27-wrench.rlog")
    assert vehicle.session.group == sensor.session.group == "e27"
    assert vehicle.session.setup.mount_roll_deg == 15
    assert vehicle.end is not None and vehicle.table.throttle_1.max() == pytest.approx(0.2)
    assert sensor.table.force_y_n.max() > 1.0  # thrust of about 5.7 N at 15°
    assert sensor.table.force_z_n.iloc[:50].mean() == pytest.approx(6.4, abs=0.1)
    # the two hosts' times are one clock, so that the sensor saw the programme begin and end
    begin = sensor.session.host_start_ns - vehicle.session.host_start_ns
    assert abs(begin) < 5e9


def test_an_experiment_at_five_times_the_speed_of_life_is_ingested_and_aligned(emulator, tmp_path):
    ports = emulator("stand", "ttyQUAD", "ttyWRENCH", more=("--experiment", "27", "--speed", "5"))
    recorded(f"experiment 27 --quadrotor-port {ports[0]} --wrench-port {ports[1]}", tmp_path, "e27")
    tables = {name: read_tables([tmp_path / f"e27-{name}.rlog"]) for name in ("quadrotor", "wrench")}
    assert all(sessions["finished"].all() for _, sessions in tables.values())
    (pair,) = read_pairs(tables["quadrotor"], tables["wrench"], 2e-4)
    (entry,) = clocks.align([pair], lambda throttle: 30 * throttle**1.4)
    assert abs(entry.lift.delay_s) < clocks.LARGEST_S and entry.lift.gain > 10 * entry.lift.delay_error_s
    # In device time the programme lasts as long on both clocks.
    throttle = pair.quadrotor.set_index("host_s")["throttle_1"]
    lift = -pair.wrench.set_index("host_s")["force_z_n"]
    lift -= lift.iloc[:50].mean()
    on = throttle[throttle > 0.1].index
    felt = lift[lift.rolling(25, center=True).mean() > lift.max() / 3].index
    assert felt[-1] - felt[0] == pytest.approx(on[-1] - on[0], rel=0.15)


def test_rotor_and_tensile(emulator, tmp_path):
    (port,) = emulator("rotor", "ttyROTOR", more=("--speed", "20"))
    recorded(f"rotor --port {port} --throttle 0.3 --rotor spare", tmp_path, "r")
    assert "rotor: spare" in (tmp_path / "r.yaml").read_text()
    table = read_log(tmp_path / "r.rlog").table
    assert table.throttle.max() == pytest.approx(0.3) and table.throttle.iloc[-1] == 0
    assert table.thrust_n.max() > 1.5
    (port,) = emulator("tensile", "ttyTENSILE", more=("--speed", "40", "--infill-percent", "25"))
    recorded(f"tensile --port {port} --infill-percent 25", tmp_path, "t")
    assert read_log(tmp_path / "t.rlog").table.force_n.max() == pytest.approx(36.811 * 19.2, rel=0.02)


def test_wrench_operations(emulator, tmp_path):
    (port,) = emulator("wrench", "ttyWRENCH", more=("--speed", "20"))
    for step in ("power-on", "offset"):
        recorded(f"wrench --port {port} --only {step}", tmp_path, step)
    words = f"wrench --port {port} --interval 0.02 --measuring-times 40 --restart-times 1 --offset"
    recorded(words, tmp_path, "w")
    log = read_log(tmp_path / "w.rlog")
    assert len(log.table) == 80 and log.end.sent == 80  # one run and one restart of forty
    assert abs(log.table.force_z_n.mean()) < 0.1  # the weight is offset away
    recorded(f"wrench --port {port} --only power-off", tmp_path, "off")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["bench", "--port", "/dev/nothing"], "no such port"),
        (["rotor", "--port", "x", "--throttle", "2"], "less than or equal to 1"),
        (["bench", "--port", "x", "--air", "warm"], "--air is temperature"),
        (["bench", "--port", "x", "--plot", "cell_9_v"], "--plot is one of cell_1_v"),
        (["quadrotor", "--port", "x", "--maxima", "1,2,3"], "four fractions"),
        (["emulate", "toaster", "--link", "x"], "there is no emulator 'toaster'"),
        (["emulate", "bench", "--link", "x", "--load", "heavy"], "AXIS:GF@SECONDS"),
        (["check", "nothing.rlog"], "nothing.rlog"),
        (["experiment", "49", "--quadrotor-port", "x", "--wrench-port", "y"], "less than or equal to 48"),
    ],
)
def test_mistakes_get_one_clear_sentence(arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke(*arguments, app=app)
    assert result.exit_code in (1, 2)
    text = " ".join(result.output.replace("│", " ").split())
    assert sentence in text and "Traceback" not in text


def test_ports_say_who_is_there(plugged):
    bench, rotor = plugged("bench").names[0], plugged("rotor").names[0]
    result = answer("ports", "--port", bench, "--port", rotor, "--port", "/dev/nothing", app=app)
    assert "bench, firmware bench 1.2 (emulated), serial EMU-BENCH-1" in result
    assert "rotor, firmware rotor 1.2 (emulated)" in result and "no such port" in result


@seen("a device of no kind of ours on the port", "the message did not say what was heard")
def test_a_port_with_another_device_says_what_was_heard(tmp_path):
    master, slave = os.openpty()
    over = threading.Event()

    def speak() -> None:
        while not over.wait(0.02):
            os.write(master, b"T=23.5C\r\n")

    thread = threading.Thread(target=speak)
    thread.start()
    assert "T=23.5C" in who_is_there(os.ttyname(slave), wait_s=0.3)
    over.set()
    thread.join()
    os.close(master)
    os.close(slave)


def test_stable_names_and_a_udev_rule(tmp_path):
    (tmp_path / "usb-Arduino_UNO").symlink_to("/dev/null")
    assert stable_name("/dev/null", tmp_path) == str(tmp_path / "usb-Arduino_UNO")
    assert stable_name("/dev/zero", tmp_path) == "/dev/zero"
    rule = udev_rule("2341", "0043", "755333", "rotorid-bench")
    assert (
        'ATTRS{idVendor}=="2341"' in rule and 'ATTRS{serial}=="755333"' in rule and 'SYMLINK+="rotorid-bench"' in rule
    )


def test_ports_lists_or_says_what_to_do():
    result = answer("ports", app=app)
    assert result.strip()


def test_torque_test_with_tester_and_sensor(emulator, tmp_path):
    ports = emulator("torque", "ttyROTOR", "ttyWRENCH", more=("--speed", "20"))
    recorded(f"torque --throttle 0.4 --rotor-port {ports[0]} --wrench-port {ports[1]}", tmp_path, "q")
    tester, sensor = read_log(tmp_path / "q-rotor.rlog").table, read_log(tmp_path / "q-wrench.rlog").table
    speed = tester.speed_rpm.max() * np.pi / 30
    moment = sensor.moment_z_n_m
    # the throttle comes when the host gets to it, at twenty times the speed of life: look for it
    torque = moment[moment > 0.02].median() - moment.iloc[:50].mean()
    assert torque == pytest.approx(1.8558e-8 * speed**2, rel=0.05)


def test_reference_sensor_on_the_bench_command(emulator, tmp_path):
    (port,) = emulator("jr3", "ttyJR3", more=("--load", "z:957.5475@3", "--speed", "20"))
    recorded(f"bench --platform jr3 --port {port} --test static --place-s 4", tmp_path, "j")
    log = read_log(tmp_path / "j.rlog")
    table, marks = log.table.set_index("index"), log.session.marks
    read = table.force_z_n.loc[marks["read_start"] : marks["read_stop"]].mean() - log.session.tare["force_z_n"]
    assert read == pytest.approx(-957.5475 * GF_N, abs=0.3)


def test_forces_are_shown_once_the_bench_is_tared(loopback):
    world, recorder = loopback("bench")

    def prompt(text):
        world.physics.place_load("z", 500.0)
        return lambda: True

    assert bench_forces(recorder) is None
    with recorder:
        procedures.static_test(recorder, prompt)
    assert float(bench_forces(recorder).plain.split("z")[1]) == pytest.approx(-500 * GF_N, rel=0.005)


def test_live_view_in_a_terminal(plugged, recorder_on):
    recorder = recorder_on("bench", plugged("bench", speed=200.0).names[0])
    plot = Plot.of(recorder, "cell_1_v")
    console = Console(force_terminal=True, width=200, record=True, file=open("/dev/null", "w"))

    def work() -> None:
        with recorder:
            procedures.stream(recorder, 2000)

    watch([recorder], work, recorder.stop_asked, [plot], console)
    console.print(panel(recorder))
    text = console.export_text()
    assert "load-cell bench · finished" in text and "cell_6_v" in text and "remaining" in text
    assert len(read_log(recorder.log_path).table) >= 2000
    assert "cell_1_v" in plot.render().plain


def test_noise_of_a_curve_is_not_the_load_that_was_put_on():
    plot, noise = Plot("cell_1_v", 0), np.random.default_rng(1).normal(0, 2e-7, 600)
    for number, value in enumerate(noise):
        plot.see((value + 2.5e-5 * min(max(number - 300, 0) / 20, 1),))  # in 0.4 s
    assert float(plot.render().plain.split("noise")[1].split()[0]) == pytest.approx(2e-7, rel=0.3)


def test_braille_curve_by_hand():
    # two characters wide, one high: four columns of dots, four rows; a rising line
    (line,) = [braille([0.0, 1.0, 2.0, 3.0], width=2, height=1)[0].split()[0]]
    assert [ord(c) - 0x2800 for c in line] == [0x40 | 0x20, 0x02 | 0x08]
    assert braille([], 2, 1) == []


def test_starting_imports_nothing_that_only_analysis_needs() -> None:
    """A person at the bench waits for it at every command: numpy is a quarter of a second, pandas and scipy more."""
    heavy = "('numpy', 'pandas', 'scipy', 'matplotlib', 'numba')"
    code = f"import sys, rotorid_acquire.cli; print(*[m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
