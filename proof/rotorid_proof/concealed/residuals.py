"""The mismatch of a recording with the plain rigid body, computed here only to size effects and to score.

Both sides pass the same zero-phase low-pass (20 Hz, or 0.4 of the rate below 50 Hz). Channels: force and
moment in body axes, rotor speed against command, and two kinematic ones (specific force against velocity,
rates against attitude).
"""

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

CUTOFF_HZ = 20.0


def _triple(table, prefix, unit):
    return table[[f"{prefix}_{a}_{unit}" for a in "xyz"]].to_numpy(float)


def _rotation(q):
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def residuals(table: pd.DataFrame, vehicle: dict) -> dict[str, np.ndarray]:
    """Measured minus modelled, each channel (k,), edges of 0.3 s left out; needs an evenly sampled table.

    Missing cells are bridged by straight lines.
    """
    table = table.interpolate(limit_direction="both")
    t = table["time_s"].to_numpy(float)
    rate = 1 / np.median(np.diff(t))
    sos = butter(4, min(CUTOFF_HZ, 0.4 * rate) / (rate / 2), output="sos")

    def smooth(x):
        return sosfiltfilt(sos, x, axis=0)

    def slope(x):
        return CubicSpline(np.arange(len(x)) / rate, x, axis=0)(np.arange(len(x)) / rate, 1)

    n = len(vehicle["rotors"])
    mass, g = vehicle["mass_kg"], vehicle.get("gravity_m_s2", 9.81)
    j = vehicle["inertia_kg_m2"]
    inertia = np.diag([j["xx"], j["yy"], j["zz"]])
    position = np.array([[r["x_m"], r["y_m"], r["z_m"]] for r in vehicle["rotors"]])
    spin = np.array([1.0 if r["spin"] == "ccw" else -1.0 for r in vehicle["rotors"]])
    cf = np.broadcast_to(vehicle["thrust_coefficient_n_s2"], n)
    cq = np.broadcast_to(vehicle["torque_coefficient_n_m_s2"], n)
    speed = command = None
    if "rotor_speed_1_rad_s" in table:
        speed = table[[f"rotor_speed_{i + 1}_rad_s" for i in range(n)]].to_numpy(float)
    if "rotor_command_1_rad_s" in table:
        command = table[[f"rotor_command_{i + 1}_rad_s" for i in range(n)]].to_numpy(float)
    elif "throttle_1" in table:
        command = (
            table[[f"throttle_{i + 1}" for i in range(n)]].to_numpy(float) * vehicle["rotor_speed_limits_rad_s"][1]
        )
    w = speed if speed is not None else command
    out = {}
    edge = int(0.3 * rate)
    thrust = cf * w * w
    rates = attitude = force = velocity = None
    if "quaternion_w" in table:
        q = table[[f"quaternion_{c}" for c in "wxyz"]].to_numpy(float)
        attitude = _rotation(q)
    if "angular_velocity_x_rad_s" in table:
        rates = _triple(table, "angular_velocity", "rad_s")
    if attitude is not None:
        spin_matrix = np.einsum("kji,kjl->kil", attitude, slope(attitude))
        derived = np.stack([spin_matrix[:, 2, 1], spin_matrix[:, 0, 2], spin_matrix[:, 1, 0]], 1)
        if rates is not None:
            gap = smooth(rates) - smooth(derived)
            out |= {f"kinematic_rate_{a}": gap[:, k] for k, a in enumerate("xyz")}
        else:
            rates = derived
    if "specific_force_x_m_s2" in table:
        force = smooth(_triple(table, "specific_force", "m_s2"))
    if "velocity_x_m_s" in table:
        velocity = _triple(table, "velocity", "m_s")
    elif "position_x_m" in table:
        velocity = slope(smooth(_triple(table, "position", "m")))
    if velocity is not None and attitude is not None:
        derived = smooth(np.einsum("kji,kj->ki", attitude, slope(velocity) - np.array([0, 0, g])))
        if force is not None:
            gap = force - derived
            out |= {f"kinematic_force_{a}": gap[:, k] for k, a in enumerate("xyz")}
        else:
            force = derived
    if force is not None:
        model = np.zeros((len(t), 3))
        model[:, 2] = -thrust.sum(1)
        gap = mass * force - smooth(model)
        out |= {f"force_{a}": gap[:, k] for k, a in enumerate("xyz")}
    if rates is not None:
        model = np.stack(
            [-(thrust * position[:, 1]).sum(1), (thrust * position[:, 0]).sum(1), (w * w * cq * spin).sum(1)],
            1,
        )
        smoothed = smooth(rates)
        gap = slope(smoothed) @ inertia + np.cross(smoothed, smoothed @ inertia) - smooth(model)
        out |= {f"moment_{a}": gap[:, k] for k, a in enumerate("xyz")}
    if speed is not None and command is not None:
        gap = smooth(speed) - smooth(command)
        out |= {f"rotor_speed_{i + 1}": gap[:, i] for i in range(n)}
    return {k: v[edge:-edge] for k, v in out.items()}


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x * x)))
