"""The list of concealed cases: what is hidden, how strongly, in which flight, with which columns.

A case is named openly here; its recording set carries a name that says nothing (`Case.set_name`).
"""

import hashlib
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch

import numpy as np

from . import drawn as drawn_cases
from . import ground_cases
from .ground import GroundPlan
from .richsim.hidden import OUTSIDE, Hidden
from .richsim.scene import Plan, Run
from .richsim.sensors import Noise
from .rotorpy_cases import RotorpyPlan


@dataclass(frozen=True)
class Case:
    """One concealed set. `truth` is what is known before building: ids and wrong values to be found."""

    name: str
    seed: int
    generator: str
    settings: Plan | RotorpyPlan | GroundPlan | str  # of a drawn case its name
    truth: tuple[str, ...]

    @property
    def set_name(self) -> str:
        return "set-" + hashlib.sha256(f"{self.name}|{self.seed}".encode()).hexdigest()[:10]


POSE = ("position", "velocity", "attitude", "rates", "force")
SPEED = ("speed", *POSE)
COMMAND = ("command", *POSE)
BOTH = ("speed", "command", *POSE)
THROTTLE = ("throttle", *POSE)

RATES = (100.0, 200.0, 250.0, 250.0, 400.0, 500.0)
VEHICLES = ("thesis", "racer", "crazyflie", "hexarotor")


@dataclass(frozen=True)
class Recipe:
    """How an effect is shown well: columns, three runs, forms; amounts where noise does not set the size."""

    groups: tuple[str, ...]
    purposes: tuple[str, ...]
    forms: tuple[str, ...] = ("",)
    amounts: tuple[float, float, float] | None = None  # strong, moderate, weak


RECIPES: dict[str, Recipe] = {
    "rotor_drag": Recipe(SPEED, ("fast", "rich", "fast"), ("", "centre")),
    "frame_drag": Recipe(SPEED, ("fast", "rich", "fast"), ("", "axis")),
    "translational_lift": Recipe(SPEED, ("fast", "rich", "fast")),
    "axial_inflow": Recipe(SPEED, ("climbs", "rich", "climbs")),
    "flapping_moment": Recipe(SPEED, ("fast", "rich", "fast")),
    "motor_lag": Recipe(BOTH, ("excite", "rich", "excite"), ("", "two", "thrust"), (2.0, 1.0, 0.35)),
    "battery_sag": Recipe((*COMMAND, "battery"), ("rich", "climbs", "rich")),
    "thrust_curve": Recipe(SPEED, ("climbs", "excite", "climbs"), ("", "constant")),
    "throttle_curve": Recipe(THROTTLE, ("climbs", "excite", "climbs"), ("", "dead")),
    "com_offset": Recipe(SPEED, ("rich", "excite", "rich")),
    "unequal_rotors": Recipe(SPEED, ("rich", "excite", "rich"), ("", "one")),
    "thrust_tilt": Recipe(SPEED, ("rich", "turning", "rich"), ("", "one")),
    "rotor_gyroscopic": Recipe(SPEED, ("turning", "excite", "turning")),
    "rotor_acceleration_torque": Recipe(SPEED, ("excite", "rich", "excite")),
    "inertia_products": Recipe(SPEED, ("excite", "rich", "excite")),
    "rotational_damping": Recipe(SPEED, ("excite", "rich", "excite")),
    "ground_effect": Recipe((*SPEED, "height"), ("low", "landing", "low"), ("", "exponential")),
    "rotor_interference": Recipe(SPEED, ("fast", "rich", "fast")),
    "vortex_ring": Recipe(SPEED, ("descents", "rich", "descents")),
    "steady_wind": Recipe(SPEED, ("turning", "fast", "turning"), ("",), (1.8, 1.0, 0.3)),
    "gust": Recipe(SPEED, ("rich", "turning", "rich"), ("",), (1.5, 0.8, 0.3)),
    "payload": Recipe(SPEED, ("rich", "excite", "rich"), ("", "slung")),
    "command_saturation": Recipe(BOTH, ("steps", "steps", "steps"), ("",), (1.4, 1.0, 0.8)),
    "delay": Recipe(SPEED, ("excite", "rich", "excite"), ("motor", "imu", "actuation"), (2.0, 1.0, 0.5)),
    "accelerometer_error": Recipe(SPEED, ("rich", "turning", "rich"), ("bias", "turn", "scale")),
    "gyro_error": Recipe(SPEED, ("rich", "turning", "rich"), ("bias", "scale")),
    "imu_lever_arm": Recipe(SPEED, ("excite", "rich", "excite")),
    "vibration": Recipe(SPEED, ("rich", "excite", "rich"), ("", "rectified"), (3.0, 1.0, 0.4)),
    "clock_skew": Recipe(SPEED, ("rich", "excite", "rich"), ("", "pose"), (4.0, 1.0, 0.4)),
    "sensor_dropout": Recipe(SPEED, ("rich", "excite", "rich"), ("zero", "hold", "gap"), (1.0, 1.0, 1.0)),
}
STRENGTHS = {"strong": (5.0, 0), "moderate": (1.5, 1), "weak": (0.5, 2)}


def _draw(name: str, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _noise(rng) -> Noise:
    f = float(np.exp(rng.uniform(np.log(0.6), np.log(1.7))))
    return Noise(
        specific_force_m_s2=0.15 * f * float(rng.uniform(0.7, 1.4)),
        angular_velocity_rad_s=0.012 * f * float(rng.uniform(0.7, 1.4)),
        rotor_speed_relative=0.004 * f * float(rng.uniform(0.6, 1.5)),
        velocity_m_s=0.02 * float(rng.uniform(0.5, 1.5)),
        coloured_share=float(rng.choice([0.0, 0.3, 0.6])),
        memory_s=float(rng.uniform(0.004, 0.02)),
        quantum_rotor_rad_s=float(rng.choice([0.0, 1.0, 5.0])),
        quantum_force_m_s2=float(rng.choice([0.0, 0.0048])),
        quantum_rate_rad_s=float(rng.choice([0.0, 0.00107])),
    )


def _dressed(rng, **fixed) -> Plan:
    """A plan with everything not fixed drawn at random: vehicle, rate, noise, file form, hints."""
    drawn = dict(
        vehicle=str(rng.choice(VEHICLES)),
        rate_hz=float(rng.choice(RATES)),
        noise=_noise(rng),
        late_fraction=float(rng.choice([0.0, 0.0, rng.uniform(-0.5, 0.5)])),
        held_out=bool(rng.random() < 0.3),
        form=str(rng.choice(["csv", "csv.gz", "parquet"])),
        noise_hint=[1.0, 1.0, 2.0, 0.5, None][rng.integers(5)],
        believes=tuple(
            k for k in ("rotor_radius_m", "rotor_inertia_kg_m2", "ground_z_m", "trust") if rng.random() < 0.6
        ),
    )
    return Plan(**(drawn | fixed))


def _runs(purposes, rng, each=25.0) -> tuple[Run, ...]:
    return tuple(Run(p, float(np.round(each * rng.uniform(0.85, 1.2)))) for p in purposes)


def _window(rng, duration=20.0) -> tuple[float, float]:
    start = float(np.round(rng.uniform(4.0, duration - 8.0), 1))
    return start, start + float(np.round(rng.uniform(2.0, 4.0), 1))


def singles() -> list[Case]:
    """Every effect alone at three strengths."""
    out = []
    for effect, recipe in RECIPES.items():
        for strength, (size, column) in STRENGTHS.items():
            count = 3 if strength == "moderate" else 2
            for k in range(count):
                name = f"single/{effect}/{strength}/{k}"
                rng = _draw(name, 0)
                form = recipe.forms[(k + column) % len(recipe.forms)]
                groups, fixed = recipe.groups, {}
                equivalent: tuple[tuple[str, ...], ...] = ()
                if effect == "motor_lag" and k == 1:
                    groups = COMMAND
                if effect == "battery_sag" and k == 1:
                    groups = (*BOTH, "battery")
                if effect == "delay" and form == "actuation":
                    groups = COMMAND
                if effect == "delay":
                    fixed["rate_hz"] = float(rng.choice([200.0, 250.0, 500.0]))
                if effect == "vibration":
                    fixed["rate_hz"] = float(rng.choice([250.0, 500.0, 1000.0]))
                if effect == "payload" and form == "":
                    equivalent = (("payload", "com_offset", "mass_kg"),)
                if effect == "rotor_drag":
                    equivalent = ()
                amount = recipe.amounts[column] if recipe.amounts else 1.0
                hidden = Hidden(
                    effect,
                    size=None if recipe.amounts else size,
                    amount=amount,
                    form=form,
                    window=_window(rng) if effect in ("gust", "sensor_dropout") else None,
                    runs=(int(rng.integers(2)),) if effect == "sensor_dropout" else None,
                )
                plan = _dressed(
                    rng,
                    groups=groups,
                    runs=_runs(recipe.purposes, rng),
                    hidden=(hidden,),
                    equivalent=equivalent,
                    **fixed,
                )
                out.append(Case(name, 1000 + k, "richsim", plan, (effect,)))
    return out


WRONG_NAMES = (
    "mass_kg",
    "thrust_coefficient_n_s2",
    "torque_coefficient_n_m_s2",
    "inertia_xx_kg_m2",
    "inertia_yy_kg_m2",
    "inertia_zz_kg_m2",
    "arm_scale",
)


def wrong_values() -> list[Case]:
    """Nothing hidden but believed values 2-10 % off."""
    out = []
    for parameter in WRONG_NAMES:
        for k in range(3):
            name = f"wrong/{parameter}/{k}"
            rng = _draw(name, 0)
            factor = 1 + float(rng.choice([-1, 1])) * (0.02, 0.05, 0.10)[k]
            plan = _dressed(
                rng, groups=SPEED, runs=_runs(("rich", "excite", "rich"), rng), wrong=((parameter, factor),)
            )
            out.append(Case(name, 2000 + k, "richsim", plan, (parameter,)))
    pairs = (
        ("mass_kg", "inertia_xx_kg_m2"),
        ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2"),
        ("inertia_yy_kg_m2", "inertia_zz_kg_m2"),
        ("thrust_coefficient_n_s2", "arm_scale"),
        ("mass_kg", "torque_coefficient_n_m_s2"),
    )
    for k, pair in enumerate(pairs):
        name = f"wrong/pair/{k}"
        rng = _draw(name, 0)
        wrong = tuple((p, 1 + float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.1))) for p in pair)
        plan = _dressed(rng, groups=SPEED, runs=_runs(("rich", "excite", "fast"), rng), wrong=wrong)
        out.append(Case(name, 2100 + k, "richsim", plan, pair))
    return out


MIXTURES = (
    (SPEED, ("rotor_drag", "axial_inflow")),
    (SPEED, ("rotor_drag", "translational_lift")),
    (SPEED, ("rotor_drag", "com_offset")),
    (SPEED, ("rotor_drag", "axial_inflow", "translational_lift")),
    (SPEED, ("frame_drag", "com_offset")),
    (BOTH, ("motor_lag", "rotor_drag")),
    ((*BOTH, "battery"), ("motor_lag", "battery_sag")),
    (SPEED, ("rotor_gyroscopic", "rotor_acceleration_torque")),
    (SPEED, ("rotor_acceleration_torque", "inertia_products")),
    (SPEED, ("unequal_rotors", "rotor_drag")),
    (SPEED, ("thrust_tilt", "axial_inflow")),
    ((*SPEED, "height"), ("ground_effect", "rotor_drag")),
    (SPEED, ("gust", "rotor_drag", "com_offset")),
    (SPEED, ("steady_wind", "rotor_drag", "translational_lift")),
    (SPEED, ("imu_lever_arm", "rotor_drag")),
    (SPEED, ("accelerometer_error", "com_offset")),
    (SPEED, ("gyro_error", "rotor_drag")),
    (THROTTLE, ("throttle_curve", "rotor_drag")),
    (SPEED, ("rotational_damping", "com_offset", "rotor_drag")),
    (SPEED, ("payload", "rotor_drag")),
    (BOTH, ("motor_lag", "com_offset", "rotor_drag", "axial_inflow")),
    (SPEED, ("delay", "rotor_drag")),
    (SPEED, ("rotor_interference", "rotor_drag")),
    (SPEED, ("thrust_curve", "rotor_drag")),
    ((*COMMAND, "battery"), ("battery_sag", "rotor_drag")),
    (SPEED, ("flapping_moment", "rotor_drag")),
    (SPEED, ("rotor_drag", "frame_drag", "unequal_rotors")),
    (SPEED, ("rotor_gyroscopic", "rotor_acceleration_torque", "rotor_drag", "com_offset")),
)


def mixtures() -> list[Case]:
    """Two to four effects at once, each one to three times the noise; some with a wrong value too."""
    out = []
    for m, (groups, effects) in enumerate(MIXTURES):
        for k in range(2):
            name = f"mixture/{m:02d}/{k}"
            rng = _draw(name, 0)
            hidden = []
            for effect in effects:
                recipe = RECIPES[effect]
                amount = float(rng.uniform(0.6, 1.5)) if recipe.amounts else 1.0
                size = None if recipe.amounts else float(rng.uniform(1.0, 3.0))
                if effect == "rotor_drag" and {"gust", "steady_wind"} & set(effects):
                    size, amount = None, 0.3  # a plausible drag: the wind acts through it
                form = "motor" if effect == "delay" else recipe.forms[0]
                window = _window(rng) if effect == "gust" else None
                hidden.append(Hidden(effect, size=size, amount=amount, form=form, window=window))
            # sizes are taken from the first run, which must excite what is hidden
            first = "low" if "ground_effect" in effects else "fast"
            purposes = (first, "excite", "climbs", "turning" if k else "rich")
            wrong = ()
            if m % 3 == 0 and k == 1:
                wrong = ((str(rng.choice(WRONG_NAMES)), 1 + float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.06))),)
            rate = {"rate_hz": 250.0} if "delay" in effects or "motor_lag" in effects else {}
            plan = _dressed(rng, groups=groups, runs=_runs(purposes, rng), hidden=tuple(hidden), wrong=wrong, **rate)
            out.append(Case(name, 5000 + 2 * m + k, "richsim", plan, (*effects, *(w for w, _ in wrong))))
    # the blade-element rotor: not the catalogue's own formulas
    blades = (("rotor_drag",), ("axial_inflow",), ("translational_lift",))
    blades += (("rotor_drag", "axial_inflow", "translational_lift"),)
    for m, effects in enumerate(blades):
        for k in range(3):
            name = f"blade/{'-'.join(effects)}/{k}"
            rng = _draw(name, 0)
            sizes = {e: (1.0, 0.5, 0.2)[k] * (3 if e == "rotor_drag" else 1) for e in effects}
            hidden = tuple(Hidden(e, amount=sizes[e], form="blade") for e in effects)
            plan = _dressed(rng, groups=SPEED, runs=_runs(("fast", "climbs", "rich", "fast"), rng), hidden=hidden)
            out.append(Case(name, 5500 + 3 * m + k, "richsim", plan, effects))
    return out


IMU_ONLY = ("speed", "rates", "force")
# (pair, form and columns and flights without, and with, the data that separate them)
PAIRS = (
    (
        ("motor_lag", ""),
        ("delay", "actuation"),
        (COMMAND, ("heave",) * 3),
        (COMMAND, ("excite", "rich", "excite")),
    ),
    (
        ("rotor_drag", "centre"),
        ("frame_drag", ""),
        (SPEED, ("one_way",) * 3),
        (SPEED, ("fast", "rich", "fast")),
    ),
    (
        ("com_offset", ""),
        ("unequal_rotors", "plane"),
        (COMMAND, ("calm",) * 3),
        (SPEED, ("excite", "rich", "excite")),
    ),
    (
        ("thrust_tilt", ""),
        ("accelerometer_error", "turn"),
        (IMU_ONLY, ("rich",) * 3),
        (SPEED, ("rich", "turning", "rich")),
    ),
)


def confusable() -> list[Case]:
    """Pairs that imitate each other, recorded so that they can be distinguished, and so that they cannot."""
    out = []
    for p, (first, second, without, with_) in enumerate(PAIRS):
        for effect, form in (first, second):
            for variant, (groups, purposes) in (("without", without), ("with", with_)):
                for k in range(2):
                    name = f"confusable/{p}/{effect}/{variant}/{k}"
                    rng = _draw(name, 0)
                    size = None if effect in ("motor_lag", "delay") else {"without": 0.7, "with": 2.0}[variant]
                    one_way = purposes[0] == "one_way"
                    plan = _dressed(
                        rng,
                        rate_hz=250.0,
                        vehicle=("thesis", "racer")[k],
                        groups=groups,
                        runs=_runs(purposes, rng),
                        hidden=(Hidden(effect, size=size, form=form),),
                        late_fraction=0.0,
                        trim_s=5.0 if one_way else 0.0,
                        equivalent=((first[0], second[0]),) if variant == "without" else (),
                    )
                    out.append(Case(name, 6000 + len(out), "richsim", plan, (effect,)))
    return out


POWER = ("rotor_drag", "translational_lift", "axial_inflow", "com_offset", "thrust_tilt", "ground_effect")
POWER += ("rotor_gyroscopic", "rotor_acceleration_torque", "rotational_damping", "accelerometer_error")


def power() -> list[Case]:
    """The same effects from far below the noise to above it: the detection curve."""
    out = []
    for effect in POWER:
        recipe = RECIPES[effect]
        for size in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0):
            for k in range(2):
                name = f"power/{effect}/{size}/{k}"
                rng = _draw(name, 0)
                plan = _dressed(
                    rng,
                    rate_hz=250.0,
                    groups=recipe.groups,
                    runs=_runs(recipe.purposes, rng),
                    hidden=(Hidden(effect, size=size, form=recipe.forms[0]),),
                )
                out.append(Case(name, 7000 + len(out), "richsim", plan, (effect,)))
    return out


def partial() -> list[Case]:
    """Effects that act in part of the flight only; the exact times are in the answers."""
    out = []
    settings = (
        ("gust", SPEED, ("rich", "rich", "rich"), (1.5, 1.0, 0.6)),
        ("ground_effect", (*SPEED, "height"), ("landing",) * 3, None),
        ("command_saturation", BOTH, ("steps",) * 3, (1.5, 1.2, 0.9)),
        ("sensor_dropout", SPEED, ("rich", "excite", "rich"), (1.0,) * 3),
        ("vortex_ring", SPEED, ("descents",) * 3, None),
    )
    for effect, groups, purposes, amounts in settings:
        for k in range(3):
            name = f"part/{effect}/{k}"
            rng = _draw(name, 0)
            window = (12.0, 15.0) if effect == "gust" else _window(rng)
            hidden = Hidden(
                effect,
                size=None if amounts else (4.0, 2.0, 1.0)[k],
                amount=amounts[k] if amounts else 1.0,
                form=RECIPES[effect].forms[k % len(RECIPES[effect].forms)],
                window=window if effect in ("gust", "sensor_dropout") else None,
                runs=(k % 2,) if effect == "sensor_dropout" else None,
            )
            plan = _dressed(rng, groups=groups, runs=_runs(purposes, rng), hidden=(hidden,))
            out.append(Case(name, 8000 + len(out), "richsim", plan, (effect,)))
    return out


def outside() -> list[Case]:
    """Causes that no id covers: the right answer is that none of the known ones explains it."""
    out = []
    for cause in OUTSIDE:
        for k in range(4):
            name = f"outside/{cause}/{k}"
            rng = _draw(name, 0)
            fixed = {"rate_hz": 500.0} if cause == "chipped_blade" else {}
            amount = (2.0, 1.0, 1.0, 0.5)[k]
            size = None if cause == "chipped_blade" else (5.0, 3.0, 2.0, 1.2)[k]
            purposes = (
                ("fast", "rich", "fast")
                if cause in ("banner", "slosh", "sliding_battery")
                else ("rich", "turning", "rich")
            )
            plan = _dressed(
                rng,
                groups=SPEED,
                runs=_runs(purposes, rng),
                hidden=(Hidden(cause, size=size, amount=amount),),
                **fixed,
            )
            out.append(Case(name, 9000 + len(out), "richsim", plan, ()))
    return out


CLEAN_GROUPS = (
    SPEED,
    SPEED,
    BOTH,
    COMMAND,
    (*THROTTLE, "battery"),
    ("speed", "position", "velocity", "attitude", "rates"),
    ("speed", "rates", "force"),
    ("speed", "attitude", "rates", "force", "height"),
    (*BOTH, "battery", "height"),
    ("command", "attitude", "rates", "force"),
    ("speed", "position", "attitude", "rates"),
)
CLEAN_PURPOSES = ("rich", "fast", "turning", "excite", "climbs", "steps", "low", "landing", "calm", "gentle")


def clean(count: int = 220) -> list[Case]:
    """Nothing hidden: vehicles, rates 50-1000 Hz, columns, manoeuvres and noise all vary."""
    out = []
    for k in range(count):
        name = f"clean/{k:03d}"
        rng = _draw(name, 0)
        runs = int(rng.choice([1, 2, 3, 3, 4]))
        each = 50.0 if runs == 1 else 25.0
        purposes = [str(rng.choice(CLEAN_PURPOSES)) for _ in range(runs)]
        if runs == 1 and purposes[0] == "calm":
            purposes = ["rich"]
        plan = _dressed(
            rng,
            rate_hz=float(rng.choice([50.0, 100.0, 200.0, 250.0, 250.0, 400.0, 500.0, 1000.0])),
            groups=CLEAN_GROUPS[rng.integers(len(CLEAN_GROUPS))],
            runs=_runs(purposes, rng, each),
            jitter_s=float(rng.choice([0.0, 0.0, 2e-4])),
        )
        out.append(Case(name, 3000 + k, "richsim", plan, ()))
    return out


def mistakes() -> list[Case]:
    """Nothing hidden in the physics; the set itself is wrong."""
    variants = (
        ("rotor_order", ""),
        ("rotor_order", ""),
        ("spin_direction", ""),
        ("spin_direction", "one"),
        ("axis_sign", "angular_velocity_y_rad_s"),
        ("axis_sign", "specific_force_z_m_s2"),
        ("axis_sign", "angular_velocity_z_rad_s"),
        ("axis_sign", "velocity_y_m_s"),
        ("unit_error", "rpm"),
        ("unit_error", "deg"),
        ("unit_error", "g"),
        ("unit_error", "cm"),
        ("unit_error", "mm"),
    )
    out = []
    for k, (effect, form) in enumerate(variants):
        name = f"mistake/{effect}/{form or 'all'}/{k}"
        rng = _draw(name, 0)
        plan = _dressed(
            rng,
            groups=SPEED,
            runs=_runs(("rich", "excite", "rich"), rng),
            hidden=(Hidden(effect, form=form),),
        )
        out.append(Case(name, 4000 + k, "richsim", plan, (effect,)))
    return out


ROTORPY = (
    ("clean", {}, SPEED),
    ("rotor_drag", {"k_d": 1.0}, SPEED),
    ("axial_inflow", {"k_z": 1.0}, SPEED),
    ("translational_lift", {"k_h": 1.0}, SPEED),
    ("frame_drag", {"c_D": 1.0}, SPEED),
    ("flapping_moment", {"k_flap": 1.0}, SPEED),
    ("inertia_products", {"I": 1.0}, SPEED),
    ("motor_lag", {"tau_m": 1.0}, BOTH),
    ("steady_wind", {"k_d": 1.0, "wind": 1.0}, SPEED),
    ("gust", {"k_d": 1.0, "gust": 1.0}, SPEED),
    ("as_published", {"k_d": 1.0, "k_z": 1.0, "k_h": 1.0, "c_D": 1.0}, SPEED),
    ("as_published_with_lag", {"k_d": 1.0, "k_z": 1.0, "k_h": 1.0, "c_D": 1.0, "tau_m": 1.0}, BOTH),
    ("wrong_mass", {"mass_kg": 1.05}, SPEED),
    ("wrong_inertia", {"inertia_xx_kg_m2": 0.93}, SPEED),
)


def rotorpy() -> list[Case]:
    """Recordings by RotorPy, an independent simulator: its published coefficients, and a quarter of them."""
    out = []
    for label, switches, groups in ROTORPY:
        for vehicle in ("hummingbird", "crazyflie"):
            for k in range(5 if label == "clean" else 2):
                name = f"rotorpy/{label}/{vehicle}/{k}"
                rng = _draw(name, 0)
                whole = k == 0 or label.startswith(("clean", "wrong"))
                scaled = {s: v if whole else v / 4 for s, v in switches.items()}
                plan = RotorpyPlan(
                    vehicle=vehicle,
                    switches=tuple(scaled.items()),
                    rate_hz=float(rng.choice([125.0, 250.0])),
                    groups=groups,
                    runs=_runs(("rich", "fast", "climbs"), rng, 20.0),
                    noise=_noise(rng),
                    form=str(rng.choice(["csv", "csv.gz", "parquet"])),
                )
                out.append(Case(name, 10000 + len(out), "rotorpy", plan, plan.ids()))
    return out


def ground() -> list[Case]:
    """Benches and stands (`bench/…`, `stand/…`)."""
    return [Case(name, seed, "ground", plan, tuple(truth)) for name, seed, plan, truth in ground_cases.plans()]


RATES_ASKED = (25, 50, 100, 1000)


def rates() -> list[Case]:
    """Every clean flight once more at each of four rates: the same flights and sensors, recorded by another logger."""
    out = []
    for hz in RATES_ASKED:
        for case in clean():
            plan = replace(case.settings, rate_hz=float(hz), flown_for_hz=case.settings.rate_hz)
            name = f"rate/{hz:04d}/{case.name.rsplit('/', 1)[1]}"
            out.append(Case(name, case.seed, "richsim", plan, ()))
    return out


def drawn(date: str = drawn_cases.DEVELOPMENT) -> list[Case]:
    """Cases drawn whole from one seed (`drawn.py`): those for development, or those of a release's date."""
    return [named(name) for name in drawn_cases.names(date)]


NEVER_HELD = ("single/thrust_curve/strong/1",)
"""Cases whose controller loses the vehicle in any size of flight: of a crash nothing is asked."""


def all_cases() -> list[Case]:
    """Every case that can be flown, in a fixed order; names are unique."""
    out = [*singles(), *mixtures(), *wrong_values(), *confusable(), *power(), *partial()]
    out += [*outside(), *mistakes(), *rotorpy(), *clean(), *rates(), *ground(), *drawn()]
    names = [c.name for c in out]
    if len(set(names)) != len(names):
        raise ValueError("two cases carry the same name")
    return [c for c in out if c.name not in NEVER_HELD]


def matching(patterns: str, among: list[Case] | None = None) -> list[Case]:
    """Cases (of all, or of those given) whose name fits one of the comma-separated shell patterns."""
    wanted = [p.strip() for p in patterns.split(",")]
    return [c for c in (all_cases() if among is None else among) if any(fnmatch(c.name, p) for p in wanted)]


def named(name: str) -> Case:
    """The drawn case of a name, listed or released.

    Raises
    ------
    KeyError
        There is no such case.
    """
    simulator, family, date, number = drawn_cases.parts(name)
    if family not in drawn_cases.SIMULATORS[simulator]:
        raise KeyError(f"{name}: {simulator} draws no {family}, but {', '.join(drawn_cases.SIMULATORS[simulator])}")
    seed = drawn_cases.seed_of(date, f"{simulator}/{family}", number)
    return Case(name, seed, "drawn", name, ())


def with_names(names: Sequence[str]) -> list[Case]:
    """The cases of these names, listed or released, in their order; a KeyError for a name that no case has."""
    listed = {c.name: c for c in all_cases()}
    lost = [n for n in names if n not in listed and not drawn_cases.parts(n)]
    if lost:
        raise KeyError(f"no case is called {lost[0]}; README.md beside this file says how one is made")
    return [named(n) if drawn_cases.parts(n) else listed[n] for n in names]
