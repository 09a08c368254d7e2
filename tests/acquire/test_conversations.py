"""What is said to each instrument, command by command, and that a log can be played back."""

import numpy as np
import pytest

from rotorid_acquire import procedures
from rotorid_acquire.io.frames import COMMAND, decode
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.rawlog import RECEIVED, SENT, read_raw
from rotorid_acquire.io.wire import INSTRUMENTS, TRAPEZOID, Programme, pack_initialise, pack_throttle
from rotorid_acquire.recorder import Recorder, Timings
from rotorid_acquire.transport import PortLost, SystemClock
from tests.acquire.conftest import recorded


def said(path) -> list[str]:
    """Letter and arguments (hex) of the commands in a log; of those that keep the watchdog quiet only the first."""
    frames = [decode(chunk.data[:-1]) for chunk in read_raw(path).chunks if chunk.tag == SENT]
    assert all(frame.kind == COMMAND for frame in frames)
    words = [f"{chr(frame.payload[0])} {frame.payload[1:].hex()}".strip() for frame in frames]
    return [word for number, word in enumerate(words) if word[0] != "K" or word not in words[:number]]


def test_wrench(loopback):
    options = {"restart_times": 2, "measuring_times": 30, "offset": True}
    log = recorded(procedures.measure_wrench, loopback("wrench")[1], 0.02, **options)
    # 20,000 µs = 0x4e20; 2; 30; all little-endian
    assert said(log.path) == ["?", "P 01", "I 204e000002001e000000", "O", "G 204e0000", "X", "P 00"]
    assert len(log.table) == 90  # thirty samples and two restarts


def test_bench(loopback):
    log = recorded(procedures.stream, loopback("bench")[1], 10, 0.001)
    assert said(log.path) == ["?", "G e8030000", "X"]


@pytest.mark.parametrize("burst_s", [0.02, 6.0])
def test_a_weight_has_its_time_on_a_host_that_receives_in_bursts(loopback, burst_s):
    _, recorder = loopback("bench", timings=Timings(poll_s=burst_s))
    marks = recorded(procedures.static_test, recorder, lambda text: procedures.countdown(200)).session.marks
    assert marks["load"] - marks["tare_stop"] == 200


def test_rotor(loopback):
    log = recorded(procedures.thrust_test, loopback("rotor")[1], 0.25, 0.5, 2.0)
    # throttle 0.25 = 2500 = 0x09c4, held by the tester itself for 2.5 s = 2500 ms at most
    assert said(log.path) == ["?", "K d007", "G 00000000", "T c409c409", "T 00000000", "X"]


def test_quadrotor(loopback):
    programme = Programme(TRAPEZOID, (0.2, 0.05, 0.05, 0.2), 1.0, 2.0, 0.0)
    log = recorded(procedures.fly_programme, loopback("quadrotor")[1], "r", programme)
    # the watchdog's two seconds; trapezoid; 2000, 500, 500, 2000; 1000 ms, 2000 ms, 0 mHz
    assert said(log.path) == ["?", "K d007", "r 00" + "d007" + "f401" + "f401" + "d007" + "e803" + "d007" + "0000"]
    assert log.end is not None and log.table.throttle_2.max() == pytest.approx(0.05)


def test_experiment_says_the_programme_while_the_sensor_measures(loopback):
    _, vehicle, sensor = loopback("stand")
    with vehicle, sensor:
        procedures.experiment(vehicle, sensor, "h", Programme(TRAPEZOID, (0.2,) * 4, 1.0, 2.0, 0.0), rest_s=1.0)
    assert [word[0] for word in said(sensor.log_path)] == ["?", "P", "I", "G", "X", "P"]
    flight, wrench = read_log(vehicle.log_path), read_log(sensor.log_path)
    # rest, 4 s and half a second of programme, rest; the sensor reads 6.396 N less the thrust at the maximum
    assert wrench.table.time_s.iloc[-1] == pytest.approx(1 + 4.5 + 1, abs=0.5)
    assert flight.table.time_s.iloc[-1] == pytest.approx(4.5, abs=0.05)
    speed = 1829.2 * 0.4**0.669
    assert wrench.table.force_z_n.min() == pytest.approx(6.396 - 4 * 1.3877e-6 * speed**2, abs=0.1)


@pytest.mark.parametrize("bad", [(1.5, 1.0), (-0.1, 1.0), (0.5, 70.0)])
def test_throttles_that_are_none(bad):
    with pytest.raises(ValueError, match="throttle"):
        pack_throttle(*bad)


def test_intervals_that_are_none():
    with pytest.raises(ValueError, match="between 0 and 60 s"):
        pack_initialise(0.0, 0, 0)


class _Replay:
    """What a log received, once more, chunk by chunk; commands go nowhere."""

    baud_rate = None

    def __init__(self, log):
        self.name = str(log)
        self._chunks = [chunk.data for chunk in read_raw(log).chunks if chunk.tag == RECEIVED]

    def open(self):
        pass

    def read(self, timeout_s):
        if not self._chunks:
            raise PortLost(f"{self.name}: the log is at its end")
        return self._chunks.pop(0)

    def write(self, data):
        pass

    def close(self):
        pass


def test_a_log_played_back_gives_the_same_table(loopback, tmp_path):
    log = recorded(procedures.stream, loopback("bench")[1], 100)
    bench, replay = INSTRUMENTS["bench"], _Replay(log.path)
    again = Recorder(bench, replay, SystemClock(), tmp_path / "again", "again", durable=False)
    first, second = log.table, recorded(procedures.stream, again, 100).table
    channels = [column for column in first if column != "host_time_s"]
    np.testing.assert_array_equal(first[channels], second[channels])
