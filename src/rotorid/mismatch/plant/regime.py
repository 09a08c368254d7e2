"""Regime variables of a flight: what a mismatch may depend on."""

from __future__ import annotations

import numpy as np

from rotorid.effects.scale import hover_inflow_m_s
from rotorid.mismatch.plant.motion import Segment


def regime_variables(segment: Segment, prepared) -> dict[str, np.ndarray]:
    """Regime variables on the thinned instants of a segment, with units in their names."""
    motion, vehicle, thin = segment.motion, prepared.vehicle, prepared.thinner
    out = {"time_s": thin.times(motion.time_s)}

    def add(name, values):
        if values is not None:
            out[name] = thin(np.asarray(values, float))

    if motion.velocity is not None:
        add("airspeed_m_s", np.linalg.norm(motion.velocity, axis=1))
        add("forward_speed_m_s", motion.velocity[:, 0])
        add("sideward_speed_m_s", motion.velocity[:, 1])
        add("vertical_speed_over_hover_inflow", motion.velocity[:, 2] / hover_inflow_m_s(vehicle))
    if motion.height is not None:
        add("height_over_rotor_radius", motion.height / (vehicle.rotor_radius_m or 1.0))
    if motion.rotor_speed is not None:
        add("rotor_speed_rad_s", motion.rotor_speed.mean(axis=1))
        if motion.rotor_acceleration is not None:
            add("rotor_acceleration_rad_s2", motion.rotor_acceleration.mean(axis=1))
    if motion.rotation is not None:
        add("tilt_rad", np.arccos(np.clip(motion.rotation[:, 2, 2], -1, 1)))
    if motion.angular_velocity is not None:
        add("body_rate_rad_s", np.linalg.norm(motion.angular_velocity, axis=1))
    add("battery_voltage_v", motion.voltage)
    for name, values in segment.extra.items():
        if np.ptp(values) > 0:
            add(name, values)
    return out
