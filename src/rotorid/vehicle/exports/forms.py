"""A vehicle as RotorPy parameters, as models of MuJoCo, Gazebo and gym-pybullet-drones, and as PX4 parameters.

Those tools have the body forward-left-up: y and z of places change sign, and a rotor that turns counter-clockwise seen
from above pushes the airframe about minus z.

Whether a vehicle may be delivered is asked elsewhere (`rotorid.mismatch.deliver.usable`, with room for the error of an
estimate). A tool that wants more takes nothing from the vehicle: its file is not written, and a sentence says why.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import numpy as np

from rotorid.errors import InputError
from rotorid.io.text.wording import listed, printable
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.derivatives import (
    MUJOCO_FILE,
    ROTORPY_FILE,
    expressed_by,
    gazebo_damping,
    left_of,
    left_of_gazebo,
    mujoco_companion,
    rotorpy_companion,
)
from rotorid.vehicle.mixer import hover_speed_rad_s

_FOUR_ROTORS = {"rotorpy": "RotorPy", "gym-pybullet-drones": "gym-pybullet-drones", "crazyflow": "crazyflow"}
"""Forms of tools that fly four rotors and no other number."""
_EXACT_BODIES = {"mjcf": "MuJoCo", "sdf": "Gazebo"}
"""Forms of tools that take no inertia with a principal moment above the sum of the others, by however little."""
FLU = np.array([1.0, -1.0, -1.0])
_LINE = "\n"
_MOVED_CENTRES = ("moment", "moment and lever arm", "moment and lever arm, in space")
"""Forms of `com_offset` whose moment is that of rotors which sit elsewhere."""
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
    rotor_order: tuple[int, ...] = ()
    """gym-pybullet-drones only: which of our rotors, from 0, its links 0 to 3 are."""
    mirrored: bool = False
    """gym-pybullet-drones only: the rotors turn as in its DroneModel.RACE."""
    companions: dict[str, str] = field(default_factory=dict)
    """Further files, to each name its text, that stand next to the file."""


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
    limits_rad_s: tuple[float, float] | None = None
    """Lowest and highest rotor speed, with what saturates them."""
    tau_s: tuple[float, float] = (0.0, 0.0)
    """Time constants of the rotor speed, up and down; near hover those of the thrust, too."""
    drag: tuple[float, float] = (0.0, 0.0)
    """Rotor drag k_d along x and y, N s2/(rad m)."""
    inflow: float = 0.0
    lift: float = 0.0
    flap: float = 0.0
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damping: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of turning about each axis, N m s/rad."""
    curve: float = 0.0
    """Linear share b of T/T_max = b u + (1 − b) u²."""
    left_out: tuple[str, ...] = ()


KNOWS = {
    form: frozenset(ids.split())
    for form, ids in {
        "rotorpy": "rotor_drag axial_inflow translational_lift flapping_moment frame_drag motor_lag com_offset "
        "inertia_products command_saturation derivatives",
        "mjcf": "motor_lag com_offset inertia_products command_saturation derivatives each_thrust each_torque",
        "sdf": "rotor_drag motor_lag com_offset inertia_products command_saturation derivatives each_thrust "
        "each_torque",
        "gym-pybullet-drones": "rotor_drag com_offset command_saturation",
        "crazyflow": "rotor_drag com_offset motor_lag inertia_products command_saturation each_thrust each_torque",
        "px4": "com_offset throttle_curve each_thrust each_torque",
        "px4-sih": "rotor_drag rotational_damping motor_lag inertia_products command_saturation derivatives",
        "ardupilot-json": "rotor_drag frame_drag rotational_damping com_offset command_saturation throttle_curve "
        "derivatives each_torque",
    }.items()
}
"""By form, ids of the effects that it has a place for; `each_thrust`, `each_torque` where it has coefficients of each
rotor; `derivatives` where it says itself what it takes of them. `inertia_products` are the vehicle's own, too."""
_DRAG_AT_CENTRE = ("gym-pybullet-drones", "crazyflow")
"""Forms whose rotor drag acts at the centre of mass."""
_GRAVITY_M_S2 = {"rotorpy": 9.81, "crazyflow": 9.81}
"""Of tools that have their own, which no file changes and no caller of theirs sets."""


def in_entries(matrix: np.ndarray, names: tuple[str, ...] = ("xx", "yy", "zz", "xy", "xz", "yz")) -> dict[str, float]:
    """A symmetric matrix (3, 3) by the names of its entries."""
    return {name: float(matrix["xyz".index(name[0]), "xyz".index(name[1])]) for name in names}


def not_expressed(left: Iterable[str]) -> list[str]:
    """What a file does not express, as comments behind a hash."""
    return [f"# Not expressed: {sentence}" for sentence in left]


def for_qgroundcontrol(values: Mapping[str, float]) -> list[str]:
    """Lines of parameters as QGroundControl loads them: a whole number's kind is 6, another one's 9."""
    return [
        f"1\t1\t{name}\t{value:d}\t6" if isinstance(value, int) else f"1\t1\t{name}\t{float(value):.9g}\t9"
        for name, value in values.items()
    ]


def in_corners(places: np.ndarray, corners: Sequence[tuple[int, int]]) -> list[int] | None:
    """Which rotor, by its place (n, 3), is in each corner (signs of x and y); None where they are not in X shape."""
    there = {(int(np.sign(x)), int(np.sign(y))): i for i, (x, y, _) in enumerate(places)}
    return [there[corner] for corner in corners] if set(there) == set(corners) else None


def named_in_one_line(vehicle: Vehicle) -> Vehicle:
    """The vehicle with a name that ends no comment: text of a file is never a line of another."""
    return vehicle.model_copy(update={"name": printable(" ".join(vehicle.name.split()))})


def expressed(vehicle: Vehicle, to: str) -> Vehicle:
    """What the file of a form holds of a vehicle, as a vehicle that our simulator flies.

    The lag of the motors is left to who flies it: each tool has its own.
    """
    parts = parts_of(vehicle, KNOWS[to])
    at = "at the centre of mass" if to in _DRAG_AT_CENTRE else "at the hubs"
    held = (
        ("rotor_drag", at, {"k_d": parts.drag[0]}),
        ("axial_inflow", "at the hubs", {"k_z": parts.inflow}),
        ("translational_lift", "at the hubs", {"k_h": parts.lift}),
        ("flapping_moment", "at the hubs", {"k_flap": parts.flap}),
        ("frame_drag", "per axis", dict(zip(("c_x", "c_y", "c_z"), parts.frame, strict=True))),
    )
    places = [dict(zip(("x_m", "y_m", "z_m"), place, strict=True)) for place in parts.places.tolist()]
    return vehicle.model_copy(
        update={
            "inertia_kg_m2": vehicle.inertia_kg_m2.model_copy(update=in_entries(parts.inertia)),
            "rotors": tuple(r.model_copy(update=p) for r, p in zip(vehicle.rotors, places, strict=True)),
            "thrust_coefficient_n_s2": tuple(parts.thrust.tolist()),
            "torque_coefficient_n_m_s2": tuple(parts.torque.tolist()),
            "gravity_m_s2": _GRAVITY_M_S2.get(to, vehicle.gravity_m_s2),
            "rotor_speed_limits_rad_s": parts.limits_rad_s,
            "effects": tuple({"id": i, "form": f, "parameters": p} for i, f, p in held if any(p.values())),
            "derivatives": expressed_by(vehicle, to),
        }
    )


def parts_of(vehicle: Vehicle, knows: frozenset[str]) -> Parts:
    """What a form that `knows` these effects can take of a vehicle; the rest goes to `left_out`."""
    values: dict = {
        "limits_rad_s": vehicle.rotor_speed_limits_rad_s,
        "inertia": vehicle.inertia_kg_m2.matrix(),
        "places": vehicle.rotor_positions_m(),
        "thrust": vehicle.thrust_coefficients_n_s2(),
        "torque": vehicle.torque_coefficients_n_m_s2(),
    }
    left = []
    for name in ("thrust", "torque"):
        own = values[name]
        if f"each_{name}" not in knows and np.ptp(own) > 0:
            shown = ", ".join(f"{v:.4g}" for v in own)
            left.append(f"{name} coefficients differ between rotors ({shown}): their mean is taken")
            values[name] = np.full(len(own), own.mean())
    diagonal = np.diag(np.diag(values["inertia"]))
    if "inertia_products" not in knows and np.any(products := values["inertia"] - diagonal):
        shown = ", ".join(f"J_{k} = {v:.4g}" for k, v in in_entries(products, ("xy", "xz", "yz")).items())
        left.append(f"products of inertia ({shown})")
        values["inertia"] = diagonal
    for entry in vehicle.effects:
        name, form, p = entry["id"], entry.get("form", ""), {k: float(v) for k, v in entry["parameters"].items()}
        said = printable(f"{name} ({form}: {', '.join(f'{k} = {v:.4g}' for k, v in p.items())})")
        taken = name in knows and _take(values, name, form, p)
        if not taken:
            left.append(said)
        elif isinstance(taken, str):
            left.append(f"{said}: {taken}")
    if "derivatives" not in knows:
        left += left_of(vehicle, ())
    return Parts(vehicle.mass_kg, left_out=tuple(left), **values)


_BY_HUB = {
    "axial_inflow": ("inflow", "k_z"),
    "translational_lift": ("lift", "k_h"),
    "flapping_moment": ("flap", "k_flap"),
}
"""Effects with a constant of each hub, their part and the constant."""
_BY_AXIS = {
    **{("frame_drag", form): "frame" for form in ("isotropic", "per axis")},
    **{("rotational_damping", form): "damping" for form in ("one constant", "linear")},
}
"""Effects and forms with a constant for each axis, or one for all, and their part."""


def _take(values: dict, name: str, form: str, p: dict[str, float]) -> bool | str:
    """Put an effect into the parts; False where its form has no place there, a remark where it fits only nearly."""
    at_hubs = True if form == "at the hubs" else "taken at the hubs in place of the centre of mass"
    if name == "rotor_drag" and "k_d" in p:
        values["drag"] = (p["k_d"], p["k_d"])
        return at_hubs
    if name in _BY_HUB and _BY_HUB[name][1] in p and (at_hubs is True or name != "flapping_moment"):
        part, constant = _BY_HUB[name]
        values[part] = p[constant]
        return at_hubs
    if (name, form) in _BY_AXIS:
        values[_BY_AXIS[name, form]] = (p["c"],) * 3 if "c" in p else (p["c_x"], p["c_y"], p["c_z"])
        return True
    if name == "motor_lag" and form in ("one constant", "up and down", "on thrust"):
        values["tau_s"] = (p["tau"], p["tau"]) if "tau" in p else (p["tau_up"], p["tau_down"])
        same = "taken as a lag of the rotor speed, which near hover has the same time constant"
        return same if form == "on thrust" else True
    if name == "command_saturation" and values["limits_rad_s"] is not None:
        low, high = values["limits_rad_s"]
        if form == "upper limit":
            values["limits_rad_s"] = (low, min(high, p["w_high"] * high))
        else:
            values["limits_rad_s"] = (max(low, p["w_low"] * high), high)
        return True
    if name == "throttle_curve" and form == "thrust curve of the throttle" and 0 <= p["b"] <= 1:
        values["curve"] = p["b"]
        return True
    if name == "com_offset" and form in _MOVED_CENTRES:
        values["places"] = values["places"] - np.array([p["r_x"], p["r_y"], 0.0])
        arm = "" if form == "moment" else "; the accelerometer stays where it was"
        return f"taken as rotors that sit elsewhere, so that their drag acts there, too{arm}"
    if name == "inertia_products":
        xy, xz, yz = (p.get(key, 0.0) for key in ("J_xy", "J_xz", "J_yz"))
        values["inertia"] = values["inertia"] + np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
        return True
    return False


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{v:.9g}" for v in values)


def _comments(left: Iterable[str]) -> str:
    """What a file does not express, as comments of XML."""
    return "".join(f"  <!-- Not expressed: {re.sub('-(?=-)', '- ', s)} -->\n" for s in left)


def _in_flu(inertia: np.ndarray) -> np.ndarray:
    return inertia * np.outer(FLU, FLU)


def _companion(vehicle: Vehicle, to: str, name: str, text_of: Callable[[Vehicle], str]) -> tuple[str, dict[str, str]]:
    """What is said of a tool's companion with the derivatives, and its name and text; nothing without any."""
    if not vehicle.derivatives:
        return "", {}
    said = f"derivatives: this file has none, {name} next to it adds them in the tool's own step"
    return said, {name: text_of(expressed(vehicle, to))}


def rotorpy(vehicle: Vehicle) -> Exported:
    """RotorPy's `quad_params` as a Python file."""
    parts = parts_of(vehicle, KNOWS["rotorpy"])
    added, companions = _companion(vehicle, "rotorpy", ROTORPY_FILE, rotorpy_companion)
    left = [*parts.left_out, *([added] if added else [])]
    up, down = parts.tau_s
    if up != down:
        left.append(f"motor_lag: {up:.4g} s up and {down:.4g} s down: the mean is taken")
    if up == 0:
        left.append(f"rotors that follow at once: RotorPy needs a lag, {AT_ONCE_S:g} s is taken")
    if vehicle.gravity_m_s2 != _GRAVITY_M_S2["rotorpy"]:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: RotorPy has {_GRAVITY_M_S2['rotorpy']:g}")
    if any(vehicle.accelerometer_position_m):
        left.append(
            "place of the accelerometer: RotorPy reads rI nowhere, give it to its Imu: Imu(p_BS=quad_params['rI'])"
        )
    entries = in_entries(_in_flu(parts.inertia), ("xx", "yy", "zz", "xy", "yz", "xz"))
    hover = hover_speed_rad_s(expressed(vehicle, "rotorpy"))
    low, high = parts.limits_rad_s or (0.0, 10 * hover)
    values = {
        "mass": parts.mass_kg,
        **{f"I{name}": value for name, value in entries.items()},
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
    # As Python writes a text: whatever is in the name, it stays one.
    lines = [repr(f"{vehicle.name}, exported by rotorid for RotorPy (body forward-left-up, SI units)."), ""]
    lines += ["import numpy as np", "", *not_expressed(left), "quad_params = {"]
    for key, value in values.items():
        if key == "rotor_pos":
            lines.append('    "rotor_pos": {')
            lines += [f'        "{name}": np.array({place!r}),' for name, place in value.items()]
            lines.append("    },")
        else:
            shown = f"np.array({value!r})" if isinstance(value, list) else repr(value)
            note = "  # read by nothing in RotorPy 3.0.0: Imu(p_BS=quad_params['rI'])" if key == "rI" else ""
            lines.append(f'    "{key}": {shown},{note}')
    lines += [
        "}",
        "# Without a state RotorPy 3.0.0 starts every vehicle at 1788.53 rad/s: Multirotor(quad_params, initial_state)",
        "# starts this one at its hover's speed.",
        "initial_state = {",
        '    "x": np.zeros(3), "v": np.zeros(3), "q": np.array([0.0, 0.0, 0.0, 1.0]), "w": np.zeros(3),',
        f'    "wind": np.zeros(3), "rotor_speeds": np.full({vehicle.rotor_count}, {float(hover)!r}),',
        "}",
        "",
    ]
    arrays = {k: np.array(v) if isinstance(v, list) else v for k, v in values.items()}
    arrays["rotor_pos"] = {k: np.array(v) for k, v in values["rotor_pos"].items()}
    return Exported("\n".join(lines), "rotorpy_params.py", tuple(left), arrays, companions=companions)


def mjcf(vehicle: Vehicle) -> Exported:
    """A MuJoCo model: a free body, a site and a motor a rotor; control i is the thrust of rotor i, N.

    The thrust of a rotor speed ω is C_F ω²; the torque goes along by the motor's gear. A lag is the actuator's own
    (`dyntype="filterexact"`), of the thrust; `data.act` is then the thrust to start with.
    """
    parts = parts_of(vehicle, KNOWS["mjcf"])
    left = list(parts.left_out)
    tau_s, lag = sum(parts.tau_s) / 2, next((e for e in vehicle.effects if e["id"] == "motor_lag"), None)
    if tau_s > 0:
        if lag["form"] == "on thrust":  # what it has is just that
            left = [sentence for sentence in left if not sentence.startswith("motor_lag")]
        else:
            left.append(f"motor_lag: a lag of the rotor speed is taken as one of the thrust, {tau_s:.4g} s")
    added, companions = _companion(vehicle, "mjcf", MUJOCO_FILE, mujoco_companion)
    left += [added] if added else []
    full, limit = _numbers(in_entries(_in_flu(parts.inertia)).values()), parts.limits_rad_s
    dynamics = f' dyntype="filterexact" dynprm="{tau_s:.9g}"' if tau_s > 0 else ""
    sites, motors = [], []
    for i, (place, signed) in enumerate(zip(parts.places, vehicle.yaw_signs(), strict=True), 1):
        at = _numbers(place * FLU)
        ratio = -signed * parts.torque[i - 1] / parts.thrust[i - 1]
        ends = _numbers(parts.thrust[i - 1] * speed**2 for speed in limit) if limit else ""
        most = f' ctrlrange="{ends}"' if limit else ""
        sites.append(f'      <site name="rotor_{i}" pos="{at}"/>')
        motors.append(f'    <general name="rotor_{i}" site="rotor_{i}" gear="0 0 1 0 0 {ratio:.9g}"{most}{dynamics}/>')
    c_f, said = ", ".join(f"{v:.6g}" for v in parts.thrust), _comments(left)
    late = "\n  <!-- Thrust follows its control late: set data.act to the first thrust. -->" if tau_s > 0 else ""
    text = f"""<mujoco model={quoteattr(vehicle.name)}>
  <!-- Flies in MuJoCo and, unchanged, in MJX. -->
{said}  <!-- Control i is the thrust of rotor i in N: C_F times the square of its speed, C_F = {c_f} N s2. -->{late}
  <option timestep="0.001" gravity="0 0 -{vehicle.gravity_m_s2:g}" integrator="RK4"/>
  <worldbody>
    <body name="vehicle" pos="0 0 1">
      <freejoint/>
      <inertial pos="0 0 0" mass="{parts.mass_kg:.9g}" fullinertia="{full}"/>
      <geom type="box" size="0.02 0.02 0.01" contype="0" conaffinity="0" mass="0"/>
{_LINE.join(sites)}
    </body>
  </worldbody>
  <actuator>
{_LINE.join(motors)}
  </actuator>
</mujoco>
"""
    return Exported(text, "vehicle.xml", tuple(left), companions=companions)


def allocated(parts: Parts, yaw_signs: np.ndarray) -> list[tuple[str, float]]:
    """Places, torques and thrusts of the rotors as parameters of PX4's control allocation."""
    rows, strongest = [], parts.thrust.max()
    for i, (place, signed) in enumerate(zip(parts.places, yaw_signs, strict=True)):
        values = (*place, signed * (parts.torque[i] / parts.thrust[i]), 6.5 * parts.thrust[i] / strongest)
        names = (f"CA_ROTOR{i}_{key}" for key in ("PX", "PY", "PZ", "KM", "CT"))
        rows += zip(names, map(float, values), strict=True)
    return rows


def px4(vehicle: Vehicle) -> Exported:
    """Parameters of PX4's control allocation and thrust model, as QGroundControl loads them."""
    parts = parts_of(vehicle, KNOWS["px4"])
    left = [*parts.left_out, "mass and inertia: they are parameters of PX4's own simulator alone (--to px4-sih)"]
    values = {"CA_AIRFRAME": 0, "CA_ROTOR_COUNT": vehicle.rotor_count, **dict(allocated(parts, vehicle.yaw_signs()))}
    limit = parts.limits_rad_s
    if limit or parts.curve:
        values["THR_MDL_FAC"] = 1.0 - parts.curve
    if limit:
        full = float((parts.thrust * limit[1] ** 2).sum())
        values["MPC_THR_HOVER"] = min(max(vehicle.mass_kg * vehicle.gravity_m_s2 / full, 0.1), 0.8)
    else:
        left.append("hover thrust: rotor_speed_limits_rad_s is not stated")
    lines = [f"# {vehicle.name}, exported by rotorid", *not_expressed(left), *for_qgroundcontrol(values)]
    return Exported("\n".join(lines) + "\n", "vehicle.params", tuple(left))


def left_of_the_lowest_speed(parts: Parts) -> list[str]:
    """A sentence for tools that know no lowest rotor speed."""
    low = 0.0 if parts.limits_rad_s is None else parts.limits_rad_s[0]
    return [f"lowest rotor speed of {low:.4g} rad/s: rotors may stand still there"] if low > 0 else []


def sdf(vehicle: Vehicle) -> Exported:
    """A Gazebo model: a body with a link and a joint a rotor, each driven by Gazebo's multicopter motor model.

    That model has thrust C_F ω², torque momentConstant times thrust, a lag up and down, and a drag of the hub
    −rotorDragCoefficient |ω| v⊥. Rotor speeds are commanded in rad/s on `command/motor_speed`. Source: gz-sim,
    `src/systems/multicopter_motor_model`; the models of PX4's x500.
    """
    parts = parts_of(vehicle, KNOWS["sdf"])
    left = [*parts.left_out, *left_of_gazebo(vehicle), *left_of_the_lowest_speed(parts)]
    up, down = parts.tau_s
    if up == 0:
        left.append(f"rotors that follow at once: Gazebo's motor model needs a lag, {AT_ONCE_S:g} s is taken")
    if vehicle.gravity_m_s2 != 9.81:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: it belongs to Gazebo's world file")
    most = (parts.limits_rad_s or (0.0, 10 * hover_speed_rad_s(vehicle)))[1]
    share = min(1e-3 * parts.mass_kg, 0.005)
    radius = vehicle.rotor_radius_m or 0.05
    links, motors = [], []
    for i, (place, signed) in enumerate(zip(parts.places, vehicle.yaw_signs(), strict=True)):
        at = _numbers(place * FLU)
        # A light rotor of its own: its mass is taken off the body's; its inertia is small enough to do nothing.
        spin = 1e-7
        links.append(f"""    <link name="rotor_{i}">
      <pose>{at} 0 0 0</pose>
      <inertial><mass>{share:.9g}</mass>
        <inertia><ixx>{spin}</ixx><iyy>{spin}</iyy><izz>{spin}</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>
      </inertial>
      <visual name="disc">
        <geometry><cylinder><radius>{radius:.6g}</radius><length>0.002</length></cylinder></geometry>
      </visual>
    </link>
    <joint name="rotor_{i}_joint" type="revolute">
      <parent>base_link</parent><child>rotor_{i}</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit></axis>
    </joint>""")
        motors.append(f"""    <plugin filename="gz-sim-multicopter-motor-model-system"
            name="gz::sim::systems::MulticopterMotorModel">
      <jointName>rotor_{i}_joint</jointName>
      <linkName>rotor_{i}</linkName>
      <turningDirection>{"ccw" if signed > 0 else "cw"}</turningDirection>
      <timeConstantUp>{up or AT_ONCE_S:.9g}</timeConstantUp>
      <timeConstantDown>{down or AT_ONCE_S:.9g}</timeConstantDown>
      <maxRotVelocity>{most:.9g}</maxRotVelocity>
      <motorConstant>{parts.thrust[i]:.9g}</motorConstant>
      <momentConstant>{parts.torque[i] / parts.thrust[i]:.9g}</momentConstant>
      <commandSubTopic>command/motor_speed</commandSubTopic>
      <motorNumber>{i}</motorNumber>
      <rotorDragCoefficient>{parts.drag[0]:.9g}</rotorDragCoefficient>
      <rollingMomentCoefficient>0</rollingMomentCoefficient>
      <rotorVelocitySlowdownSim>10</rotorVelocitySlowdownSim>
      <motorType>velocity</motorType>
    </plugin>""")
    # What the rotors' links carry must not be counted twice.
    body = parts.mass_kg - share * len(parts.places)
    off = -share * (parts.places * FLU).sum(0) / body
    spread = np.zeros((3, 3))
    for place, m in [*((p * FLU, share) for p in parts.places), (off, body)]:
        spread += m * (place @ place * np.eye(3) - np.outer(place, place))
    own = _in_flu(parts.inertia) - spread - 1e-7 * len(parts.places) * np.eye(3)
    inertia = "".join(f"<i{name}>{value:.9g}</i{name}>" for name, value in in_entries(own).items())
    text = f"""<?xml version="1.0"?>
<sdf version="1.9">
{_comments(left)}  <model name={quoteattr(vehicle.name)}>
    <pose>0 0 0.3 0 0 0</pose>
    <link name="base_link">
      <inertial>
        <pose>{off[0]:.9g} {off[1]:.9g} {off[2]:.9g} 0 0 0</pose>
        <mass>{body:.9g}</mass>
        <inertia>{inertia}</inertia>
      </inertial>
      <collision name="body"><geometry><box><size>0.1 0.1 0.04</size></box></geometry></collision>
      <visual name="body"><geometry><box><size>0.1 0.1 0.04</size></box></geometry></visual>
    </link>
{_LINE.join(links)}
{_LINE.join(motors)}{gazebo_damping(vehicle)}
  </model>
</sdf>
"""
    return Exported(text, "model.sdf", tuple(left))


def _gym_pybullet_drones(vehicle: Vehicle) -> Exported:
    """The URDF of gym-pybullet-drones: its `properties` hold what its physics is made of, links 0 to 3 are the rotors.

    It has the thrust kf n² and the yaw torque km n² (n in turns a minute) with the senses −, +, −, + of rotors 0 to 3
    about z up, a ground effect, and a drag by the sum of rotor speeds at the centre. Source: gym-pybullet-drones,
    `BaseAviary._parseURDFParameters`, `_physics`, `_drag`, `_groundEffect`, and `cf2x.urdf`.
    """
    parts = parts_of(vehicle, KNOWS["gym-pybullet-drones"])
    left = [*parts.left_out, *left_of_the_lowest_speed(parts)]
    if parts.drag[0]:
        left.append("rotor drag at the hubs: it acts at the centre of mass there, and with Physics.PYB_DRAG alone")
    # Front left, rear left, rear right, front right. The yaw torque there is (−z0 + z1 − z2 + z3) about z up: 0 and 2
    # turn counter-clockwise; of `RACE` clockwise.
    order = in_corners(parts.places, ((1, -1), (-1, -1), (-1, 1), (1, 1)))
    if order is None:
        raise InputError(f"{vehicle.name}: gym-pybullet-drones wants four rotors in X shape")
    senses = [int(vehicle.yaw_signs()[i]) for i in order]
    if senses not in ([1, -1, 1, -1], [-1, 1, -1, 1]):
        raise InputError(f"{vehicle.name}: gym-pybullet-drones wants rotors whose senses alternate around the vehicle")
    turned = senses[0] < 0
    left.append(f"order of the rotors: its links 0 to 3 are rotors {', '.join(str(i + 1) for i in order)} here")
    if turned:
        left.append("senses of the rotors: they are those of its DroneModel.RACE, not CF2X; choose that one")
    left += [
        f"gravity of {vehicle.gravity_m_s2:g} m/s²: it has 9.8",
        "air without friction: it leaves on Bullet's damping, a deceleration of 0.04 (1 + |v|) v and so for turning",
    ]
    limit = (parts.limits_rad_s or (0.0, 2 * hover_speed_rad_s(vehicle)))[1]
    lift = float(parts.thrust.sum() * limit**2 / (parts.mass_kg * vehicle.gravity_m_s2))
    # kf and km are by the square of turns a minute, the drag by the sum of rad/s.
    per_rpm = (2 * np.pi / 60) ** 2
    arm = float(np.linalg.norm(parts.places[:, :2], axis=1).mean())
    properties = {
        "arm": arm,
        "kf": float(parts.thrust.mean()) * per_rpm,
        "km": float(parts.torque.mean()) * per_rpm,
        "thrust2weight": lift,
        "max_speed_kmh": 100.0,
        "gnd_eff_coeff": 0.0,
        "prop_radius": vehicle.rotor_radius_m or arm / 2,
        "drag_coeff_xy": parts.drag[0],
        "drag_coeff_z": 0.0,
        "dw_coeff_1": 0.0,
        "dw_coeff_2": 0.0,
        "dw_coeff_3": 0.0,
    }
    shown = " ".join(f'{k}="{v:.9g}"' for k, v in properties.items())
    links = []
    for k, i in enumerate(order):
        at = _numbers(parts.places[i] * FLU)
        links.append(f"""  <link name="prop{k}_link">
    <inertial><origin rpy="0 0 0" xyz="{at}"/><mass value="0.0"/>
      <inertia ixx="0.0" ixy="0.0" ixz="0.0" iyy="0.0" iyz="0.0" izz="0.0"/></inertial>
  </link>
  <joint name="prop{k}_joint" type="fixed"><parent link="base_link"/><child link="prop{k}_link"/></joint>""")
    j = parts.inertia
    text = f"""<?xml version="1.0" ?>
<robot name={quoteattr(vehicle.name)}>
{_comments(left)}  <properties {shown}/>
  <link name="base_link">
    <inertial><origin rpy="0 0 0" xyz="0 0 0"/><mass value="{parts.mass_kg:.9g}"/>
      <inertia ixx="{j[0, 0]:.9g}" ixy="0.0" ixz="0.0" iyy="{j[1, 1]:.9g}" iyz="0.0" izz="{j[2, 2]:.9g}"/></inertial>
    <visual><origin rpy="0 0 0" xyz="0 0 0"/><geometry><cylinder radius="{arm:.6g}" length="0.03"/></geometry></visual>
    <collision><origin rpy="0 0 0" xyz="0 0 0"/>
      <geometry><cylinder radius="{arm:.6g}" length="0.03"/></geometry></collision>
  </link>
{_LINE.join(links)}
  <link name="center_of_mass_link">
    <inertial><origin rpy="0 0 0" xyz="0 0 0"/><mass value="0.0"/>
      <inertia ixx="0.0" ixy="0.0" ixz="0.0" iyy="0.0" iyz="0.0" izz="0.0"/></inertial>
  </link>
  <joint name="center_of_mass_joint" type="fixed"><parent link="base_link"/><child link="center_of_mass_link"/></joint>
</robot>
"""
    return Exported(text, "vehicle.urdf", tuple(left), rotor_order=tuple(order), mirrored=turned)


FORMS: dict[str, Callable[[Vehicle], Exported]] = {
    "rotorpy": rotorpy,
    "mjcf": mjcf,
    "sdf": sdf,
    "gym-pybullet-drones": _gym_pybullet_drones,
    "px4": px4,
}


def refusal(to: str, rotor_count: int, inertia_kg_m2: np.ndarray) -> str:
    """Why the tool of a form does not take a vehicle with this inertia (3, 3); no full stop, empty where it does."""
    if to in _FOUR_ROTORS and rotor_count != 4:
        return f"{_FOUR_ROTORS[to]} knows four rotors, found {rotor_count}"
    principal = np.linalg.eigvalsh(inertia_kg_m2)
    if to in _EXACT_BODIES and (principal[0] <= 0 or principal[2] > (principal[0] + principal[1]) * (1 + 1e-9)):
        shown = listed([f"{moment:.5g}" for moment in principal])
        return (
            f"{_EXACT_BODIES[to]} takes no principal moment of inertia above the sum of the others, found {shown} kg m2"
        )
    return ""
