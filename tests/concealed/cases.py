"""The list of concealed cases: what is hidden, how strongly, in which flight, with which columns.

A case is named openly here; its recording set carries a name that says nothing (`Case.set_name`).
"""

import hashlib
import zlib
from dataclasses import dataclass
from fnmatch import fnmatch

import numpy as np

from .richsim.hidden import Hidden
from .richsim.scene import Plan, Run
from .richsim.sensors import Noise


@dataclass(frozen=True)
class Case:
    """One concealed set. `truth` holds what is known before building: the ids and wrong values to be found."""

    name: str
    seed: int
    generator: str
    settings: Plan
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
    """How an effect is shown well: columns, three runs, forms, and amounts where noise does not set the size."""

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


def all_cases() -> list[Case]:
    """Every case, in a fixed order; names are unique."""
    out = [*singles(), *wrong_values(), *clean(), *mistakes()]
    names = [c.name for c in out]
    if len(set(names)) != len(names):
        raise ValueError("two cases carry the same name")
    return out


def matching(patterns: str) -> list[Case]:
    """Cases whose name fits one of the comma-separated shell patterns."""
    wanted = [p.strip() for p in patterns.split(",")]
    return [c for c in all_cases() if any(fnmatch(c.name, p) for p in wanted)]
