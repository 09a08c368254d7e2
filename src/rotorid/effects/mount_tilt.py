"""A mount or sensor that does not stand as its angles say."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import NO_ROTORS, at_sensor, rotation_of, weight

_STEP_RAD = 1e-3


def _sensor_turned(loading, vehicle, values):
    """y = F − δ × F, y_M = M − δ × M: the sensor's axes are turned by a small δ."""
    delta = np.zeros(3)
    delta[: len(values)] = values
    load = loading.load
    return Contribution(reading=np.concatenate([-np.cross(delta, load[:, :3]), -np.cross(delta, load[:, 3:])], axis=1))


def _believed(loading, vehicle, roll, pitch):
    from dataclasses import replace

    motion = replace(loading.motion, rotation=rotation_of(roll, pitch))
    thrust = vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2
    hubs = vehicle.rotor_positions_m()
    force, moment = np.zeros((motion.size, 3)), np.zeros((motion.size, 3))
    force[:, 2] = -thrust.sum(axis=1)
    moment[:, 0], moment[:, 1] = -thrust @ hubs[:, 1], thrust @ hubs[:, 0]
    torque = vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs()
    moment[:, 2] = motion.rotor_speed**2 @ torque
    wrench = at_sensor(force, moment, motion, vehicle)
    if not vehicle.tared and vehicle.mass_kg:
        wrench = wrench + weight(motion, vehicle)
    return wrench


def _vehicle_turned(loading, vehicle, values):
    """The vehicle stands (δφ, δθ) off the mount's angles: the derivative of the wrench by them."""
    roll, pitch = loading.attitude
    out = np.zeros((loading.size, 6))
    for value, (a, b) in zip(values, ((1.0, 0.0), (0.0, 1.0)), strict=True):
        if value:
            up = _believed(loading, vehicle, roll + a * _STEP_RAD, pitch + b * _STEP_RAD)
            down = _believed(loading, vehicle, roll - a * _STEP_RAD, pitch - b * _STEP_RAD)
            out += value * (up - down) / (2 * _STEP_RAD)
    return Contribution(reading=out)


def reading_forms(instrument):
    tilt = tuple(Parameter(f"delta_{a}", "rad", -0.3, 0.3, meaning=f"turn of the sensor about {a}") for a in "xyz")
    text = "y = F − δ × F"
    forms = []
    if len(instrument.channels) > 1:
        forms.append(Form("sensor out of level", text, tilt[:2], _sensor_turned))
        sources = {s % 3 for s in instrument.loaded}
        if len(sources) > 1 or 2 not in sources:
            forms.append(Form("sensor turned", text, tilt, _sensor_turned))
    if not instrument.bench:
        names = tuple(Parameter(f"delta_{n}", "rad", -0.3, 0.3, meaning=f"further {n}") for n in ("roll", "pitch"))
        forms.append(Form("vehicle on the mount", "φ = φ_m + δ_φ, θ = θ_m + δ_θ", names, _vehicle_turned))
    return tuple(forms)


EFFECT = Effect(
    id="mount_tilt",
    name="a mount out of true",
    sentence="sensor and load are not aligned as stated, so a part of the load shows on the other axes",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    remedy="calibrate",
    source="catalogue B9",
    sign=(
        "positive δ: the sensor stands turned by δ about its own axis against the stated one (right-handed), "
        "so that δ_y reads a load along +z as one along −x; positive δ_φ, δ_θ: the vehicle stands further "
        "rolled right and pitched up than stated"
    ),
    validity=(
        "small angles (first order in δ), constant over the set; play of the mount and a tilt that grows with "
        "the load are left out"
    ),
    excited_by=("load",),
    confusers=("thrust_tilt", "crosstalk", "tare_offset"),
    separating_manoeuvre="record the weight with the motors off at 0, 15 and 30 degrees",
    kind="sensor",
    exact=True,
    lack_on=lambda instrument: NO_ROTORS if instrument.bench else "one channel only is read",
    cases=("bench/single/mount_tilt/strong/0", "bench/single/crosstalk/strong/0"),
)
