"""A vehicle as RotorPy parameters, as a MuJoCo model and as PX4 parameters.

Those tools have the body forward-left-up: y and z of places change sign, and a rotor that turns counter-clockwise seen
from above pushes the airframe about minus z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from xml.sax.saxutils import quoteattr

import numpy as np

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle

FLU = np.array([1.0, -1.0, -1.0])
AT_ONCE_S = 1e-3
"""Time constant of a motor in tools that need one, where the vehicle states none."""


@dataclass(frozen=True)
class Exported:
    """A file for another tool and a sentence for each thing that it cannot express."""

    text: str
    file_name: str
    left_out: tuple[str, ...] = ()
    parameters: dict = field(default_factory=dict)
    """RotorPy only: the parameters as RotorPy takes them."""


@dataclass(frozen=True)
class Parts:
    """The effects of a vehicle as far as such forms know them; SI units, body axes forward-right-down."""

    mass_kg: float
    inertia: np.ndarray
    """(3, 3), kg m2."""
    places: np.ndarray
    """Rotor hubs from the centre of mass, (n, 3), m."""
    thrust: np.ndarray
    """C_F by rotor, (n,), N s2."""
    torque: np.ndarray
    tau_s: tuple[float, float] = (0.0, 0.0)
    """Time constants of the rotor speed, up and down."""
    drag: tuple[float, float] = (0.0, 0.0)
    """Rotor drag k_d along x and y, N s2/(rad m)."""
    inflow: float = 0.0
    lift: float = 0.0
    flap: float = 0.0
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    left_out: tuple[str, ...] = ()


def parts_of(vehicle: Vehicle, knows: set[str]) -> Parts:
    """What a form that `knows` these effects can take of a vehicle; the rest goes to `left_out`."""
    values: dict = {
        "inertia": vehicle.inertia_kg_m2.matrix(),
        "places": vehicle.rotor_positions_m(),
        "thrust": vehicle.thrust_coefficients_n_s2(),
        "torque": vehicle.torque_coefficients_n_m_s2(),
    }
    left = []
    for entry in vehicle.effects:
        name, form, p = entry["id"], entry.get("form", ""), {k: float(v) for k, v in entry["parameters"].items()}
        said = f"{name} ({form}: {', '.join(f'{k} = {v:.4g}' for k, v in p.items())})"
        taken = name in knows and _take(values, name, form, p)
        if not taken:
            left.append(said)
        elif isinstance(taken, str):
            left.append(f"{said}: {taken}")
    return Parts(vehicle.mass_kg, left_out=tuple(left), **values)


def _take(values: dict, name: str, form: str, p: dict[str, float]) -> bool | str:
    """Put an effect into the parts; False where its form has no place there, a remark where it fits only nearly."""
    if name == "rotor_drag" and "k_d" in p:
        values["drag"] = (p["k_d"], p["k_d"])
        return True if form == "at the hubs" else "taken at the hubs in place of the centre of mass"
    if name == "axial_inflow" and "k_z" in p:
        values["inflow"] = p["k_z"]
        return True if form == "at the hubs" else "taken at the hubs in place of the centre of mass"
    if name == "translational_lift":
        values["lift"] = p["k_h"]
        return True if form == "at the hubs" else "taken at the hubs in place of the centre of mass"
    if name == "flapping_moment" and form == "at the hubs":
        values["flap"] = p["k_flap"]
        return True
    if name == "frame_drag" and form in ("isotropic", "per axis"):
        values["frame"] = (p["c"],) * 3 if "c" in p else (p["c_x"], p["c_y"], p["c_z"])
        return True
    if name == "motor_lag" and form == "one constant":
        values["tau_s"] = (p["tau"], p["tau"])
        return True
    if name == "motor_lag" and form == "up and down":
        values["tau_s"] = (p["tau_up"], p["tau_down"])
        return True
    if name == "com_offset" and form == "moment":
        values["places"] = values["places"] - np.array([p["r_x"], p["r_y"], 0.0])
        return "taken as rotors that sit elsewhere, so that their drag acts there, too"
    if name == "inertia_products":
        j = values["inertia"].copy()
        for (a, b), key in (((0, 1), "J_xy"), ((0, 2), "J_xz"), ((1, 2), "J_yz")):
            j[a, b] += p.get(key, 0.0)
            j[b, a] = j[a, b]
        values["inertia"] = j
        return True
    return False


def _in_flu(inertia: np.ndarray) -> np.ndarray:
    return inertia * np.outer(FLU, FLU)


def rotorpy(vehicle: Vehicle) -> Exported:
    """RotorPy's `quad_params` as a Python file."""
    knows = {"rotor_drag", "axial_inflow", "translational_lift", "flapping_moment", "frame_drag", "motor_lag",
             "com_offset", "inertia_products"}  # fmt: skip
    parts = parts_of(vehicle, knows)
    left = list(parts.left_out)
    for words, values in (("thrust", parts.thrust), ("torque", parts.torque)):
        if np.ptp(values) > 0:
            shown = ", ".join(f"{v:.4g}" for v in values)
            left.append(f"{words} coefficients differ between rotors ({shown}): their mean is taken")
    up, down = parts.tau_s
    if up != down:
        left.append(f"motor_lag: {up:.4g} s up and {down:.4g} s down: the mean is taken")
    if up == 0:
        left.append(f"rotors that follow at once: RotorPy needs a lag, {AT_ONCE_S:g} s is taken")
    if vehicle.gravity_m_s2 != 9.81:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: RotorPy has 9.81")
    j = _in_flu(parts.inertia)
    low, high = vehicle.rotor_speed_limits_rad_s or (0.0, 10 * _hover(vehicle))
    values = {
        "mass": parts.mass_kg,
        **{f"I{a}{b}": float(j["xyz".index(a), "xyz".index(b)]) for a, b in ("xx", "yy", "zz", "xy", "yz", "xz")},
        "num_rotors": vehicle.rotor_count,
        "rotor_pos": {f"r{i}": (place * FLU).tolist() for i, place in enumerate(parts.places, 1)},
        "rotor_directions": [-float(s) for s in vehicle.yaw_signs()],
        "rI": (np.asarray(vehicle.accelerometer_position_m) * FLU).tolist(),
        "c_Dx": parts.frame[0], "c_Dy": parts.frame[1], "c_Dz": parts.frame[2],
        "k_eta": float(parts.thrust.mean()), "k_m": float(parts.torque.mean()),
        "k_d": parts.drag[0], "k_z": parts.inflow, "k_h": parts.lift,
        # RotorPy has the moment along z up × v, the catalogue along z down × v.
        "k_flap": -parts.flap,
        "tau_m": (up + down) / 2 or AT_ONCE_S,
        "rotor_speed_min": low, "rotor_speed_max": high, "motor_noise_std": 0.0,
    }  # fmt: skip
    lines = [f'"""{vehicle.name}, exported by rotorid for RotorPy (body forward-left-up, SI units)."""', ""]
    lines = [line.replace("\\", "/") for line in lines] + ["import numpy as np", ""]
    lines += [f"# Not expressed: {sentence}" for sentence in left]
    lines.append("quad_params = {")
    for key, value in values.items():
        if key == "rotor_pos":
            lines.append('    "rotor_pos": {')
            lines += [f'        "{name}": np.array({place!r}),' for name, place in value.items()]
            lines.append("    },")
        else:
            shown = f"np.array({value!r})" if isinstance(value, list) else repr(value)
            lines.append(f'    "{key}": {shown},')
    lines += ["}", ""]
    arrays = {k: np.array(v) if isinstance(v, list) else v for k, v in values.items()}
    arrays["rotor_pos"] = {k: np.array(v) for k, v in values["rotor_pos"].items()}
    return Exported("\n".join(lines), "rotorpy_params.py", tuple(left), arrays)


def _hover(vehicle: Vehicle) -> float:
    return float(np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.thrust_coefficients_n_s2().sum()))


def mjcf(vehicle: Vehicle) -> Exported:
    """A MuJoCo model: a free body, a site and a motor a rotor; control i is the thrust of rotor i, N.

    The thrust of a rotor speed ω is C_F ω²; the torque goes along by the motor's gear.
    """
    parts = parts_of(vehicle, {"com_offset", "inertia_products"})
    left = list(parts.left_out)
    j = _in_flu(parts.inertia)
    full = " ".join(f"{v:.9g}" for v in (j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2]))
    limit = vehicle.rotor_speed_limits_rad_s
    sites, motors = [], []
    for i, (place, signed) in enumerate(zip(parts.places, vehicle.yaw_signs(), strict=True), 1):
        at = " ".join(f"{v:.9g}" for v in place * FLU)
        ratio = -signed * parts.torque[i - 1] / parts.thrust[i - 1]
        most = f' ctrlrange="0 {parts.thrust[i - 1] * limit[1] ** 2:.9g}"' if limit else ""
        sites.append(f'      <site name="rotor_{i}" pos="{at}"/>')
        motors.append(f'    <motor name="rotor_{i}" site="rotor_{i}" gear="0 0 1 0 0 {ratio:.9g}"{most}/>')
    comments = "".join(f"  <!-- Not expressed: {s.replace('--', '- -')} -->\n" for s in left)
    c_f = ", ".join(f"{v:.6g}" for v in parts.thrust)
    name = quoteattr(vehicle.name)
    nl = "\n"
    text = f"""<mujoco model={name}>
{comments}  <!-- Control i is the thrust of rotor i in N: C_F times the square of its speed, C_F = {c_f} N s2. -->
  <option timestep="0.001" gravity="0 0 -{vehicle.gravity_m_s2:g}" integrator="RK4"/>
  <worldbody>
    <body name="vehicle" pos="0 0 1">
      <freejoint/>
      <inertial pos="0 0 0" mass="{parts.mass_kg:.9g}" fullinertia="{full}"/>
      <geom type="box" size="0.02 0.02 0.01" contype="0" conaffinity="0" mass="0"/>
{nl.join(sites)}
    </body>
  </worldbody>
  <actuator>
{nl.join(motors)}
  </actuator>
</mujoco>
"""
    return Exported(text, "vehicle.xml", tuple(left))


def px4(vehicle: Vehicle) -> Exported:
    """Parameters of PX4's control allocation and thrust model, as QGroundControl loads them."""
    parts = parts_of(vehicle, {"com_offset"})
    left = [*parts.left_out, "mass and inertia: PX4 has no parameters for them"]
    rows: list[tuple[str, float, int]] = [("CA_AIRFRAME", 0, 6), ("CA_ROTOR_COUNT", vehicle.rotor_count, 6)]
    strongest = parts.thrust.max()
    for i, (place, signed) in enumerate(zip(parts.places, vehicle.yaw_signs(), strict=True)):
        ratio = parts.torque[i] / parts.thrust[i]
        values = {"PX": place[0], "PY": place[1], "PZ": place[2], "KM": signed * ratio}
        values["CT"] = 6.5 * parts.thrust[i] / strongest
        rows += [(f"CA_ROTOR{i}_{k}", float(v), 9) for k, v in values.items()]
    limit = vehicle.rotor_speed_limits_rad_s
    if limit:
        full = float((parts.thrust * limit[1] ** 2).sum())
        rows.append(("THR_MDL_FAC", 1.0, 9))
        rows.append(("MPC_THR_HOVER", min(max(vehicle.mass_kg * vehicle.gravity_m_s2 / full, 0.1), 0.8), 9))
    else:
        left.append("hover thrust: rotor_speed_limits_rad_s is not stated")
    comments = [f"# {vehicle.name}, exported by rotorid", *(f"# Not expressed: {s}" for s in left)]
    lines = [f"1\t1\t{name}\t{value:d}\t{kind}" if kind == 6 else f"1\t1\t{name}\t{value:.9g}\t{kind}"
             for name, value, kind in rows]  # fmt: skip
    return Exported("\n".join([*comments, *lines]) + "\n", "vehicle.params", tuple(left))


FORMS: dict[str, Callable[[Vehicle], Exported]] = {"rotorpy": rotorpy, "mjcf": mjcf, "px4": px4}


def export_vehicle(vehicle: Vehicle, to: str) -> Exported:
    """The vehicle for another tool; InputError names the forms there are."""
    if to not in FORMS:
        near = get_close_matches(to, list(FORMS), 1)
        meant = f"; did you mean {near[0]}?" if near else f", expected one of {', '.join(FORMS)}"
        raise InputError(f"no form is called {to!r}{meant}")
    if vehicle.kind == "bench" or vehicle.mass_kg is None or vehicle.inertia_kg_m2 is None:
        raise InputError(f"vehicle {vehicle.name}: only a vehicle with mass, inertia and rotors can be exported")
    return FORMS[to](vehicle)
