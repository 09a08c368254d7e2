"""Families of flights on the multibody engine, and a set of one of them from one seed.

`make(family, seed)` draws size, vehicle, environment and grade of instruments, flies the runs and returns the set, its
truth (the form that `proof/rotorid_proof/concealed/README.md` describes) and the noise-free tables.
"""

from dataclasses import replace

import numpy as np

from ..residuals import CUTOFF_HZ, residuals, rms
from ..write import Recording, plain
from . import course, logger, vehicle
from .engine import STEP, Lost, World, fly
from .vehicle import GRAVITY, RHO, Quad

SMALL = 0.25
"""Below this rms over the noise (in the channel where it is largest) a cause need not be found."""


class Draft:
    """A case while it is drawn: the world, what the answer will say, what the recording must hold."""

    def __init__(self, quad: Quad, rng: np.random.Generator) -> None:
        self.quad, self.rng, self.world = quad, rng, World(lag=0.022)
        self.effects: list[dict] = []
        self.outside: list[dict] = []
        self.wrong: dict[str, float] = {}
        self.fair: list[str] = []
        self.fair_why = ""
        self.command = False
        self.grades = ("lab", "lab", "tele", "log")
        self.kinds: tuple[str, ...] = ()
        self.groups: tuple[str, ...] = ()
        self.wind = None
        self.times: list[tuple[float, float]] = []

    def size(self, low: float, high: float) -> float:
        """A size drawn evenly on a logarithmic scale."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def adds(self, id: str, parameters=(), form: str = "", equivalent=()) -> None:
        """Name an effect that is to be found."""
        self.effects.append(
            {
                "id": id,
                "form": form,
                "parameters": [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters],
                "equivalent": list(equivalent),
            }
        )

    def outside_with(self, id: str, acceptable, *parameters) -> None:
        """Name a cause that no id of the catalogue covers, and the ids that would not be wrong names for it."""
        listed = [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters]
        self.outside.append({"id": id, "acceptable": list(acceptable), "parameters": listed})


def bodies(at, length, mass, links, cable, damping):
    """MJCF of a cable of rigid links on ball joints with a small heavy ball at its end."""
    each = length / links
    text, close = "", ""
    for i in range(links):
        where = f"{at[0]} {at[1]} {at[2]}" if i == 0 else f"0 0 {each}"
        thin = cable / links * each**2 / 12
        text += (
            f'<body name="link{i}" pos="{where}"><joint type="ball" damping="{damping}"/>'
            f'<inertial pos="0 0 {each / 2}" mass="{cable / links}" diaginertia="{thin} {thin} {0.1 * thin}"/>'
        )
        close += "</body>"
    ball = 0.4 * mass * 0.02**2
    text += f'<body name="load" pos="0 0 {each}"><inertial pos="0 0 0" mass="{mass}" '
    text += f'diaginertia="{ball} {ball} {ball}"/></body>'
    return text + close


def clean(d: Draft) -> None:
    """Nothing hidden."""
    d.command = bool(d.rng.random() < 0.2)
    if d.command:
        d.world.lag = 0.0


def slung_load(d: Draft) -> None:
    q = d.quad
    mass, length = d.size(0.03, 0.2) * q.mass, d.size(0.25, 1.8)
    links = int(d.rng.choice([1, 3]))
    at = np.array([0.0, 0.0, d.rng.uniform(0.05, 0.3) * q.arm])
    d.world.extra_bodies = bodies(at, length, mass, links, (0.05 if links > 1 else 0.001) * mass, 2e-5)
    d.world.load_drag = float(d.rng.choice([0.0, 0.5 * (mass / 500) ** (2 / 3)]))
    d.adds("payload", [("mass", mass, "kg"), ("length", length, "m")], "slung" if links == 1 else "blade")
    d.fair = ["mass_kg"] + (["frame_drag"] if d.world.load_drag else [])
    d.fair_why = "a load is weight too; a load with drag of its own drags the vehicle"
    d.kinds = ("waypoints", "figure", "shaking", "vertical")


def rigid_payload(d: Draft) -> None:
    q = d.quad
    mass = d.size(0.03, 0.2) * q.mass
    angle = d.rng.uniform(0, 2 * np.pi)
    reach = d.rng.uniform(0.1, 0.5) * q.arm
    at = np.array([reach * np.cos(angle), reach * np.sin(angle), d.rng.uniform(0.1, 0.5) * q.arm])
    own = 0.4 * mass * 0.03**2
    d.world.extra_bodies = (
        f'<body name="load" pos="{at[0]} {at[1]} {at[2]}"><inertial pos="0 0 0" mass="{mass}" '
        f'diaginertia="{own} {own} {own}"/></body>'
    )
    d.adds(
        "payload",
        [("mass", mass, "kg"), *((f"r_{a}", v, "m") for a, v in zip("xyz", at, strict=True))],
        equivalent=["com_offset", "mass_kg", "inertia_products"],
    )
    d.fair = ["com_offset", "inertia_products", "imu_lever_arm", *(f"inertia_{a}{a}_kg_m2" for a in "xyz")]
    d.fair_why = (
        "a mass fixed to the frame is more mass, an offset and products of inertia at once, has moments of inertia, "
        "and moves the centre of mass away from the accelerometer"
    )


def off_centre(d: Draft) -> None:
    angle, size = d.rng.uniform(0, 2 * np.pi), d.size(0.008, 0.08) * d.quad.arm
    d.world.centre = np.array([size * np.cos(angle), size * np.sin(angle), 0.0])
    d.adds("com_offset", [(f"r_{a}", v, "m") for a, v in zip("xyz", d.world.centre, strict=True)])
    d.fair = ["imu_lever_arm"]
    d.fair_why = "the accelerometer stays where the centre of mass is believed"


def products(d: Draft) -> None:
    q = d.quad
    while True:
        j = q.inertia.copy()
        values = []
        for r, c in ((0, 1), (0, 2), (1, 2)):
            v = float(d.rng.choice([-1, 1])) * d.size(0.02, 0.12) * q.inertia[0, 0]
            j[r, c] = j[c, r] = v
            values.append(v)
        a, b, c = np.linalg.eigvalsh(j)
        if a + b > c:  # no body has another
            break
    d.world.inertia = j
    d.adds("inertia_products", [(f"J_{s}", v, "kg m2") for s, v in zip(("xy", "xz", "yz"), values, strict=True)])
    d.kinds = ("shaking", "turning", "shaking", "waypoints")


def rotor_drag(d: Draft) -> None:
    q = d.quad
    k = d.size(0.1, 0.7) * q.mass / (4 * q.hover)
    if d.rng.random() < 0.5:
        d.world.drag_speed = k
        d.adds("rotor_drag", [("k_d", k, "N/(rad/s m/s)")])
    else:
        d.world.drag_thrust = k * q.hover / (q.mass * GRAVITY / 4)
        d.adds("rotor_drag", [("k_d", k, "N/(rad/s m/s)")], form="blade")
    d.kinds = ("figure", "waypoints", "figure", "shaking")


def frame_drag(d: Draft) -> None:
    rotor_drag(d)
    base = d.size(0.008, 0.04) * d.quad.mass ** (2 / 3)
    d.world.area = base * np.array([1.0, d.rng.uniform(1.0, 1.4), d.rng.uniform(1.2, 2.0)])
    d.adds("frame_drag", [(f"CdA_{a}", v * RHO / 1.225, "m2") for a, v in zip("xyz", d.world.area, strict=True)])


def steady_wind(d: Draft) -> None:
    rotor_drag(d)
    speed, angle = d.size(0.8, 6.0), d.rng.uniform(0, 2 * np.pi)
    blow = speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    d.wind = lambda t, i: np.tile(blow, (len(t), 1))
    d.adds("steady_wind", [("w_north", blow[0], "m/s"), ("w_east", blow[1], "m/s")])
    d.kinds = ("turning", "figure", "turning", "waypoints")


def gust(d: Draft) -> None:
    rotor_drag(d)
    speed, angle = d.size(1.5, 6.0), d.rng.uniform(0, 2 * np.pi)
    ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
    windows = [(float(d.rng.uniform(6, 14)), float(d.rng.uniform(2.0, 4.0))) for _ in range(4)]

    def blow(t, i):
        start, long = windows[i]
        phase = np.clip((t - start) / long, 0, 1)  # the discrete gust of airworthiness codes: (1 − cos)/2
        return 0.5 * speed * (1 - np.cos(2 * np.pi * phase))[:, None] * ahead

    d.wind = blow
    d.times = [(start, start + long) for start, long in windows]
    d.adds("gust", [])


def ground(d: Draft) -> None:
    d.world.ground = 1.0
    d.adds("ground_effect", [], form="blade")
    d.kinds = ("low", "low", "low")
    d.groups = ("height",)
    d.grades = ("lab", "lab", "tele")


def motors(d: Draft) -> None:
    """A direct-current machine, a speed controller without feedback, a battery that sags."""
    q = d.quad
    nominal = 3.7 * round(max(2, 3.2 * q.mass ** (1 / 3)))
    top_torque = q.torque * q.top**2
    k = 0.75 * nominal / q.top
    r = (nominal - k * q.top) * k / top_torque
    tau = d.size(0.02, 0.05)  # at hover: j / (k²/r + 2 Q'ω)
    j = tau * (k * k / r + 2 * q.torque * q.hover)
    amps = 4 * q.torque * q.hover**2 / k
    d.world.motor = {
        "k": k, "r": r, "j": j, "nominal": nominal, "open": nominal * d.rng.uniform(1.0, 1.08),
        "internal": d.rng.uniform(0.02, 0.06) * nominal / amps, "capacity": amps * 110.0,
    }  # fmt: skip
    d.adds("motor_lag", [("tau_up", tau, "s"), ("tau_down", tau, "s")], form="blade")
    d.adds("battery_sag", [], form="blade", equivalent=["throttle_curve"])
    d.world.lag = tau  # for the choice of bandwidth alone
    d.command, d.groups, d.grades = True, ("battery",), ("lab", "tele")
    d.fair = ["throttle_curve", "delay"]
    d.fair_why = "a duty that is right at one voltage only bends the curve from command to speed"


def spinning(d: Draft) -> None:
    d.world.rotor_inertia = d.quad.rotor_inertia * d.size(0.8, 3.0)
    for id in ("rotor_acceleration_torque", "rotor_gyroscopic"):
        d.adds(id, [("J_r", d.world.rotor_inertia, "kg m2")])
    d.kinds = ("shaking", "turning", "shaking", "waypoints")
    d.grades = ("lab", "lab", "tele")


def weak_rotor(d: Draft) -> None:
    lost = np.zeros(4)
    if d.rng.random() < 0.5:
        lost[d.rng.integers(4)] = -d.size(0.02, 0.12)
    else:
        lost = d.size(0.015, 0.06) * d.rng.standard_normal(4)
        lost -= lost.mean()
    d.world.thrust_gain = d.world.torque_gain = 1 + lost
    d.adds("unequal_rotors", [(f"d_{i + 1}", v, "-") for i, v in enumerate(lost)])


def wrong(d: Draft) -> None:
    names = ("mass_kg", "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "inertia_xx_kg_m2",
             "inertia_yy_kg_m2", "inertia_zz_kg_m2")  # fmt: skip
    for name in d.rng.choice(names, int(d.rng.integers(1, 3)), replace=False):
        d.wrong[str(name)] = 1 + float(d.rng.choice([-1, 1])) * d.size(0.02, 0.1)
    if {"mass_kg", "thrust_coefficient_n_s2"} <= set(d.wrong):
        del d.wrong["thrust_coefficient_n_s2"]


def sloshing(d: Draft) -> None:
    """A tank: the moving part of its contents is a pendulum (Abramson 1966); at rest the vehicle is as believed."""
    q = d.quad
    if d.rng.random() < 0.5:
        rotor_drag(d)
    mass, hz = d.size(0.08, 0.2) * q.mass, d.rng.uniform(0.9, 2.2)
    length = GRAVITY / (2 * np.pi * hz) ** 2
    low = d.rng.uniform(0.1, 0.25) * q.arm  # the contents' rest, below the centre of mass
    damping = 2 * d.rng.uniform(0.02, 0.06) * 2 * np.pi * hz * mass * length**2
    d.world.extra_bodies = bodies(np.array([0, 0, low - length]), length, mass, 1, 1e-3 * mass, damping)
    # what is left of the vehicle: mass, centre and inertia such that all together is what is believed
    rest = q.mass - mass * 1.001
    centre = np.array([0.0, 0.0, -mass * low / rest])
    own = mass * np.diag([low**2, low**2, 0.0])
    j = q.inertia - own - rest * np.diag([centre[2] ** 2, centre[2] ** 2, 0.0])
    d.world.mass, d.world.centre, d.world.inertia = rest, centre, j
    d.outside_with("slosh", ["payload"], ("mass", mass, "kg"), ("frequency", hz, "Hz"))
    d.kinds = ("waypoints", "figure", "shaking", "waypoints")


def tether(d: Draft) -> None:
    """An elastic line to a winch on the ground, taut in part of the flight."""
    q = d.quad
    weight = q.mass * GRAVITY
    slack, stiff = 12.0 + d.rng.uniform(-1.0, 0.8), d.size(0.02, 0.12) * weight
    d.world.extra_world = '<site name="winch" pos="0 0 0"/>'
    d.world.extra_bodies = f'<site name="eye" pos="0 0 {0.15 * q.arm}"/>'
    d.world.extra_tendons = (
        f'<spatial stiffness="{stiff}" damping="{0.05 * stiff}" springlength="0 {slack}">'
        '<site site="winch"/><site site="eye"/></spatial>'
    )
    d.outside_with("tether", [], ("stiffness", stiff, "N/m"), ("length", slack, "m"))
    d.kinds = ("waypoints", "figure", "vertical", "waypoints")


def loose_battery(d: Draft) -> None:
    """The battery moves on rubber, up and forward, between two stops; in hover it sits where it is believed."""
    q = d.quad
    mass, reach, hz = d.rng.uniform(0.2, 0.3) * q.mass, d.size(0.03, 0.12) * q.arm, d.rng.uniform(2.0, 5.0)
    stiff = mass * (2 * np.pi * hz) ** 2
    rub = 2 * 0.1 * mass * 2 * np.pi * hz
    own = mass * (0.25 * q.arm) ** 2 / 6
    rest = -0.8 * mass * GRAVITY / stiff
    d.world.extra_bodies = (
        f'<body name="battery"><joint type="slide" axis="0.6 0 0.8" stiffness="{stiff}" damping="{rub}" '
        f'springref="{rest}" limited="true" range="{-reach} {reach}"/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{own} {own} {own}"/></body>'
    )
    d.world.mass = q.mass - mass
    d.world.inertia = q.inertia - own * np.eye(3)
    d.outside_with("loose_battery", [], ("mass", mass, "kg"), ("frequency", hz, "Hz"))
    d.kinds = ("vertical", "waypoints", "figure", "shaking")


FAMILIES = {
    "clean": clean,
    "slung_load": slung_load,
    "rigid_payload": rigid_payload,
    "off_centre": off_centre,
    "products": products,
    "rotor_drag": rotor_drag,
    "frame_drag": frame_drag,
    "steady_wind": steady_wind,
    "gust": gust,
    "ground": ground,
    "motors": motors,
    "spinning": spinning,
    "weak_rotor": weak_rotor,
    "wrong": wrong,
    "sloshing": sloshing,
    "tether": tether,
    "loose_battery": loose_battery,
}
NEED_SPEEDS = ("weak_rotor", "spinning", "products", "ground", "motors")
"""Families whose cause an autopilot's log of commands cannot be asked for."""


def drafted(family: str, seed: int, agility: float = 1.0):
    """The draft of a case, its instruments and its runs: kinds of stretches and seconds."""
    rng = np.random.default_rng([seed, 1])
    draft = Draft(vehicle.drawn(rng), rng)
    FAMILIES[family](draft)
    grades = [g for g in draft.grades if g != "log" or family not in NEED_SPEEDS]
    grade = logger.drawn(str(rng.choice(grades)), rng, draft.command)
    if grade.name == "log":
        draft.world.lag = 0.0  # commands alone: the motors follow at once, or a lag is among what is hidden
        if family != "clean" and rng.random() < 0.5:
            draft.world.lag = draft.size(0.025, 0.06)
            draft.adds("motor_lag", [("tau_up", draft.world.lag, "s"), ("tau_down", draft.world.lag, "s")])
            draft.fair = [*draft.fair, "delay"]
        draft.fair = [*draft.fair, "vibration"]
    if family == "clean":
        # a log's low-pass is late by less than a sample up to 100 Hz
        rates = [25, 50, 100] if grade.name == "log" else [25, 50, 100, 200, 250, 500, 1000]
        grade = replace(grade, rate_hz=int(rng.choice(rates)), late_steps=0)
    grade = replace(grade, groups=(*grade.groups, *draft.groups))
    runs = []
    for _ in range(int(rng.integers(3, 5))):
        kinds = tuple(rng.permutation(draft.kinds)) if draft.kinds else tuple(rng.choice(course.KINDS, 4))
        runs.append((kinds, float(rng.uniform(24, 36))))
    return draft, grade, runs


def believed(draft: Draft, rng: np.random.Generator, grade: logger.Grade) -> tuple[dict, dict]:
    """vehicle.yaml and what is wrong in it."""
    q, off = draft.quad, draft.wrong
    true = {
        "mass_kg": q.mass,
        "thrust_coefficient_n_s2": q.thrust,
        "torque_coefficient_n_m_s2": q.torque,
        **{f"inertia_{a}{a}_kg_m2": q.inertia[i, i] for i, a in enumerate("xyz")},
    }
    has = {k: v * off.get(k, 1.0) for k, v in true.items()}
    out = {
        "name": "quadrotor",
        "kind": "flight",
        "mass_kg": has["mass_kg"],
        "inertia_kg_m2": {f"{a}{a}": has[f"inertia_{a}{a}_kg_m2"] for a in "xyz"},
        "rotors": [
            {"x_m": r[0], "y_m": r[1], "z_m": r[2], "spin": "ccw" if s > 0 else "cw"}
            for r, s in zip(q.hubs, q.spin, strict=True)
        ],
        "thrust_coefficient_n_s2": has["thrust_coefficient_n_s2"],
        "torque_coefficient_n_m_s2": has["torque_coefficient_n_m_s2"],
        "gravity_m_s2": GRAVITY,
        "rotor_radius_m": q.radius,
        "ground_z_m": 0.0,
    }
    if rng.random() < 0.5:
        out["noise"] = {
            "specific_force_m_s2": grade.force,
            "angular_velocity_rad_s": grade.rate,
            "velocity_m_s": grade.velocity,
        }
    if rng.random() < 0.3:
        out["rotor_inertia_kg_m2"] = q.rotor_inertia
    return out, {k: {"believed": has[k], "true": true[k]} for k in off}


AGAIN = 50
"""First number of the paths that a case is flown along again: no case has as many runs."""


def make(family: str, seed: int):
    """The set of a family and a seed, its truth and its noise-free tables."""
    draft, grade, runs = drafted(family, seed)
    vehicle_file, off = believed(draft, np.random.default_rng([seed, 2]), grade)
    return finished(draft, grade, vehicle_file, off, *recorded(draft, grade, runs, vehicle_file, seed), seed)


def flown_again(family: str, seed: int, pace: float):
    """The runs of a case along other paths under a controller whose bandwidth is `pace` times as large, noise-free."""
    draft, grade, runs = drafted(family, seed)
    vehicle_file, _ = believed(draft, np.random.default_rng([seed, 2]), grade)
    return recorded(draft, grade, runs, vehicle_file, seed, pace, AGAIN)[1]


def recorded(draft: Draft, grade: logger.Grade, runs, vehicle_file: dict, seed: int, pace: float = 1.0, first: int = 0):
    """Tables of the runs as written, as perfect instruments would have written them, and rms values by channel.

    `pace` is the controller's bandwidth over its own, `first` numbers the paths.
    """
    quad = draft.quad
    tables, ideals, channels = {}, {}, {}
    for i, (kinds, seconds) in enumerate(runs):
        name = f"run{i + 1:02d}"
        for agility in (0.9, 0.65, 0.45):
            rng = np.random.default_rng([seed, 3, first + i])
            path = course.reference(seconds, kinds, rng, agility, floor_m=1.3 * quad.radius + 0.05)
            noise = logger.gyro_noise(len(path), grade.rate, rng)
            world = replace(draft.world, wind=draft.wind(np.arange(len(path)) * STEP, i) if draft.wind else None)
            bandwidth = pace * min(13.0, 0.4 / max(world.lag, 0.02))
            try:
                flight = fly(quad, world, path, noise, bandwidth, charge=1.0 - 0.04 * i)
                break
            except Lost:
                continue
        else:
            raise Lost(f"seed {seed}, {name}: not held in any size of flight")
        ideals[name], tables[name] = logger.record(flight, grade, quad.hover, noise, rng)
        a, b = residuals(ideals[name], vehicle_file), residuals(tables[name], vehicle_file)
        channels[name] = {
            c: {"noise_rms": rms(b[c] - a[c]), "mismatch_rms": rms(a[c]), "before_rms": rms(b[c])} for c in a
        }
    return tables, ideals, channels


def finished(draft, grade, vehicle_file, off, tables, ideals, channels, seed):
    """The recording and its truth; what is smaller than a quarter of the noise need not be found."""
    ratios = {
        c: max(run[c]["mismatch_rms"] / run[c]["noise_rms"] for run in channels.values() if run[c]["noise_rms"] > 0)
        for c in next(iter(channels.values()))
    }
    main = max(ratios, key=ratios.get)
    effects, outside = draft.effects, draft.outside
    for entry in (*effects, *outside):
        entry |= {"size_over_noise": ratios[main], "main_channel": main, "amount": 1.0}
    sealed = bool(effects or outside or off)
    verdict = ["no_mismatch"]
    if sealed:
        verdict = ["partly_explained", "unexplained"] if outside else ["explained", "partly_explained"]
    small = sealed and ratios[main] < SMALL
    if small:
        verdict = [*verdict, "no_mismatch"]
    windows = [
        {"id": "gust", "run": name, "start_s": a, "stop_s": b}
        for name, (a, b) in zip(tables, draft.times, strict=False)
    ]
    if "vibration" in draft.fair:
        verdict = list(dict.fromkeys([*verdict, "explained", "partly_explained"]))
    truth = {
        "effects": effects,
        "wrong_parameters": off,
        "outside_catalogue": outside,
        "fair": draft.fair + ([e["id"] for e in effects] if small else []),
        "fair_why": draft.fair_why,
        "need_not_be_found": small,
        "grade": grade.name,
        "locations": windows,
        "verdict": verdict,
        "oracle": {"cutoff_hz": CUTOFF_HZ, "runs": channels},
        "seed": seed,
    }
    form = ("csv", "csv.gz", "parquet")[seed % 3]
    return Recording(vehicle_file, tables, (), form), plain(truth), ideals
