"""Families of flights by differential equations, and a set of one of them from one seed."""

from dataclasses import dataclass, field, replace

import numpy as np

from ..residuals import CUTOFF_HZ, residuals, rms
from ..write import Recording, plain
from . import craft as crafts
from .craft import GRAVITY, Craft
from .equations import RHO, Nature, Strayed, solve, turn_matrix
from .instruments import FINE_HZ, Kit, record
from .paths import STYLES, path
from .rotor import coefficients, pitch_for

SMALL = 0.25
"""Below this rms over the noise (in the channel where it is largest) a cause need not be found."""
POSE = ("position", "velocity", "attitude", "rates", "force")


@dataclass
class Sheet:
    """A case while it is drawn."""

    craft: Craft
    rng: np.random.Generator
    nature: Nature = field(default_factory=Nature)
    kit: dict = field(default_factory=dict)
    effects: list = field(default_factory=list)
    outside: list = field(default_factory=list)
    wrong: dict = field(default_factory=dict)
    edits: list = field(default_factory=list)
    fair: list = field(default_factory=list)
    why: str = ""
    styles: tuple = STYLES
    needs: tuple = ()  # columns: speed, command, battery
    log: bool = True  # whether an autopilot's log can be asked for it
    least_hz: int = 25

    def size(self, low, high):
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def way(self, n=2):
        d = self.rng.standard_normal(n)
        return d / np.linalg.norm(d)

    def adds(self, id, *parameters, form="", equivalent=()):
        """Name an effect that is to be found."""
        listed = [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters]
        self.effects.append({"id": id, "form": form, "parameters": listed, "equivalent": list(equivalent)})


def clean(s: Sheet):
    pass


def wrong(s: Sheet):
    names = ["mass_kg", "torque_coefficient_n_m_s2", "inertia_xx_kg_m2", "inertia_yy_kg_m2", "inertia_zz_kg_m2"]
    for name in s.rng.choice([*names, "thrust_coefficient_n_s2"], int(s.rng.integers(1, 3)), replace=False):
        s.wrong[str(name)] = 1 + float(s.rng.choice([-1, 1])) * s.size(0.02, 0.1)
    if "mass_kg" in s.wrong:
        s.wrong.pop("thrust_coefficient_n_s2", None)


def blades(s: Sheet):
    """Rotors by blade elements: drag in the disc, thrust lost in a climb and gained in forward flight."""
    s.nature.blades = 1.0
    for id in ("rotor_drag", "axial_inflow", "translational_lift"):
        s.adds(id, form="blade")
    s.fair, s.why = ["rotational_damping", "frame_drag"], "inflow at the hubs damps rolling; drag in the disc is curved"
    s.styles, s.log = ("sprint", "bob", "sprint", "survey"), False


def frame(s: Sheet):
    s.nature.axiswise = float(s.rng.random() < 0.5)
    base = s.size(0.15, 1.0) * 0.12 * s.craft.arm**2
    s.nature.area = base * np.array([1.0, s.rng.uniform(1.0, 1.3), s.rng.uniform(1.3, 2.5)])
    s.adds("frame_drag", *((f"CdA_{a}", v, "m2") for a, v in zip("xyz", s.nature.area, strict=True)))
    s.styles = ("sprint", "survey", "sprint", "bob")


def blown(s: Sheet):
    frame(s)
    w = s.size(1.0, 6.0) * (0.4 if s.craft.name == "micro" else 1.0) * s.way()
    s.nature.wind = np.array([w[0], w[1], 0.0])
    s.adds("steady_wind", ("w_north", w[0], "m/s"), ("w_east", w[1], "m/s"))
    s.styles = ("spin", "sprint", "spin", "survey")


def flapping(s: Sheet):
    k = s.size(0.3, 2.0) * 0.03 * s.craft.mass * GRAVITY * s.craft.arm / (s.craft.n * s.craft.hover * 5)
    s.nature.hub_moment = k
    s.adds("flapping_moment", ("k_f", k, "N m/(rad/s m/s)"))
    s.styles = ("sprint", "survey", "sprint", "stir")


def damping(s: Sheet):
    s.nature.damping = s.size(0.5, 3.0) * np.diag(s.craft.inertia)
    s.adds("rotational_damping", *((f"c_{a}", v, "N m s") for a, v in zip("xyz", s.nature.damping, strict=True)))
    s.styles = ("stir", "spin", "stir", "survey")


def tilted(s: Sheet):
    s.nature.tilt = np.deg2rad(s.size(0.4, 3.0)) * s.way()
    s.adds("thrust_tilt", ("eps_x", s.nature.tilt[0], "rad"), ("eps_y", s.nature.tilt[1], "rad"))
    s.styles = ("spin", "stir", "survey", "spin")


def off_centre(s: Sheet):
    r = s.size(0.008, 0.08) * s.craft.arm * s.way()
    s.nature.centre = np.array([r[0], r[1], 0.0])
    s.adds("com_offset", ("r_x", r[0], "m"), ("r_y", r[1], "m"))
    s.fair, s.why = ["imu_lever_arm"], "the accelerometer stays where the centre of mass is believed"


def uneven(s: Sheet):
    n = s.craft.n
    d = s.size(0.015, 0.06) * s.rng.standard_normal(n)
    s.nature.gain = 1 + d - d.mean()
    s.adds("unequal_rotors", *((f"d_{i + 1}", v - 1, "-") for i, v in enumerate(s.nature.gain)))
    s.needs, s.log = ("speed",), False


def lagging(s: Sheet):
    s.nature.lag = s.size(0.02, 0.07)
    if s.rng.random() < 0.4:
        s.nature.second = 0.2 * s.nature.lag
        s.adds("motor_lag", form="blade")
        s.fair, s.why = ["delay"], "a second, shorter lag is a delay"
    else:
        s.adds("motor_lag", ("tau_up", s.nature.lag, "s"), ("tau_down", s.nature.lag, "s"))
    s.needs, s.least_hz = ("command",), 100


def sagging(s: Sheet):
    s.nature.sag = s.size(0.04, 0.2)
    s.adds("battery_sag", form="blade")
    s.needs = ("command", "battery")


def limited(s: Sheet):
    s.nature.limit = s.craft.hover * s.rng.uniform(1.06, 1.15)
    s.adds("command_saturation", ("w_max", s.nature.limit, "rad/s"))
    s.needs, s.styles, s.log = ("command", "speed"), ("bob", "survey", "bob", "stir"), False


def accelerometer(s: Sheet):
    form = str(s.rng.choice(["bias", "scale", "turn"]))
    if form == "bias":
        b = s.size(0.1, 0.8) * s.way(3)
        s.kit["force_bias"] = tuple(b)
        s.adds("accelerometer_error", *((f"b_{a}", v, "m/s2") for a, v in zip("xyz", b, strict=True)), form=form)
    elif form == "scale":
        k = s.size(0.01, 0.05) * s.rng.choice([-1, 1], 3)
        s.kit["force_scale"] = tuple(1 + k)
        s.adds("accelerometer_error", *((f"S_{a}{a}", v, "-") for a, v in zip("xyz", k, strict=True)), form=form)
    else:
        k = np.deg2rad(s.size(0.7, 4.0)) * s.way()
        s.kit["force_turn"] = (k[0], k[1], 0.0)
        s.adds("accelerometer_error", form=form)
    s.styles = ("spin", "stir", "survey", "spin")


def gyroscope(s: Sheet):
    if s.rng.random() < 0.5:
        b = s.size(0.01, 0.08) * s.way(3)
        s.kit["rate_bias"] = tuple(b)
        s.adds("gyro_error", *((f"b_{a}", v, "rad/s") for a, v in zip("xyz", b, strict=True)), form="bias")
    else:
        k = s.size(0.015, 0.06) * s.rng.choice([-1, 1], 3)
        s.kit["rate_scale"] = tuple(1 + k)
        s.adds("gyro_error", *((f"s_{a}", v, "-") for a, v in zip("xyz", k, strict=True)), form="scale")
    s.styles, s.log = ("stir", "spin", "stir", "survey"), False


def lever_arm(s: Sheet):
    r = s.size(0.1, 0.6) * s.craft.arm * s.way(3)
    s.kit["arm"] = tuple(r)
    s.adds("imu_lever_arm", *((f"r_{a}", v, "m") for a, v in zip("xyz", r, strict=True)))
    s.styles = ("stir", "spin", "stir", "survey")


def late(s: Sheet):
    seconds = s.size(0.015, 0.06)
    s.kit["late_s"] = seconds
    s.adds("delay", ("T_d", seconds, "s"))
    s.styles, s.least_hz, s.log = ("stir", "survey", "stir", "bob"), 200, False


def skewed(s: Sheet):
    s.kit["skew"] = float(s.rng.choice([-1, 1])) * s.size(1e-3, 6e-3)
    s.adds("clock_skew", ("skew", s.kit["skew"], "-"))
    s.styles, s.least_hz, s.log = ("stir", "survey", "stir", "bob"), 100, False


def mistaken(s: Sheet):
    what = str(s.rng.choice(["order", "spin", "sign", "unit"]))
    s.edits.append(what)
    id = {"order": "rotor_order", "spin": "spin_direction", "sign": "axis_sign", "unit": "unit_error"}[what]
    s.adds(id)
    s.styles, s.needs, s.log = ("stir", "survey", "spin", "stir"), ("speed",), False


def stuck(s: Sheet):
    """One column keeps its value, reads zero or is empty for a while."""
    s.edits.append(str(s.rng.choice(["hold", "zero", "gap"])))
    s.adds("sensor_dropout")
    s.styles, s.log, s.needs = ("stir", "survey", "spin", "stir"), False, ("speed",)


def pair(s: Sheet):
    """Two of the others, of flight and instrument."""
    first = [frame, flapping, off_centre, damping, tilted][s.rng.integers(5)]
    second = [accelerometer, gyroscope, uneven, lever_arm][s.rng.integers(4)]
    first(s)
    second(s)
    s.styles = ("sprint", "spin", "stir", "survey")


def sail(s: Sheet):
    """A canopy whose lift pitches the vehicle with the square of the airspeed: no id of the catalogue."""
    s.nature.sail = s.size(0.3, 2.0) * 0.0008 * s.craft.mass * GRAVITY * s.craft.arm
    s.outside.append({"id": "canopy", "acceptable": ["flapping_moment", "frame_drag"], "parameters": []})
    s.styles = ("sprint", "survey", "sprint", "spin")


def wake(s: Sheet):
    """Thrust overshoots until the wake has formed (Pitt and Peters): a lead that no id describes."""
    s.nature.wake, s.nature.wake_s = s.size(0.1, 0.5), s.rng.uniform(0.06, 0.2)
    acceptable = ["motor_lag", "delay", "rotor_acceleration_torque", "axial_inflow"]
    stated = (("share", s.nature.wake, "-"), ("memory", s.nature.wake_s, "s"))
    listed = [{"symbol": a, "value": v, "unit": u} for a, v, u in stated]
    s.outside.append({"id": "wake_memory", "acceptable": acceptable, "parameters": listed})
    s.styles, s.log = ("stir", "bob", "stir", "survey"), False


FAMILIES = {
    "clean": clean, "wrong": wrong, "blades": blades, "frame": frame, "blown": blown, "flapping": flapping,
    "damping": damping, "tilted": tilted, "off_centre": off_centre, "uneven": uneven, "lagging": lagging,
    "sagging": sagging, "limited": limited, "accelerometer": accelerometer, "gyroscope": gyroscope,
    "lever_arm": lever_arm, "late": late, "skewed": skewed, "mistaken": mistaken, "stuck": stuck, "pair": pair,
    "sail": sail, "wake": wake,
}  # fmt: skip


def drafted(family: str, seed: int) -> tuple[Sheet, Kit]:
    """What is hidden and with what it is recorded."""
    rng = np.random.default_rng([seed, 21])
    sheet = Sheet(crafts.drawn(rng), rng)
    FAMILIES[family](sheet)
    logged = sheet.log and rng.random() < 0.4
    noise = sheet.size(0.6, 1.6)
    if logged:
        groups = ("command", *POSE)
        kit = Kit(
            "log", 100, groups, 0.01 * noise, 0.05 * noise, 0.0, 0.004 * noise, 0.06 * noise, vibration=1.2 * noise
        )
        sheet.fair.append("vibration")
    else:
        command = "command" in sheet.needs or rng.random() < 0.15
        speed = not command or "speed" in sheet.needs or (sheet.nature.lag > 0 and rng.random() < 0.5)
        groups = (*(("speed",) if speed else ()), *(("command",) if command else ()), *POSE)
        rate = int(rng.choice([100, 200, 250, 500]))
        kit = Kit("capture", max(rate, sheet.least_hz), groups, 0.0005 * noise, 0.015 * noise, 0.0012 * noise,
                  0.008 * noise, 0.12 * noise, 0.003 * noise)  # fmt: skip
        if not command:
            kit = replace(kit, fraction=float(rng.uniform(-0.4, 0.4)))
    if "battery" in sheet.needs:
        kit = replace(kit, groups=(*kit.groups, "battery"))
    if family == "clean":
        kit = replace(kit, rate_hz=int(rng.choice([25, 50, 100] if logged else [25, 50, 100, 200, 500, 1000])))
    if logged and family != "clean" and sheet.nature.lag == 0 and rng.random() < 0.5:
        sheet.nature.lag = sheet.size(0.025, 0.06)
        sheet.adds("motor_lag", ("tau_up", sheet.nature.lag, "s"), ("tau_down", sheet.nature.lag, "s"))
        sheet.fair.append("delay")
    if "command" not in kit.groups and sheet.nature.lag == 0:
        sheet.nature.lag = sheet.craft.lag_s  # real motors, whose speeds are measured
    fixed = {k: v for k, v in sheet.kit.items() if k != "late_s"}
    if "late_s" in sheet.kit:
        fixed["fraction"] = sheet.kit["late_s"] * kit.rate_hz
    return sheet, replace(kit, **fixed)


def edited(table, sheet: Sheet, number: int, rng, kit: Kit):
    """What a mistaken logger did to a table; the same in every run but for dropouts, which are in one."""
    table = table.copy()
    same = np.random.default_rng(int(sheet.craft.mass * 1e9) % 2**32)
    n = sheet.craft.n
    for what in sheet.edits:
        if what == "order":
            i, j = same.choice(n, 2, replace=False) + 1
            a, b = f"rotor_speed_{i}_rad_s", f"rotor_speed_{j}_rad_s"
            table[[a, b]] = table[[b, a]].to_numpy()
        elif what == "sign":
            column = str(same.choice(["angular_velocity_x_rad_s", "specific_force_y_m_s2", "angular_velocity_z_rad_s"]))
            table[column] *= -1
        elif what == "unit":
            prefix, factor = (("rotor_speed", 60 / (2 * np.pi)), ("angular_velocity", 180 / np.pi),
                              ("specific_force", 1 / 9.80665))[same.integers(3)]  # fmt: skip
            columns = [c for c in table if c.startswith(prefix)]
            table[columns] *= factor
        elif what in ("hold", "zero", "gap") and number == 0:
            column = str(same.choice(["rotor_speed_1_rad_s", "specific_force_x_m_s2", "rotor_speed_2_rad_s"]))
            first = int(same.uniform(0.3, 0.6) * len(table))
            span = slice(first, first + int(2.5 * kit.rate_hz))
            values = table[column].to_numpy().copy()
            values[span] = {"hold": values[first], "zero": 0.0, "gap": np.nan}[what]
            table[column] = values
    return table


def believed(sheet: Sheet, rng, kit: Kit):
    """vehicle.yaml and what is wrong in it."""
    c = sheet.craft
    true = {"mass_kg": c.mass, "thrust_coefficient_n_s2": c.thrust, "torque_coefficient_n_m_s2": c.torque}
    true |= {f"inertia_{a}{a}_kg_m2": c.inertia[i, i] for i, a in enumerate("xyz")}
    has = {k: v * sheet.wrong.get(k, 1.0) for k, v in true.items()}
    turned = -1 if "spin" in sheet.edits else 1
    out = {
        "name": c.name,
        "kind": "flight",
        "mass_kg": has["mass_kg"],
        "inertia_kg_m2": {f"{a}{a}": has[f"inertia_{a}{a}_kg_m2"] for a in "xyz"},
        "rotors": [
            {"x_m": r[0], "y_m": r[1], "z_m": r[2], "spin": "ccw" if s * turned > 0 else "cw"}
            for r, s in zip(c.hubs, c.spin, strict=True)
        ],
        "thrust_coefficient_n_s2": has["thrust_coefficient_n_s2"],
        "torque_coefficient_n_m_s2": has["torque_coefficient_n_m_s2"],
        "gravity_m_s2": GRAVITY,
        "rotor_radius_m": c.radius,
    }
    if rng.random() < 0.4:
        out["noise"] = {"specific_force_m_s2": kit.force, "angular_velocity_rad_s": kit.rate}
    return out, {k: {"believed": has[k], "true": true[k]} for k in sheet.wrong}


AGAIN = 50
"""First number of the paths that a case is flown along again: no case has as many runs."""


def make(family: str, seed: int):
    """The set of a family and a seed, its truth and its noise-free tables."""
    sheet, kit = drafted(family, seed)
    vehicle, off = believed(sheet, np.random.default_rng([seed, 22]), kit)
    return finished(sheet, kit, vehicle, off, *recorded(sheet, kit, vehicle, seed), seed)


def flown_again(family: str, seed: int, pace: float):
    """The runs of a case along other paths under a controller whose bandwidth is `pace` times as large, noise-free."""
    sheet, kit = drafted(family, seed)
    vehicle, _ = believed(sheet, np.random.default_rng([seed, 22]), kit)
    return recorded(sheet, kit, vehicle, seed, pace, AGAIN)[1]


def recorded(sheet: Sheet, kit: Kit, vehicle: dict, seed: int, pace: float = 1.0, first: int = 0):
    """Tables of the runs as written, as perfect instruments would have written them, rms values by channel, windows of
    mistakes, and what a blade-element rotor's parts amount to.

    `pace` is the controller's bandwidth over its own, `first` numbers the paths.
    """
    craft = sheet.craft
    tables, ideals, channels, windows = {}, {}, {}, []
    lag = max(sheet.nature.lag + sheet.nature.second, 0.02)
    flown = replace(craft, slow=pace * min(craft.slow, 0.045 / lag))
    parts = {"axial_inflow": [], "translational_lift": []}
    for i, style in enumerate(sheet.styles[: 3 + seed % 2]):
        name = f"run{i + 1:02d}"
        seconds = float(np.random.default_rng([seed, 23, i]).uniform(22, 34))
        times = np.arange(int(seconds * FINE_HZ)) / FINE_HZ
        for scale in (0.9, 0.65, 0.45, 0.3):
            rng = np.random.default_rng([seed, 24, first + i])
            way = path(seconds, style, rng, scale, craft.name == "micro")
            try:
                flight = solve(flown, sheet.nature, way, times)
                break
            except Strayed:
                continue
        else:
            raise Strayed(f"seed {seed}, {name}: not held in any size of flight")
        flight["sag"] = sheet.nature.sag
        a, b = record(flight, kit, craft.hover, rng)
        ideals[name], tables[name] = (edited(x, sheet, i, rng, kit) for x in (a, b))
        if sheet.nature.blades:
            for id, lost in blade_parts(craft, flight).items():
                parts[id].append(lost)
        a, b = residuals(ideals[name], vehicle), residuals(tables[name], vehicle)
        channels[name] = {
            c: {"noise_rms": rms(b[c] - a[c]), "mismatch_rms": rms(a[c]), "before_rms": rms(b[c])} for c in a
        }
        if i == 0 and set(sheet.edits) & {"hold", "zero", "gap"}:
            t = tables[name]["time_s"].to_numpy()
            same = np.random.default_rng(int(craft.mass * 1e9) % 2**32)
            same.choice(3)
            first = int(same.uniform(0.3, 0.6) * len(t))
            windows.append({"id": "sensor_dropout", "run": name, "start_s": t[first], "stop_s": t[first] + 2.5})
    return tables, ideals, channels, windows, parts


def blade_parts(craft: Craft, flight: dict) -> dict[str, float]:
    """Rms of the thrust that climbing and that forward speed change by themselves, all rotors, N."""
    pick = slice(1000, None, 100)

    through = np.array([turn_matrix(q).T @ v for q, v in zip(flight["q"][pick], flight["v"][pick], strict=True)])
    tip = flight["speed"][pick].mean(axis=1) * craft.radius
    target = craft.thrust / (RHO * np.pi * craft.radius**4)
    pitch = pitch_for(target, 0.12)
    scale = RHO * np.pi * craft.radius**2 * tip**2 * craft.n
    still = coefficients(0.0, 0.0, 0.12, pitch)[0]
    climb = np.array([coefficients(0.0, -w / s, 0.12, pitch)[0] for w, s in zip(through[:, 2], tip, strict=True)])
    edge = np.hypot(through[:, 0], through[:, 1])
    ahead = np.array([coefficients(u / s, 0.0, 0.12, pitch)[0] for u, s in zip(edge, tip, strict=True)])
    return {"axial_inflow": rms(scale * (climb - still)), "translational_lift": rms(scale * (ahead - still))}


def finished(sheet, kit, vehicle, off, tables, ideals, channels, windows, parts, seed):
    """The recording and its truth; what is smaller than a quarter of the noise need not be found."""
    ratios = {
        c: max(run[c]["mismatch_rms"] / max(run[c]["noise_rms"], 1e-12) for run in channels.values())
        for c in next(iter(channels.values()))
        if not c.startswith("rotor_speed") or "motor_lag" in [e["id"] for e in sheet.effects]
    }
    main = max(ratios, key=ratios.get)
    effects, fair = sheet.effects, list(sheet.fair)
    for id, sizes in parts.items():
        floor = np.mean([run["force_z"]["noise_rms"] for run in channels.values()])
        if sizes and max(sizes) < 0.5 * floor:
            effects = [e for e in effects if e["id"] != id]
            fair.append(id)
    for entry in (*effects, *sheet.outside):
        entry |= {"size_over_noise": ratios[main], "main_channel": main, "amount": 1.0}
    sealed = bool(effects or sheet.outside or off)
    verdict = ["no_mismatch"]
    if sealed:
        verdict = ["partly_explained", "unexplained"] if sheet.outside else ["explained", "partly_explained"]
    # A sideways accelerometer that reads nothing but noise (no drag) reads the same with its sign flipped.
    small = sealed and not set(sheet.edits) - {"sign"} and ratios[main] < SMALL
    if small:
        verdict.append("no_mismatch")
        fair += [e["id"] for e in effects]
    if "vibration" in fair:
        verdict = list(dict.fromkeys([*verdict, "explained", "partly_explained"]))
    truth = {
        "effects": effects,
        "wrong_parameters": off,
        "outside_catalogue": sheet.outside,
        "fair": fair,
        "fair_why": sheet.why,
        "need_not_be_found": small,
        "grade": kit.name,
        "locations": windows,
        "verdict": verdict,
        "oracle": {"cutoff_hz": CUTOFF_HZ, "runs": channels},
        "seed": seed,
    }
    return Recording(vehicle, tables, (), ("csv", "csv.gz", "parquet")[seed % 3]), plain(truth), ideals
