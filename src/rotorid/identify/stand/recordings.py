"""The stand's tests as recording sets of kind `stand`.

Two instruments with their own clocks are put on one (`rotorid.identify.stand.clocks`); a run's samples are the wrench
sensor's, with throttle, speed and voltage interpolated to them. Before and after a programme the vehicle sends nothing:
its motors stand.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from rotorid.identify.stand.clocks import Aligned, Pair, both_on_host, pair_of, torque_offset
from rotorid.identify.stand.wrench import WRENCH
from rotorid.io.experiments import EXPERIMENTS
from rotorid.io.sequence import Quality
from rotorid.io.tables import by_recording
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Vehicle

_RPM = 2 * np.pi / 60
_THROTTLES = c.rotor_columns("throttle", 4)


def _felt(wrench: pd.DataFrame, offset_s: float) -> tuple[np.ndarray, pd.DataFrame]:
    """Times of the sensor's samples, s, its offset taken off, and their wrench; a saturated channel's are empty."""
    out = wrench[list(WRENCH)].astype(float).reset_index(drop=True)
    out.loc[(wrench["quality"].to_numpy() & int(Quality.SATURATED)) != 0] = np.nan
    return wrench["host_s"].to_numpy() - offset_s, out


def _within(when: np.ndarray, times: np.ndarray, values: np.ndarray, outside: float) -> np.ndarray:
    """Values interpolated to `when`, and `outside` where nothing was sent."""
    return np.interp(when, times, values, left=outside, right=outside)


def _experiment_run(session, aligned: Aligned) -> Run:
    """One of the 48 experiments: throttles, battery voltage, attitude of the mount, wrench."""
    quadrotor = aligned.pair.quadrotor
    when, felt = _felt(aligned.pair.wrench, aligned.offset_s)
    sent = quadrotor["host_s"].to_numpy()
    table = pd.DataFrame({c.TIME: when - when[0]})
    for column in _THROTTLES:
        table[column] = _within(when, sent, quadrotor[column].to_numpy(), 0.0)
    table[c.BATTERY_VOLTAGE] = _within(when, sent, quadrotor["battery_voltage_v"].to_numpy(), np.nan)
    table["roll_rad"] = np.radians(session.mount_roll_deg)
    table["pitch_rad"] = np.radians(session.mount_pitch_deg)
    table[list(WRENCH)] = felt
    return Run(aligned.pair.name, table)


def _torque_run(name: str, rotor: pd.DataFrame, wrench: pd.DataFrame, offset_s: float) -> Run:
    """One torque test: motor 1 alone turns, driven and counted by the thrust tester; both tables have `host_s`."""
    when, felt = _felt(wrench, offset_s)
    sent = rotor["host_s"].to_numpy()
    table = pd.DataFrame({c.TIME: when - when[0]})
    table["throttle_1"] = _within(when, sent, rotor["throttle"].to_numpy(), 0.0)
    table["rotor_speed_1_rad_s"] = _within(when, sent, rotor["speed_rpm"].to_numpy() * _RPM, 0.0)
    for i in (2, 3, 4):
        table[f"throttle_{i}"] = 0.0
        table[f"rotor_speed_{i}_rad_s"] = 0.0
    table[c.BATTERY_VOLTAGE] = _within(when, sent, rotor["battery_voltage_v"].to_numpy(), np.nan)
    table[c.BATTERY_CURRENT] = _within(when, sent, rotor["battery_current_a"].to_numpy(), np.nan)
    table["roll_rad"] = table["pitch_rad"] = 0.0
    table[list(WRENCH)] = felt
    return Run(name, table)


def _thrust_run(name: str, rotor: pd.DataFrame) -> Run:
    """One thrust test: a single rotor on the tester; its thrust pulls along −z."""
    table = pd.DataFrame(
        {
            c.TIME: rotor["time_s"].to_numpy(),
            "throttle_1": rotor["throttle"].to_numpy(float),
            "rotor_speed_1_rad_s": rotor["speed_rpm"].to_numpy() * _RPM,
            "force_z_n": -rotor["thrust_n"].to_numpy(),
            c.BATTERY_VOLTAGE: rotor["battery_voltage_v"].to_numpy(),
            c.BATTERY_CURRENT: rotor["battery_current_a"].to_numpy(),
        }
    )
    return Run(name, table)


def _stand_vehicle(name: str, believed: Vehicle, session, noise: dict[str, float]) -> Vehicle:
    """The believed vehicle as it stands on the sensor, from its flight file and the recording's metadata."""
    content = believed.model_dump(exclude_defaults=True)
    content.update(name=name, kind="stand", tared=bool(session.tared), sensor_mount="level", noise=noise)
    content["sensor_position_m"] = [session.sensor_x_m, session.sensor_y_m, session.sensor_z_m]
    return Vehicle.model_validate(content)


def _tester_vehicle(name: str, believed: Vehicle, noise: dict[str, float]) -> Vehicle:
    """Motor 1 alone on the thrust tester, which claims to read zero at rest."""
    content = {
        "name": name,
        "kind": "stand",
        "rotors": [{"x_m": 0.0, "y_m": 0.0, "spin": believed.rotors[0].spin}],
        "thrust_coefficient_n_s2": float(believed.thrust_coefficients_n_s2()[0]),
        "torque_coefficient_n_m_s2": float(believed.torque_coefficients_n_m_s2()[0]),
        "rotor_radius_m": believed.rotor_radius_m,
        "tared": True,
        "noise": noise,
    }
    return Vehicle.model_validate(content)


def pairs(first: pd.DataFrame, second: pd.DataFrame) -> list[tuple]:
    """Rows of two tables of recordings that belong to one group, in the order of the first."""
    others = {row.group: row for row in second.itertuples()}
    return [(row, others[row.group]) for row in first.itertuples() if row.group in others]


def read_pairs(quadrotor: tuple, wrench: tuple, largest_error: float) -> list[Pair]:
    """The experiments' two recordings each; both arguments are (samples, recordings) of `rotorid.io.tables`."""
    commands, felt = by_recording(quadrotor[0]), by_recording(wrench[0])
    return [
        pair_of(
            sent.group,
            int(sent.experiment),
            EXPERIMENTS[int(sent.experiment)].frequency_hz is not None,
            commands[sent.id],
            felt[read.id],
            largest_error,
        )
        for sent, read in pairs(quadrotor[1], wrench[1])
    ]


def dynamics_set(
    name: str, aligned: list[Aligned], recordings: pd.DataFrame, believed: Vehicle, noise: dict[str, float]
) -> RecordingSet:
    """The 48 experiments; `recordings` are the wrench sensor's."""
    session_of = {session.group: session for session in recordings.itertuples()}
    runs = [_experiment_run(session_of[entry.pair.name], entry) for entry in aligned]
    first = session_of[aligned[0].pair.name]
    return RecordingSet(name, _stand_vehicle(name, believed, first, noise), tuple(sorted(runs, key=_name)))


_LARGEST_OFFSET_ERROR_S = 0.01


def torque_set(
    name: str, rotor: tuple, wrench: tuple, believed: Vehicle, noise: dict[str, float], largest_error: float
) -> RecordingSet:
    """The 20 torque tests; where a test's lift is too weak to show its clocks' offset, the others' median is taken."""
    counted, felt = by_recording(rotor[0]), by_recording(wrench[0])
    tests = []
    for drive, read in pairs(rotor[1], wrench[1]):
        (speed, _), (reading, _) = both_on_host(counted[drive.id], felt[read.id], largest_error)
        tests.append((drive.group, speed, reading))
    lags = [torque_offset(speed, reading) for _, speed, reading in tests]
    clear = [lag.delay_s for lag in lags if lag.delay_error_s < _LARGEST_OFFSET_ERROR_S]
    usual = float(np.median(clear)) if clear else 0.0
    runs = [
        _torque_run(test, speed, reading, lag.delay_s if lag.delay_error_s < _LARGEST_OFFSET_ERROR_S else usual)
        for (test, speed, reading), lag in zip(tests, lags, strict=True)
    ]
    first = next(wrench[1].itertuples())
    return RecordingSet(name, _stand_vehicle(name, believed, first, noise), tuple(sorted(runs, key=_name)))


def thrust_set(name: str, rotor: tuple, believed: Vehicle, noise: dict[str, float]) -> RecordingSet:
    """The 50 thrust tests."""
    runs = [_thrust_run(str(key), table) for key, table in by_recording(rotor[0]).items()]
    return RecordingSet(name, _tester_vehicle(name, believed, noise), tuple(sorted(runs, key=_name)))


def _name(run: Run) -> str:
    return run.name
