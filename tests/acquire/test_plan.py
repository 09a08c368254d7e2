"""A campaign by its plan: order, checks, resuming after anything, one recording again, limits."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import yaml

from rotorid_acquire import procedures
from rotorid_acquire.cli import app
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.session import Ended, read_index
from rotorid_acquire.procedures import record
from rotorid_acquire.run_plan import (
    CampaignPlan,
    Desk,
    attempts,
    check,
    emulated_ports,
    is_done,
    read_plan,
    run,
    steps_of,
)
from rotorid_acquire.transport import AcquireError
from tests.acquire.fault_table import seen
from tests.command_line import invoke
from tests.refusals import refused

GROUP = {
    "name": "quiet-{load_gf}-r{repeat}", "do": "stream", "instrument": "bench",
    "over": {"load_gf": [0.0, 100.0, 200.0, 300.0, 400.0]}, "repeats": 4, "order": "random",
    "ask": "put {load_gf} gf on", "setup": {"axis": "z"}, "settings": {"samples": 10},
}  # fmt: skip


def plan_with(tmp_path: Path, steps: list[dict] | None = None, **more) -> CampaignPlan:
    text = {
        "name": "trial", "out": str(tmp_path / "out"), "ports": {"bench": "/dev/b", "rotor": "/dev/r"},
        "checks": {"samples": 10, "disk_mb": 1}, "steps": steps or [GROUP],
    } | more  # fmt: skip
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump(text))
    return read_plan(path)


def desk(told: list[str], answers: list[str] | None = None) -> Desk:
    def ask(text: str) -> str:
        told.append(text)
        return answers.pop(0) if answers else ""

    def place(step):
        return lambda recorder: lambda text: procedures.countdown(5)

    return Desk(told.append, ask, place, lambda recorders, work: work())


@pytest.fixture
def emulated(tmp_path):
    def ports_for(plan: CampaignPlan, speed: float = 100.0):
        folder = tmp_path / "links"
        folder.mkdir(exist_ok=True)

        @contextmanager
        def ports_of(step):
            with emulated_ports(plan, step, folder, speed, 0.1) as ports:
                yield ports

        return ports_of

    return ports_for


def test_the_order_is_random_and_the_same_each_time(tmp_path):
    plan = plan_with(tmp_path)
    names = [step.name for step in steps_of(plan)]
    assert names == [step.name for step in steps_of(plan)] and len(set(names)) == 20
    assert names != sorted(names)
    other = [step.name for step in steps_of(plan.model_copy(update={"seed": 9}))]
    assert sorted(other) == sorted(names) and other != names
    assert steps_of(plan)[0].setup("me").load_gf == steps_of(plan)[0].values["load_gf"]


def test_steps_one_by_one_one_skipped_one_again_and_the_index(tmp_path, emulated):
    plan = plan_with(tmp_path, [GROUP | {"over": {"load_gf": [0.0, 100.0, 200.0]}, "repeats": 1}])
    told: list[str] = []
    assert run(plan, emulated(plan), desk(told, ["", "s", "q"])) == 2
    assert run(plan, emulated(plan), desk(told), checked=True) == 0
    name = steps_of(plan)[0].name
    assert run(plan, emulated(plan), desk(told), repeat=name, checked=True) == 0
    assert attempts(plan, steps_of(plan)[0]) == [name, f"{name}.2"]
    assert len(read_index(plan.out)) == 4 + 1  # and the check before the first
    assert any("put 100.0 gf on" in text for text in told) and "2 left" in " ".join(told)


@seen(
    "a campaign of 20 steps killed twice",
    "two ballasts of 64 KiB stayed, and sessions.tsv said 0 samples of the two recordings that were broken off",
)
def test_a_campaign_of_twenty_steps_killed_twice(tmp_path):
    """By the command line; what was killed has left its log, and the next start goes on."""
    plan = plan_with(tmp_path, ports={"bench": "/dev/b"})
    command = [sys.executable, "-m", "rotorid_acquire", "campaign", str(tmp_path / "plan.yaml"), "--emulate"]
    command += ["--speed", "50", "--place-s", "0.2"]
    for killed_at in (5, 12):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while len(list(plan.out.glob("quiet*.rlog"))) < killed_at:
            assert process.poll() is None
            time.sleep(0.001)
        process.kill()
        process.wait()
        done = sum(is_done(plan, step) for step in steps_of(plan))
        assert killed_at - 2 <= done <= killed_at
    finished = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert finished.returncode == 0 and "20 of 20 recordings are there" in finished.stdout, finished.stderr
    shown = invoke("campaign", tmp_path / "plan.yaml", "--show", app=app).output.splitlines()
    assert len(shown) == 20 and all(line.startswith("done") for line in shown)
    rows = [row for row in read_index(plan.out) if row["id"].startswith("quiet")]
    whole = [row for row in rows if row["ended"] == "finished"]
    broken_off = [row for row in rows if row["ended"] == "recording"]
    assert len(whole) == 20 and len(broken_off) <= 2 and len(rows) == len(whole) + len(broken_off)
    for row in rows:  # nothing that came before a kill is lost: counts are those of the log
        log = read_log(plan.out / row["file"])
        assert int(row["samples"]) == len(log.table) and log.missing == 0
    assert not list(plan.out.rglob("*.ballast"))


def test_curves_of_a_campaign_in_a_terminal(tmp_path):
    """Two channels drawn while each step is recorded; a column of no instrument of the plan is a mistake."""
    plan_with(tmp_path, [GROUP | {"over": {"load_gf": [0.0, 100.0]}, "repeats": 1}], ports={"bench": "/dev/b"})
    words = ["campaign", str(tmp_path / "plan.yaml"), "--emulate", "--speed", "20", "--place-s", "0.2"]
    assert invoke(*words, "--plot", "throttle", app=app).exit_code == 2
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 160, 0, 0))
    command = [sys.executable, "-m", "rotorid_acquire", *words, "--plot", "cell_1_v", "--plot", "cell_4_v"]
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=os.environ | {"TERM": "xterm"})
    os.close(slave)
    shown = b""
    with suppress(OSError):  # the terminal ends with the program
        while part := os.read(master, 65536):
            shown += part
    os.close(master)
    text = shown.decode()
    assert process.wait() == 0 and "2 of 2 recordings are there" in text
    assert "step 1 of 2 (2 left)" in text and "step 2 of 2 (1 left)" in text
    for column in ("cell_1_v", "cell_4_v"):
        assert text.count(f"{column}   noise ") >= 2
    assert any(0x2800 < ord(sign) <= 0x28FF for sign in text)  # dots of a curve


@seen("a log of a campaign damaged after it was recorded")
def test_a_log_damaged_later_is_to_be_recorded_again(tmp_path, emulated):
    plan = plan_with(tmp_path, [GROUP | {"over": {"load_gf": [0.0]}, "repeats": 1}])
    run(plan, emulated(plan), desk([]), checked=True)
    step = steps_of(plan)[0]
    assert is_done(plan, step)
    log = plan.out / f"{step.name}.rlog"
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    log.write_bytes(data)
    assert not is_done(plan, step)
    assert run(plan, emulated(plan), desk([]), checked=True) == 0 and len(attempts(plan, step)) == 2


@seen("a reading beyond its limit", "there were no limits: the motor turned on")
def test_a_limit_stops_motor_and_campaign(tmp_path, emulated):
    thrust = {"name": "t-{throttle}", "do": "thrust", "over": {"throttle": [0.1, 0.5, 0.2]}}
    thrust |= {"settings": {"rest_s": 0.2, "hold_s": 2.0}}
    plan = plan_with(tmp_path, [thrust], limits={"speed_rpm": [0, 9000], "battery_current_a": [-1, 50]})
    with pytest.raises(AcquireError, match="speed_rpm is .*, allowed are 0 to 9000: stopped"):
        run(plan, emulated(plan, speed=20), desk([]), checked=True)
    log = read_log(plan.out / "t-0.5.rlog")
    assert log.session.ended == Ended.LIMIT_EXCEEDED and log.end is not None
    assert log.session.counts.samples == len(log.table)
    assert not (plan.out / "t-0.2.rlog").exists()  # the person has to look first


def test_checks_find_noise_a_missing_tare_a_wrong_instrument_and_no_disk(tmp_path, emulated):
    strict = {"samples": 10, "disk_mb": 1e12, "noise": {"cell_1_v": 1e-12}, "zero": {"cell_2_v": 1e-12}}
    plan = plan_with(tmp_path, checks=strict)
    with emulated(plan)(None) as ports:
        faults = " ".join(check(plan, {"bench": ports["bench"]}, desk([])))
        wrong = " ".join(check(plan, {"bench": ports["rotor"]}, desk([])))
    assert "cell_1_v: noise at rest" in faults and "cell_2_v: reads" in faults and "MB are free" in faults
    assert "is a 'rotor'" in wrong and "not a 'bench'" in wrong
    with pytest.raises(AcquireError, match="before the first recording: "):
        run(plan, emulated(plan), desk([]))
    assert not list(plan.out.glob("quiet*"))


def test_checks_find_a_port_that_is_not_there_and_a_clock_that_is_behind(tmp_path):
    plan = plan_with(tmp_path)
    plan.out.mkdir()
    (plan.out / "old.yaml").write_text("started: '2999-01-01T00:00:00+00:00'\n")
    faults = " ".join(check(plan, {"bench": str(tmp_path / "nothing")}, desk([])))
    assert "no such port" in faults and "clock is behind" in faults


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"steps": [GROUP | {"do": "stir"}]}, "plan.yaml: steps.0.do: found 'stir', expected 'stream', 'calibrate'"),
        ({"steps": [GROUP | {"repeat": 3}]}, "plan.yaml: steps.0.repeat: no such key is known; did you mean repeats?"),
        ({"steps": [GROUP | {"name": "a"}]}, "two steps are called 'a'"),
        ({"steps": [GROUP | {"name": "{weight}"}]}, "uses 'weight', which is not in `over`"),
        ({"steps": [GROUP | {"name": "../{load_gf}-{repeat}"}]}, "cannot be called"),
        ({"steps": [{"name": "x", "do": "experiment"}]}, "experiment needs a quadrotor, and `ports` has none"),
        ({"ports": {"bensch": "x"}}, "there is no instrument 'bensch'"),
        ({"limits": {"speed": [0, 1]}}, "'speed' is none"),
        ({"steps": [GROUP | {"settings": {"sample": 5}}]}, "stream has no such setting; did you mean samples?"),
        ({"steps": [GROUP | {"setup": {"platfrm": "al"}}]}, "platfrm: no such key is known; did you mean platform?"),
        ({"steps": [GROUP | {"setup": {"cell": True}}]}, "setup.cell: found true, expected a whole number"),
        ({"steps": [GROUP | {"over": {"load_gf": [1], "waight": [2, 3]}}]}, "over.waight: nothing reads it"),
    ],
)
def test_mistakes_in_a_plan_get_one_sentence(tmp_path, change, sentence):
    assert sentence in refused(None, lambda: steps_of(plan_with(tmp_path, **change)))


def test_recording_from_python(plugged, tmp_path):
    port = plugged("bench").names[0]
    (session,) = record({"bench": port}, lambda bench: procedures.stream(bench, 30), tmp_path, "first")
    assert session.ended == Ended.FINISHED and len(read_log(tmp_path / "first.rlog").table) >= 30
