"""Steps that no trajectory and no schedule can hold: what a person does between two recordings, and what it shows."""

from __future__ import annotations

from collections.abc import Sequence

STEPS: dict[str, str] = {
    "unequal_rotors": (
        "swap the propellers of two rotors that turn the same way and repeat the hover: the moment of a propeller goes "
        "with it, that of an offset of the centre of mass or of a tilted rotor stays"
    ),
    "payload": (
        "weigh the vehicle, take off what it carries and repeat the flight: the moment of a payload goes with it, an "
        "offset of the empty vehicle's centre of mass stays"
    ),
    "com_offset": (
        "hang a known weight on one side, as far from the middle as a rotor, and repeat the hover: an offset of the "
        "centre of mass changes by weight times distance over the mass of both"
    ),
    "thrust_tilt": "align the motors' mounts and repeat the flight: only the force of a tilted rotor changes",
    "accelerometer_error": (
        "lay the vehicle at rest on each of its six faces, ten seconds each: the accelerometer must read gravity along "
        "one axis and nothing along the others"
    ),
    "gyro_error": "record ten seconds at rest before take-off: what the gyroscope reads then is its own error",
    "steady_wind": "repeat the flight in a hall or on a day without wind: only a wind goes away",
    "gust": "repeat the flight in a hall or on a day without wind: only a gust goes away",
    "battery_sag": "repeat the flight with a battery half empty: what the voltage makes changes with it",
    "imu_lever_arm": "measure the place of the accelerometer from the centre of mass with a ruler",
    "tare_offset": "take off every load and record ten seconds, zero the reading, and record ten seconds again",
    "mount_tilt": "lay a spirit level on the sensor, and record the weight with the motors off, level and tilted",
    "sensor_origin": "hang a known weight at two known distances from the sensor's axis",
    "cable_stiffness": "lay the cable in another loop, or tape it to the vehicle, and repeat the tilts",
    "wall_interference": "move the wall or the stand by a rotor's diameter and repeat the steps of the throttle",
    "structural_resonance": "put half a kilogram on the stand and tap it: a ring of the structure becomes slower",
    "crosstalk": "turn the sensor by a quarter about the load's axis and repeat: crosstalk turns with the sensor",
    "zero_drift": "switch the instrument on an hour earlier and repeat: a drift with warmth is gone by then",
    "load_nonlinearity": (
        "put on dead weights that were weighed, motors off: a curve of the reading shows without rotors"
    ),
    "thrust_curve": (
        "read a dead weight as heavy as the largest thrust: a curve of the thrust is not in it, one of the reading is"
    ),
}


def by_hand(ids: Sequence[str]) -> tuple[str, ...]:
    """Manual steps that set one id of a class apart from the others, in the class's order, each once."""
    return tuple(steps_of(ids).values())


def steps_of(ids: Sequence[str]) -> dict[str, str]:
    """The same, to the id that each step is there for."""
    return {i: STEPS[i] for i in dict.fromkeys(ids) if i in STEPS}
