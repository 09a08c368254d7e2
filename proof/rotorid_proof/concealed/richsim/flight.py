"""One flight: fly the reference and return the dense truth that sensors sample."""

from dataclasses import dataclass

import numpy as np

from . import physics
from .manoeuvres import Lost, Reference
from .vehicles import Airframe


@dataclass(frozen=True)
class Flight:
    """Truth on the simulator's own grid (k steps, n rotors); position and velocity of the body's origin."""

    time_s: np.ndarray  # (k,)
    position_m: np.ndarray  # (k, 3) world
    velocity_m_s: np.ndarray  # (k, 3) world
    quaternion: np.ndarray  # (k, 4) body to world, scalar first
    rates_rad_s: np.ndarray  # (k, 3) body
    rate_derivative: np.ndarray  # (k, 3) body, rad/s^2
    centre_specific_force: np.ndarray  # (k, 3) body, m/s^2, at the true centre of mass
    centre_m: np.ndarray  # (3,) true centre of mass from the body's origin
    speed_rad_s: np.ndarray  # (k, n)
    command_rad_s: np.ndarray  # (k, n)
    phase_rad: np.ndarray  # (k, n) unwrapped
    voltage_v: np.ndarray  # (k,)
    current_a: np.ndarray  # (k,)
    saturated: np.ndarray  # (k,) bool
    ground_gain: np.ndarray  # (k,) thrust gain by the ground minus one, of the rotor nearest to it
    in_ring: np.ndarray  # (k,) bool

    def specific_force_at(self, point_m) -> np.ndarray:
        """Specific force (k, 3) felt at a body point."""
        arm = np.asarray(point_m) - self.centre_m
        w = self.rates_rad_s
        return self.centre_specific_force + np.cross(self.rate_derivative, arm) + np.cross(w, np.cross(w, arm))


def rotations(q: np.ndarray) -> np.ndarray:
    """Body-to-world matrices (k, 3, 3) of quaternions (k, 4)."""
    w, x, y, z = q.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def tuned(values: dict, rate_hz: float) -> dict:
    """Controller bandwidth that the actuators' delay and the recording's rate allow."""
    values = dict(values)
    values["command_cut_hz"] = float(np.clip(rate_hz / 8, 5.0, 12.0))
    lag = 2 / (2 * np.pi * values["command_cut_hz"]) + float(np.max(values["tau_up"])) + values["dead_time_s"]
    values["attitude_rate"] = float(min(9.0, 0.32 / lag))
    return values


def fly(
    airframe: Airframe,
    values: dict,
    reference: Reference,
    wind_m_s: np.ndarray | None = None,
    ring: np.ndarray | None = None,
    charge: float = 0.95,
) -> Flight:
    """Fly `reference` with physics `values`; wind (k, 3) world and ring noise (k, n) default to none.

    Raises Lost when the vehicle is lost, because a recording of a crash is not what was asked for.
    """
    k, n = len(reference.time_s), airframe.n
    wind_m_s = np.zeros((k, 3)) if wind_m_s is None else wind_m_s
    ring = np.zeros((k, n)) if ring is None else ring
    size = physics.state_size(n)
    out = np.zeros((k, size + 10 + 3 * n))
    done = physics.fly(
        physics.to_record(values),
        airframe.step_s,
        reference.position_m,
        reference.velocity_m_s,
        reference.acceleration_m_s2,
        reference.yaw_rad,
        reference.attitude_rad,
        reference.speed_fraction,
        np.ascontiguousarray(wind_m_s),
        np.ascontiguousarray(ring),
        charge,
        out,
    )
    lost = np.linalg.norm(out[:done, 0:3] - reference.position_m[:done], axis=1).max() > 15.0
    if done < k or lost:
        raise Lost(f"the vehicle was lost after {done * airframe.step_s:.1f} s of {k * airframe.step_s:.1f} s")
    keep = reference.time_s >= -1e-9
    out = out[keep]
    aux = out[:, size:]
    q = out[:, 6:10]
    R = rotations(q)
    w = out[:, 10:13]
    centre = np.asarray(values["centre_m"], float)
    return Flight(
        time_s=reference.time_s[keep],
        position_m=out[:, 0:3] - R @ centre,
        velocity_m_s=out[:, 3:6] - np.einsum("kij,kj->ki", R, np.cross(w, centre)),
        quaternion=q,
        rates_rad_s=w,
        rate_derivative=aux[:, 3:6],
        centre_specific_force=aux[:, 0:3],
        centre_m=centre,
        speed_rad_s=aux[:, 6 : 6 + n],
        command_rad_s=out[:, 13 : 13 + n],
        phase_rad=np.unwrap(aux[:, 10 + 2 * n :], axis=0),
        voltage_v=out[:, 13 + 5 * n + 1],
        current_a=aux[:, 6 + 2 * n],
        saturated=aux[:, 7 + 2 * n] > 0,
        ground_gain=aux[:, 8 + 2 * n],
        in_ring=aux[:, 9 + 2 * n] > 0,
    )
