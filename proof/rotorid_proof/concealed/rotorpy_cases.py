"""Recordings flown by RotorPy (Folk, Paulos, Kumar 2023; PyPI `rotorpy`), turned into the contract's axes.

RotorPy's world is z up (taken as north-west-up) and its body forward-left-up, so both turn by half a turn
about x: (x, y, z) -> (x, -y, -z). Its `rotor_directions` +1 pushes the airframe counter-clockwise seen from
above: that rotor spins clockwise. Aerodynamic coefficients are zero unless a case switches them on.
"""

import importlib
from dataclasses import asdict, dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from .residuals import CUTOFF_HZ, residuals, rms
from .richsim import manoeuvres, sensors
from .richsim.flight import Flight
from .richsim.physics import AIR_DENSITY
from .richsim.programmes import programme
from .richsim.scene import Run
from .richsim.vehicles import Airframe
from .write import Recording, plain

STEP_S = 1 / 250
TURN = np.array([1.0, -1.0, -1.0])
# where the published file of a vehicle has a zero, a plausible value takes its place
FILL = {
    "hummingbird": {"k_flap": -1e-5},
    "crazyflie": {"k_flap": -1.5e-8, "k_h": 1e-4, "c_Dx": 4e-4, "c_Dy": 4e-4, "c_Dz": 8e-4},
}
EFFECT = {
    "k_d": "rotor_drag",
    "k_z": "axial_inflow",
    "k_h": "translational_lift",
    "c_D": "frame_drag",
    "k_flap": "flapping_moment",
    "I": "inertia_products",
    "tau_m": "motor_lag",
    "wind": "steady_wind",
    "gust": "gust",
}
WRONG = ("mass_kg", "inertia_xx_kg_m2")


@dataclass(frozen=True)
class RotorpyPlan:
    """One RotorPy set; `switches` name RotorPy's coefficients and the factor on their published value."""

    vehicle: str = "hummingbird"
    switches: tuple[tuple[str, float], ...] = ()
    rate_hz: float = 250.0
    groups: tuple[str, ...] = ("speed", "position", "velocity", "attitude", "rates", "force")
    runs: tuple[Run, ...] = (Run("rich", 20.0), Run("fast", 20.0), Run("climbs", 20.0))
    noise: sensors.Noise = field(default_factory=sensors.Noise)
    form: str = "csv"

    def ids(self) -> tuple[str, ...]:
        """Effects and wrong values to be found."""
        return tuple(EFFECT.get(s, s) for s, _ in self.switches)


def _published(vehicle: str) -> dict:
    module = importlib.import_module(f"rotorpy.vehicles.{vehicle}_params")
    return dict(module.quad_params) | FILL[vehicle]


def _parameters(plan: RotorpyPlan) -> dict:
    """RotorPy's parameters with every effect off but those of the plan."""
    full = _published(plan.vehicle)
    on = dict(plan.switches)
    out = dict(full)
    for key in ("k_d", "k_z", "k_h", "k_flap"):
        out[key] = full[key] * on.get(key, 0.0)
    for axis in "xyz":
        out[f"c_D{axis}"] = full[f"c_D{axis}"] * on.get("c_D", 0.0)
    # off, the motors still lag, but then only measured speeds are recorded
    out["tau_m"] = full["tau_m"] * on["tau_m"] if "tau_m" in on else 0.02
    if "tau_m" in on and plan.vehicle == "hummingbird":
        out["tau_m"] = 0.04 * on["tau_m"]  # the published 5 ms is about one sample
    # a slow motor needs a calmer controller
    lag = max(out["tau_m"], 0.02)
    out["kp_att"], out["kd_att"] = (0.35 / lag) ** 2, 1.7 * 0.35 / lag
    product = 0.05 * full["Ixx"] * on.get("I", 0.0)
    out |= {"Ixy": product, "Ixz": -0.8 * product, "Iyz": 0.6 * product}
    return out


def _wind(plan: RotorpyPlan, rng):
    from rotorpy.wind.default_winds import ConstantWind, NoWind, SinusoidWind

    on = dict(plan.switches)
    heading = rng.uniform(0, 2 * np.pi)
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    if "wind" in on:
        speed = 3.0 * on["wind"] * ahead
        return ConstantWind(*speed), [("w_north", speed[0], "m/s"), ("w_east", -speed[1], "m/s")]
    if "gust" in on:
        size = 3.0 * on["gust"] * ahead
        wind = SinusoidWind(size, np.array([0.15, 0.11, 0.1]), rng.uniform(0, 6, 3))
        return wind, [("amplitude_north", size[0], "m/s"), ("amplitude_east", -size[1], "m/s")]
    return NoWind(), []


def _airframe(p: dict, name: str) -> Airframe:
    """The same vehicle in contract axes."""
    positions = np.array(list(p["rotor_pos"].values()), float) * TURN
    return Airframe(
        name=name,
        mass_kg=p["mass"],
        inertia_kg_m2=(p["Ixx"], p["Iyy"], p["Izz"]),
        positions_m=tuple(tuple(map(float, r)) for r in positions),
        spin=tuple(int(-s) for s in p["rotor_directions"]),
        thrust_coefficient=p["k_eta"],
        torque_coefficient=p["k_m"],
        rotor_radius_m=p.get("rotor_radius", 0.023),
        rotor_inertia_kg_m2=0.0,
        max_speed_rad_s=p["rotor_speed_max"],
        cells=1,
        step_s=STEP_S,
    )


def fly(parameters: dict, airframe: Airframe, reference: manoeuvres.Reference, wind) -> Flight:
    """Fly a reference with RotorPy's vehicle, controller and wind; reference and flight in contract axes."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.multirotor import Multirotor

    n = airframe.n
    g = airframe.gravity_m_s2
    start = {
        "x": reference.position_m[0] * TURN,
        "v": np.zeros(3),
        "q": np.array([0.0, 0, 0, 1]),
        "w": np.zeros(3),
        "wind": np.zeros(3),
        "rotor_speeds": np.full(n, airframe.hover_speed_rad_s),
    }
    vehicle = Multirotor(parameters, start, control_abstraction="cmd_motor_speeds", aero=True)
    controller = SE3Control(parameters)
    excite = gaussian_filter1d(reference.attitude_rad * TURN, 0.05 / STEP_S, axis=0)
    acceleration = reference.acceleration_m_s2 * TURN
    acceleration[:, 0] += g * excite[:, 1]
    acceleration[:, 1] -= g * excite[:, 0]
    yaw = -reference.yaw_rad + excite[:, 2]
    yaw_rate = np.gradient(-reference.yaw_rad, STEP_S)
    zero = np.zeros(3)
    state = start
    rows = []
    for k, t in enumerate(reference.time_s):
        state["wind"] = wind.update(t, state["x"])
        flat = {
            "x": reference.position_m[k] * TURN,
            "x_dot": reference.velocity_m_s[k] * TURN,
            "x_ddot": acceleration[k],
            "x_dddot": zero,
            "x_ddddot": zero,
            "yaw": yaw[k],
            "yaw_dot": yaw_rate[k],
        }
        control = controller.update(t, state, flat)
        rates = vehicle.statedot(state, control, STEP_S)
        command = np.clip(control["cmd_motor_speeds"], parameters["rotor_speed_min"], parameters["rotor_speed_max"])
        body = Rotation.from_quat(state["q"]).inv().apply(rates["vdot"] + np.array([0, 0, g]))
        parts = (
            state["x"],
            state["v"],
            state["q"],
            state["w"],
            rates["wdot"],
            body,
            state["rotor_speeds"],
            command,
        )
        rows.append(np.concatenate(parts))
        state = vehicle.step(state, control, STEP_S)
    keep = reference.time_s >= -1e-9
    out = np.array(rows)[keep]
    if np.linalg.norm(out[:, 0:3] * TURN - reference.position_m[keep], axis=1).max() > 15 or not np.isfinite(out).all():
        raise manoeuvres.Lost("RotorPy's vehicle was lost")
    x, y, z, w = out[:, 6:10].T
    flips = np.cumprod(np.where((out[1:, 6:10] * out[:-1, 6:10]).sum(1) < 0, -1.0, 1.0))
    quaternion = np.stack([w, x, -y, -z], 1)
    quaternion[1:] *= flips[:, None]
    k = len(out)
    return Flight(
        time_s=reference.time_s[keep],
        position_m=out[:, 0:3] * TURN,
        velocity_m_s=out[:, 3:6] * TURN,
        quaternion=quaternion,
        rates_rad_s=out[:, 10:13] * TURN,
        rate_derivative=out[:, 13:16] * TURN,
        centre_specific_force=out[:, 16:19] * TURN,
        centre_m=np.zeros(3),
        speed_rad_s=out[:, 19 : 19 + n],
        command_rad_s=out[:, 19 + n : 19 + 2 * n],
        phase_rad=np.zeros((k, n)),
        voltage_v=np.zeros(k),
        current_a=np.zeros(k),
        saturated=np.zeros(k, bool),
        ground_gain=np.zeros(k),
        in_ring=np.zeros(k, bool),
    )


def _truth(plan: RotorpyPlan, p: dict, wind_truth: list) -> list[dict]:
    values = {
        "k_d": [("k_d", p["k_d"], "N/(rad/s m/s)")],
        "k_z": [("k_z", p["k_z"], "N/(rad/s m/s)")],
        "k_h": [("k_h", p["k_h"], "N/(m/s)^2")],
        "c_D": [(f"CdA_{a}", 2 * p[f"c_D{a}"] / AIR_DENSITY, "m2") for a in "xyz"],
        # RotorPy's positive sign is nose down for forward speed; here positive is nose up
        "k_flap": [("k_f", -p["k_flap"], "N m/(rad/s m/s)")],
        "I": [("J_xy", -p["Ixy"], "kg m2"), ("J_xz", -p["Ixz"], "kg m2"), ("J_yz", p["Iyz"], "kg m2")],
        "tau_m": [("tau_up", p["tau_m"], "s"), ("tau_down", p["tau_m"], "s")],
        "wind": wind_truth,
        "gust": wind_truth,
    }
    return [
        {
            "id": EFFECT[s],
            "form": "rotorpy",
            "parameters": [{"symbol": a, "value": v, "unit": u} for a, v, u in values[s]],
            "size_over_noise": None,
            "main_channel": None,
            "amount": factor,
            "equivalent": [],
        }
        for s, factor in plan.switches
        if s in EFFECT
    ]


def make(plan: RotorpyPlan, seed: int):
    """The set, its truth, and the noise-free tables, in the same form as `richsim.scene.make`."""
    p = _parameters(plan)
    airframe = _airframe(p, plan.vehicle)
    wind, wind_truth = _wind(plan, np.random.default_rng([seed, 7]))
    on = dict(plan.switches)
    belief = {"mass_kg": airframe.mass_kg, "inertia_xx_kg_m2": airframe.inertia_kg_m2[0]}
    wrong = {k: {"believed": belief[k] * on[k], "true": belief[k]} for k in WRONG if k in on}
    believed = {k: belief[k] * on.get(k, 1.0) for k in belief}
    vehicle = {
        "name": plan.vehicle,
        "kind": "flight",
        "mass_kg": believed["mass_kg"],
        "inertia_kg_m2": {
            "xx": believed["inertia_xx_kg_m2"],
            "yy": airframe.inertia_kg_m2[1],
            "zz": airframe.inertia_kg_m2[2],
        },
        "rotors": [
            {"x_m": r[0], "y_m": r[1], "z_m": r[2], "spin": "ccw" if s > 0 else "cw"}
            for r, s in zip(airframe.positions_m, airframe.spin, strict=True)
        ],
        "thrust_coefficient_n_s2": airframe.thrust_coefficient,
        "torque_coefficient_n_m_s2": airframe.torque_coefficient,
        "gravity_m_s2": airframe.gravity_m_s2,
        "rotor_radius_m": airframe.rotor_radius_m,
    }
    runs, ideals, channels = {}, {}, {}
    for i, run in enumerate(plan.runs):
        name = f"run{i + 1:02d}"
        rng = np.random.default_rng([seed, 11, i])
        segments, altitude = programme(run.purpose, run.duration_s, airframe, rng, slow=True)
        reference = manoeuvres.build(segments, altitude, STEP_S, airframe.n, rng, warm_up_s=2.0, top_hz=5.0)
        flight = manoeuvres.flown(lambda r, w=wind: fly(p, airframe, r, w), reference)
        layout = sensors.Layout(plan.rate_hz, plan.groups)
        noise_rng = np.random.default_rng([seed, 13, i])
        ideal, written = sensors.record(
            flight, layout, plan.noise, sensors.Errors(), airframe.max_speed_rad_s, noise_rng
        )
        runs[name], ideals[name] = written, ideal
        a, b = residuals(ideal, vehicle), residuals(written, vehicle)
        channels[name] = {
            c: {"noise_rms": rms(b[c] - a[c]), "mismatch_rms": rms(a[c]), "before_rms": rms(b[c])} for c in a
        }
    effects = _truth(plan, p, wind_truth)
    truth = {
        "effects": effects,
        "wrong_parameters": wrong,
        "outside_catalogue": [],
        "locations": [],
        "verdict": ["explained"] if effects or wrong else ["no_mismatch"],
        "oracle": {"cutoff_hz": CUTOFF_HZ, "runs": channels},
        "plan": asdict(plan),
        "seed": seed,
    }
    return Recording(vehicle, runs, (), plan.form), plain(truth), ideals
