"""The hidden causes, one function each: what changes in the world for an `amount`, and the truth to be found.

Amount 1 is a plausible size for the vehicle at hand; amounts outside `bounds` are not plausible. A cause
changes a `World` in place and returns its true parameters as (symbol, value, unit). Directions and signs are
drawn from the cause's own random stream, so that the same cause at another amount keeps its direction.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from . import physics
from .vehicles import Airframe

Truth = list[tuple[str, float, str]]


@dataclass
class World:
    """All that differs from a clean flight: physics, sensor errors, wind, what is done to the files."""

    airframe: Airframe
    values: dict
    errors: dict = field(default_factory=dict)
    winds: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)
    ring: bool = False
    believed_limit: float | None = None
    discharge: float = 1.0  # how far the battery empties from run to run and within a run
    file_edits: list[dict] = field(default_factory=list)

    @classmethod
    def clean(cls, airframe: Airframe) -> "World":
        return cls(airframe, physics.clean_physics(airframe))


@dataclass(frozen=True)
class Hidden:
    """One hidden cause: id, wanted rms over the noise (or a direct `amount`), form and time window."""

    id: str
    size: float | None = None
    amount: float = 1.0
    form: str = ""
    window: tuple[float, float] | None = None
    runs: tuple[int, ...] | None = None


def _direction(rng, k=2):
    d = rng.standard_normal(k)
    d /= np.linalg.norm(d)
    return d


def _hover_thrust(a):
    return a.mass_kg * a.gravity_m_s2 / a.n


def _arm(a):
    return float(np.mean(np.hypot(*np.array(a.positions_m)[:, :2].T)))


def rotor_drag(w, x, h, rng) -> Truth:
    a = w.airframe
    if h.form == "blade":
        w.values["blade_sideforce"] = x
        _blades(w)
        v, s = 3.0, a.hover_speed_rad_s
        k = x * physics.blade_forces(s, 0.0, v, physics.to_record(w.values))[1] / (s * v)
        return [("k_d", k, "N/(rad/s m/s)")]
    k = 0.35 * a.mass_kg / (a.n * a.hover_speed_rad_s) * x
    w.values["drag_w"] = k
    w.values["drag_at_hubs"] = 0.0 if h.form == "centre" else 1.0
    return [("k_d", k, "N/(rad/s m/s)")]


def _blades(w) -> None:
    """Pitch the blades so that they carry the vehicle: thrust C_F w^2 in still air."""
    a = w.airframe
    s = a.hover_speed_rad_s
    w.values["solidity"] = 0.37 * a.rotor_radius_m**2  # three blades, chord a fifth of the radius
    low, high = 0.0, 1.0
    for _ in range(50):
        w.values["blade_pitch"] = 0.5 * (low + high)
        thrust, _ = physics.blade_forces(s, 0.0, 0.0, physics.to_record(w.values))
        low, high = (
            (w.values["blade_pitch"], high) if thrust < a.thrust_coefficient * s * s else (low, w.values["blade_pitch"])
        )
    w.values["solidity_thrust"] = a.thrust_coefficient


def frame_drag(w, x, h, rng) -> Truth:
    base = 0.012 * (w.airframe.rotor_radius_m / 0.0635) ** 2 * x
    area = base * np.array([1.0, rng.uniform(1.0, 1.4), rng.uniform(1.2, 2.0)])
    w.values["frame_area_m2"] = area
    w.values["frame_per_axis"] = 1.0 if h.form == "axis" else 0.0
    return [(f"CdA_{c}", v, "m2") for c, v in zip("xyz", area, strict=True)]


def translational_lift(w, x, h, rng) -> Truth:
    if h.form == "blade":
        w.values["blade_edge"] = x
        _blades(w)
        v, s = 5.0, w.airframe.hover_speed_rad_s
        thrust, _ = physics.blade_forces(s, 0.0, v, physics.to_record(w.values))
        return [("k_h", x * (thrust - w.airframe.thrust_coefficient * s * s) / v**2, "N/(m/s)^2")]
    k = 0.009 * w.airframe.mass_kg / w.airframe.n * x
    w.values["lift"] = k
    return [("k_h", k, "N/(m/s)^2")]


def axial_inflow(w, x, h, rng) -> Truth:
    a = w.airframe
    if h.form == "blade":
        w.values["blade_inflow"] = x
        _blades(w)
        v, s = 1.0, a.hover_speed_rad_s
        values = physics.to_record(w.values)
        rise = physics.blade_forces(s, v, 0.0, values)[0] - physics.blade_forces(s, -v, 0.0, values)[0]
        return [("k_z", x * rise / (2 * v * s), "N/(rad/s m/s)")]
    k = 0.5 * a.mass_kg / (a.n * a.hover_speed_rad_s) * x
    w.values["inflow"] = k
    return [("k_z", k, "N/(rad/s m/s)")]


def flapping_moment(w, x, h, rng) -> Truth:
    a = w.airframe
    k = 0.03 * a.mass_kg * a.gravity_m_s2 * _arm(a) / (a.n * a.hover_speed_rad_s * 5) * x
    w.values["flap"] = k
    return [("k_f", k, "N m/(rad/s m/s)")]


def motor_lag(w, x, h, rng) -> Truth:
    up = 0.03 * x
    down = up * (1.5 if h.form == "two" else 1.0)
    w.values["tau_up"] = np.full(w.airframe.n, up)
    w.values["tau_down"] = np.full(w.airframe.n, down)
    w.values["lag_on_thrust"] = 1.0 if h.form == "thrust" else 0.0
    return [("tau_up", up, "s"), ("tau_down", down, "s")]


def battery_sag(w, x, h, rng) -> Truth:
    a = w.airframe
    power = a.n * a.torque_coefficient * a.hover_speed_rad_s**3 / 0.6
    # speed is proportional to voltage; the amount sets how far the voltage moves
    full = float(physics.open_circuit_v(0.9, float(a.cells)))
    w.discharge = x
    w.values["sag"] = 1.0
    w.values["resistance_ohm"] = 0.05 * x * full * full / power
    w.values["capacity_as"] = power / full * 180.0 / x
    w.values["voltage_reference_v"] = full * (1 - 0.05 * x)
    return [("V_ref", w.values["voltage_reference_v"], "V"), ("R_b", w.values["resistance_ohm"], "ohm")]


def thrust_curve(w, x, h, rng) -> Truth:
    a = w.airframe
    share = min(0.15 * x, 0.9)
    if h.form == "constant":
        w.values["thrust_constant_n"] = share * _hover_thrust(a)
    else:
        w.values["thrust_linear_n_s"] = share * _hover_thrust(a) / a.hover_speed_rad_s
    w.values["cf"] = w.values["cf"] * (1 - share)
    return [
        ("c_0", w.values["thrust_constant_n"], "N"),
        ("c_1", w.values["thrust_linear_n_s"], "N s"),
        ("c_2", w.values["cf"][0], "N s2"),
    ]


def throttle_curve(w, x, h, rng) -> Truth:
    a = w.airframe
    if h.form == "dead":
        dead, blend = min(0.05 * x, 0.4), 1.0
    else:
        dead, blend = 0.0, max(1 - 0.3 * x, 0.02)
    w.values["throttle_dead"], w.values["throttle_blend"] = dead, blend
    # the believed limit is the one that is right at hover, as an owner would set it
    u = np.linspace(0.01, 1, 4000)
    v = np.clip((u - dead) / (1 - dead), 0, None)
    speed = np.sqrt((1 - blend) * v + blend * v * v) * a.max_speed_rad_s
    w.believed_limit = float(a.hover_speed_rad_s / np.interp(a.hover_speed_rad_s, speed, u))
    return [("a", blend, "-"), ("u_0", dead, "-"), ("speed_at_full_throttle", a.max_speed_rad_s, "rad/s")]


def com_offset(w, x, h, rng) -> Truth:
    r = np.zeros(3)
    r[:2] = 0.02 * _arm(w.airframe) * x * _direction(rng)
    w.values["centre_m"] = r
    return [(f"r_{c}", v, "m") for c, v in zip("xyz", r, strict=True)]


def unequal_rotors(w, x, h, rng) -> Truth:
    n = w.airframe.n
    if h.form == "one":
        d = np.zeros(n)
        d[rng.integers(n)] = -0.08 * x
    elif h.form == "plane":
        # a pattern whose moments are those of a shifted centre of mass, without yaw
        place = np.array(w.airframe.positions_m)[:, :2] / _arm(w.airframe)
        d = 0.04 * x * place @ _direction(rng)
    else:
        d = rng.standard_normal(n)
        d = 0.04 * x * (d - d.mean()) / d.std()
    w.values["cf"] = w.values["cf"] * (1 + d)
    w.values["cq"] = w.values["cq"] * (1 + d)
    return [(f"d_{i + 1}", v, "-") for i, v in enumerate(d)]


def thrust_tilt(w, x, h, rng) -> Truth:
    n = w.airframe.n
    tilt = np.deg2rad(1.0) * x * _direction(rng)
    axis = w.values["axis"].copy()
    if h.form == "one":
        i = int(rng.integers(n))
        axis[i, :2] += 3 * tilt
    else:
        axis[:, :2] += tilt
    w.values["axis"] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    if h.form == "one":
        return [("rotor", i + 1, "-"), ("eps_x", 3 * tilt[0], "rad"), ("eps_y", 3 * tilt[1], "rad")]
    return [("eps_x", tilt[0], "rad"), ("eps_y", tilt[1], "rad")]


def rotor_gyroscopic(w, x, h, rng) -> Truth:
    w.values["gyroscopic"] = x
    return [("J_r", x * w.airframe.rotor_inertia_kg_m2, "kg m2")]


def rotor_acceleration_torque(w, x, h, rng) -> Truth:
    w.values["acceleration"] = x
    return [("J_r", x * w.airframe.rotor_inertia_kg_m2, "kg m2")]


def inertia_products(w, x, h, rng) -> Truth:
    j = 0.06 * w.airframe.inertia_kg_m2[0] * x * rng.choice([-1, 1], 3) * rng.uniform(0.6, 1.2, 3)
    inertia = w.values["inertia"].copy()
    for value, (r, c) in zip(j, ((0, 1), (0, 2), (1, 2)), strict=True):
        inertia[r, c] += value
        inertia[c, r] += value
    w.values["inertia"] = inertia
    return [(f"J_{s}", v, "kg m2") for s, v in zip(("xy", "xz", "yz"), j, strict=True)]


def rotational_damping(w, x, h, rng) -> Truth:
    c = 1.5 * np.array(w.airframe.inertia_kg_m2) * x
    w.values["damping"] = c
    return [(f"c_{s}", v, "N m s") for s, v in zip("xyz", c, strict=True)]


def ground_effect(w, x, h, rng) -> Truth:
    if h.form == "exponential":
        w.values["ground_exp_a"], w.values["ground_exp_b"] = 0.12 * x, 0.7
        return [("a", 0.12 * x, "-"), ("b", 0.7, "-")]
    w.values["ground"] = 3.0 * x
    return [("c", 3.0 * x, "-")]


def rotor_interference(w, x, h, rng) -> Truth:
    w.values["interference"] = 0.1 * x
    return [("eps", 0.1 * x, "-")]


def vortex_ring(w, x, h, rng) -> Truth:
    w.values["ring_mean"], w.values["ring_noise"] = 0.08 * x, 0.10 * x
    w.ring = True
    return [("mean_loss", 0.08 * x, "-"), ("fluctuation", 0.10 * x, "-")]


def steady_wind(w, x, h, rng) -> Truth:
    speed = 3.0 * x * _direction(rng)
    w.winds.append(lambda t, speed=speed: np.tile([speed[0], speed[1], 0.0], (len(t), 1)))
    return [("w_north", speed[0], "m/s"), ("w_east", speed[1], "m/s")]


def gust(w, x, h, rng) -> Truth:
    start, stop = h.window
    peak = 5.0 * x * _direction(rng)
    swirl_f, swirl_p = rng.uniform(0.3, 1.2, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))

    def blow(t):
        edge = min(0.4, (stop - start) / 4)
        gate = np.clip((t - start) / edge, 0, 1) * np.clip((stop - t) / edge, 0, 1)
        gate = 0.5 - 0.5 * np.cos(np.pi * gate)
        swirl = np.sin(2 * np.pi * swirl_f[:, :, None] * t + swirl_p[:, :, None]).sum(1).T
        out = np.zeros((len(t), 3))
        out[:, :2] = gate[:, None] * (peak + 0.12 * np.linalg.norm(peak) * swirl)
        return out

    w.winds.append(blow)
    return [
        ("w_north", peak[0], "m/s"),
        ("w_east", peak[1], "m/s"),
        ("start", start, "s"),
        ("stop", stop, "s"),
    ]


def payload(w, x, h, rng) -> Truth:
    a = w.airframe
    extra = 0.08 * a.mass_kg * x
    if h.form == "slung":
        w.values["slung_mass"] = extra
        w.values["slung_length"] = 0.6
        w.values["slung_point"] = np.array([0.0, 0.0, 0.1 * _arm(a)])
        return [("mass", extra, "kg"), ("length", 0.6, "m")]
    point = np.array([*(0.3 * _arm(a) * _direction(rng)), 0.2 * _arm(a)])
    total = a.mass_kg + extra
    centre = extra * point / total
    # inertia about the new centre of mass (parallel axes)
    inertia = w.values["inertia"].copy()
    for mass, at in ((a.mass_kg, -centre), (extra, point - centre)):
        inertia = inertia + mass * (at @ at * np.eye(3) - np.outer(at, at))
    w.values["mass"], w.values["centre_m"], w.values["inertia"] = total, centre, inertia
    return [("mass", extra, "kg"), *((f"r_{c}", v, "m") for c, v in zip("xyz", point, strict=True))]


def command_saturation(w, x, h, rng) -> Truth:
    high = w.airframe.hover_speed_rad_s * (1 + 0.16 / x)
    w.values["speed_high"] = high
    return [("w_max", high, "rad/s")]


def delay(w, x, h, rng) -> Truth:
    late = 0.02 * x
    if h.form == "actuation":
        w.values["dead_time_s"] = round(late / w.airframe.step_s) * w.airframe.step_s
        late = w.values["dead_time_s"]
    else:
        w.errors[
            {"": "late_motor_s", "motor": "late_motor_s", "imu": "late_inertial_s", "pose": "late_pose_s"}[h.form]
        ] = late
    return [("T_d", late, "s")]


def accelerometer_error(w, x, h, rng) -> Truth:
    form = h.form or "bias"
    out = []
    if form in ("bias", "all"):
        bias = 0.3 * x * _direction(rng, 3)
        w.errors["force_bias"] = tuple(bias)
        out += [(f"b_{c}", v, "m/s2") for c, v in zip("xyz", bias, strict=True)]
    if form in ("scale", "all"):
        scale = 0.015 * x * rng.choice([-1, 1], 3) * rng.uniform(0.7, 1.3, 3)
        w.errors["force_scale"] = tuple(scale)
        out += [(f"S_{c}{c}", v, "-") for c, v in zip("xyz", scale, strict=True)]
    if form in ("turn", "all"):
        turn = np.array([*(np.deg2rad(1.2) * x * _direction(rng)), 0.0])
        w.errors["force_turn_rad"] = tuple(turn)
        out += [("S_turn_x", turn[0], "rad"), ("S_turn_y", turn[1], "rad")]
    return out


def gyro_error(w, x, h, rng) -> Truth:
    if h.form == "scale":
        scale = 0.02 * x * rng.choice([-1, 1], 3)
        w.errors["rate_scale"] = tuple(scale)
        return [(f"s_{c}", v, "-") for c, v in zip("xyz", scale, strict=True)]
    bias = 0.03 * x * _direction(rng, 3)
    w.errors["rate_bias"] = tuple(bias)
    return [(f"b_{c}", v, "rad/s") for c, v in zip("xyz", bias, strict=True)]


def imu_lever_arm(w, x, h, rng) -> Truth:
    r = 0.2 * _arm(w.airframe) * x * _direction(rng, 3)
    w.errors["sensor_point_m"] = tuple(r)
    return [(f"r_{c}", v, "m") for c, v in zip("xyz", r, strict=True)]


def vibration(w, x, h, rng) -> Truth:
    w.errors["vibration_m_s2"] = 0.6 * x
    w.errors["rectified_m_s2"] = 0.1 * x if h.form == "rectified" else 0.0
    return [("amplitude", 0.6 * x, "m/s2")]


def clock_skew(w, x, h, rng) -> Truth:
    skew = 2e-3 * x * rng.choice([-1, 1])
    w.errors["skew_pose" if h.form == "pose" else "skew_motor"] = skew
    return [("skew", skew, "-")]


def sensor_dropout(w, x, h, rng) -> Truth:
    w.file_edits.append(
        dict(
            kind="dropout",
            form=h.form or "zero",
            windows=h.window,
            runs=h.runs,
            draw=int(rng.integers(1 << 30)),
        )
    )
    return [("start", h.window[0], "s"), ("stop", h.window[1], "s")]


def rotor_order(w, x, h, rng) -> Truth:
    i, j = sorted(rng.choice(w.airframe.n, 2, replace=False))
    w.file_edits.append(dict(kind="swap", rotors=(int(i) + 1, int(j) + 1)))
    return [("swapped", i + 1, "-"), ("swapped", j + 1, "-")]


def spin_direction(w, x, h, rng) -> Truth:
    n = w.airframe.n
    which = list(range(n)) if h.form != "one" else [int(rng.integers(n))]
    w.file_edits.append(dict(kind="spin", rotors=[i + 1 for i in which]))
    return [("rotor", i + 1, "-") for i in which]


def axis_sign(w, x, h, rng) -> Truth:
    column = h.form or "angular_velocity_y_rad_s"
    w.file_edits.append(dict(kind="scale", columns=[column], factor=-1.0))
    return [(column, -1.0, "-")]


_UNITS = {
    "rpm": ("rotor_speed_", 60 / (2 * np.pi)),
    "deg": ("angular_velocity_", 180 / np.pi),
    "g": ("specific_force_", 1 / 9.80665),
    "cm": ("velocity_", 100.0),
    "mm": ("position_", 1000.0),
}


def unit_error(w, x, h, rng) -> Truth:
    prefix, factor = _UNITS[h.form or "rpm"]
    w.file_edits.append(dict(kind="scale", prefix=prefix, factor=factor))
    return [(prefix.rstrip("_"), factor, "-")]


# causes that no id of the catalogue covers


def tether(w, x, h, rng) -> Truth:
    a = w.airframe
    w.values["tether_weight"] = 0.03 * a.mass_kg * a.gravity_m_s2 * x
    w.values["tether_spring"] = 0.03 * a.mass_kg * a.gravity_m_s2 * x
    w.values["tether_slack"] = 1.5
    w.values["tether_point"] = np.array([0.0, 0.0, 0.15 * _arm(a)])
    return [
        ("weight_per_height", w.values["tether_weight"], "N/m"),
        ("spring", w.values["tether_spring"], "N/m"),
    ]


def slosh(w, x, h, rng) -> Truth:
    a = w.airframe
    w.values["slosh_mass"] = min(0.15 * x, 0.6) * a.mass_kg
    w.values["slosh_z"] = 0.3 * _arm(a)
    return [("mass", w.values["slosh_mass"], "kg"), ("rate", w.values["slosh_rate"], "rad/s")]


def sliding_battery(w, x, h, rng) -> Truth:
    w.values["slide_fraction"] = 0.3
    w.values["slide_length"] = 0.12 * _arm(w.airframe) * x
    w.values["slide_threshold"] = 0.8
    return [("slide", w.values["slide_length"], "m")]


def chipped_blade(w, x, h, rng) -> Truth:
    w.values["chip"] = 0.15 * x
    return [("chip", 0.15 * x, "-")]


def magnet(w, x, h, rng) -> Truth:
    a = w.airframe
    w.values["magnet"] = np.array([0.03 * a.mass_kg * a.gravity_m_s2 * _arm(a) * x, 0.0, 0.0])
    w.values["field"] = np.array([0.4, 0.0, 0.9])
    return [("moment", w.values["magnet"][0], "N m")]


def banner(w, x, h, rng) -> Truth:
    a = w.airframe
    w.values["banner"] = 0.002 * a.mass_kg * a.gravity_m_s2 * x
    w.values["banner_point"] = np.array([-0.6 * _arm(a), 0.0, 0.6 * _arm(a)])
    return [("k_banner", w.values["banner"], "N/(m/s)^2")]


@dataclass(frozen=True)
class Cause:
    apply: Callable
    bounds: tuple[float, float]
    needs: tuple[str, ...] = ()  # other causes without which this one cannot act
    acceptable: tuple[str, ...] = ()  # for causes outside the catalogue: names that would not be wrong


CAUSES: dict[str, Cause] = {
    "rotor_drag": Cause(rotor_drag, (0.0005, 4)),
    "frame_drag": Cause(frame_drag, (0.002, 5)),
    "translational_lift": Cause(translational_lift, (0.002, 6)),
    "axial_inflow": Cause(axial_inflow, (0.0005, 4)),
    "flapping_moment": Cause(flapping_moment, (0.002, 6)),
    "motor_lag": Cause(motor_lag, (0.25, 3)),
    "battery_sag": Cause(battery_sag, (0.01, 1.3)),
    "thrust_curve": Cause(thrust_curve, (0.005, 5)),
    "throttle_curve": Cause(throttle_curve, (0.005, 3.2)),
    "com_offset": Cause(com_offset, (0.002, 5)),
    "unequal_rotors": Cause(unequal_rotors, (0.002, 4)),
    "thrust_tilt": Cause(thrust_tilt, (0.002, 5)),
    "rotor_gyroscopic": Cause(rotor_gyroscopic, (0.001, 5)),
    "rotor_acceleration_torque": Cause(rotor_acceleration_torque, (0.0005, 5)),
    "inertia_products": Cause(inertia_products, (0.005, 5)),
    "rotational_damping": Cause(rotational_damping, (0.002, 6)),
    "ground_effect": Cause(ground_effect, (0.001, 4)),
    "rotor_interference": Cause(rotor_interference, (0.01, 3)),
    "vortex_ring": Cause(vortex_ring, (0.02, 4)),
    "steady_wind": Cause(steady_wind, (0.02, 2.5), needs=("rotor_drag",)),
    "gust": Cause(gust, (0.02, 2), needs=("rotor_drag",)),
    "payload": Cause(payload, (0.005, 5)),
    "command_saturation": Cause(command_saturation, (0.3, 5)),
    "delay": Cause(delay, (0.15, 4)),
    "accelerometer_error": Cause(accelerometer_error, (0.002, 8)),
    "gyro_error": Cause(gyro_error, (0.002, 8)),
    "imu_lever_arm": Cause(imu_lever_arm, (0.01, 6)),
    "vibration": Cause(vibration, (0.05, 10)),
    "clock_skew": Cause(clock_skew, (0.02, 12)),
    "sensor_dropout": Cause(sensor_dropout, (1, 1)),
    "rotor_order": Cause(rotor_order, (1, 1)),
    "spin_direction": Cause(spin_direction, (1, 1)),
    "axis_sign": Cause(axis_sign, (1, 1)),
    "unit_error": Cause(unit_error, (1, 1)),
    "tether": Cause(tether, (0.02, 5)),
    "slosh": Cause(slosh, (0.05, 4), needs=("rotor_drag",), acceptable=("payload",)),
    "sliding_battery": Cause(sliding_battery, (0.05, 5), needs=("rotor_drag",)),
    "chipped_blade": Cause(chipped_blade, (0.05, 5), acceptable=("vibration", "unequal_rotors")),
    "magnet": Cause(magnet, (0.02, 5)),
    "banner": Cause(banner, (0.05, 5), acceptable=("frame_drag",)),
}
OUTSIDE = ("tether", "slosh", "sliding_battery", "chipped_blade", "magnet", "banner")
MISTAKES = ("rotor_order", "spin_direction", "axis_sign", "unit_error")
