"""Families of benches and stands with an instrument of their own, and a set of one of them from one seed."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ..write import Recording, plain
from . import sensor

FINE = 10
GRAVITY = 9.81
SMALL = 0.3
"""Below this rms over the noise of means of ten readings (in the channel where it is largest) a cause need not be
found."""
FORCES = ("force_x_n", "force_y_n", "force_z_n")
MOMENTS = ("moment_x_n_m", "moment_y_n_m", "moment_z_n_m")
MEANS = range(1, 13)


@dataclass
class Card:
    """A case while it is drawn. `parts` change the reading, `loads` what acts on the sensor."""

    kind: str
    rng: np.random.Generator
    rate_hz: int = 100
    force_noise: float = 0.01
    moment_noise: float = 0.0006
    flicker: float = 0.0  # share of the noise that is 1/f
    parts: list = field(default_factory=list)
    changes: dict = field(default_factory=dict)
    effects: list = field(default_factory=list)
    outside: list = field(default_factory=list)
    wrong: dict = field(default_factory=dict)
    fair: list = field(default_factory=list)
    why: str = ""
    columns: tuple = ("speed",)
    lost: bool = False
    seconds: float = 45.0
    quantum: float = 0.0
    together: bool | None = None  # bench: whether the axes are loaded at once; None draws it

    def size(self, low, high):
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self):
        return float(self.rng.choice([-1, 1]))

    def signs(self, n):
        return self.rng.choice([-1.0, 1.0], n) * self.rng.uniform(0.4, 1.0, n)

    def adds(self, id, *parameters, equivalent=()):
        """Name an effect that is to be found."""
        listed = [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters]
        self.effects.append({"id": id, "form": "", "parameters": listed, "equivalent": list(equivalent)})


FULL = np.array([12.0, 12.0, 12.0, 0.6, 0.6, 0.6])
"""Range of the sensor, N and N m."""


# ---- what is hidden in a reading -------------------------------------------------------------------------------


def clean(c: Card):
    pass


def creeping(c: Card):
    total = c.size(0.004, 0.03)
    share, time = c.rng.uniform(0.5, 0.8), c.rng.uniform(5.0, 15.0)
    terms = ((total * share, time), (total * (1 - share), 4 * time))
    c.parts.append(lambda load, y, dt, i: y + sensor.standard_solid(load - load[0], terms, dt))
    c.adds("creep")
    c.fair, c.why, c.seconds = ["hysteresis"], "creep slower than a run looks like a loop", 70.0


def looping(c: Card):
    high, sharp, width = c.size(0.003, 0.02), c.rng.uniform(1.0, 2.0), c.rng.uniform(0.05, 0.2)

    def part(load, y, dt, i):
        out = y.copy()
        for k in range(y.shape[1]):
            if np.ptp(load[:, k]) > 0:
                x = load[:, k] - load[0, k]
                out[:, k] -= high / width * sensor.bouc_wen(x, FULL[k], sharp, width)
        return out

    c.parts.append(part)
    c.adds("hysteresis")
    c.fair, c.why = ["load_nonlinearity", "reading_gain"], "after each turn the loop is a little less gain"


def warming(c: Card):
    """The zero follows the cell's temperature, which follows what is switched on at the start."""
    rise, time, drift = c.rng.uniform(4, 12), c.rng.uniform(15, 60), c.signs(6)
    size = c.size(2.0, 12.0) * c.force_noise
    unit = np.array([1, 1, 1, 0.05, 0.05, 0.05]) * size * drift

    def part(load, y, dt, i):
        course = sensor.warming(np.ones(len(y)), time, dt)
        return y + course[:, None] * unit[: y.shape[1]]

    c.parts.append(part)
    c.changes["temperature"] = (rise, time)
    c.adds("zero_drift")
    c.seconds = 70.0


def bent(c: Card):
    form = int(c.rng.choice([2, 3]))
    a = c.size(0.003, 0.03) * c.signs(6)

    def part(load, y, dt, i):
        out = y.copy()
        for k in range(y.shape[1]):
            x = load[:, k] / FULL[k]
            out[:, k] += a[k] * FULL[k] * x**form
        return out

    c.parts.append(part)
    c.adds("load_nonlinearity", equivalent=["compliance"] if c.kind == "bench" else ["thrust_curve"])
    c.fair = ["reading_gain", "compliance"]
    c.why = "a bend of the cell or of the bench under it"


def leaking(c: Card):
    matrix = c.size(0.004, 0.04) * c.rng.uniform(-1, 1, (6, 6))
    matrix[:3, 3:] *= 6.0
    matrix[3:, :3] *= 0.03
    np.fill_diagonal(matrix, 0.0)
    c.parts.append(lambda load, y, dt, i: y + load @ matrix[: y.shape[1], : y.shape[1]].T)
    c.adds("crosstalk")
    c.together = True


def ringing(c: Card):
    hz, zeta = c.rng.uniform(0.07, 0.2) * c.rate_hz, c.rng.uniform(0.02, 0.08)
    c.parts.append(lambda load, y, dt, i: sensor.mode(y, hz, zeta, dt))
    c.adds("structural_resonance", ("f_n", hz, "Hz"), ("zeta", zeta, ""))


def sluggish(c: Card):
    hz, order = c.rng.uniform(0.02, 0.07) * c.rate_hz, int(c.rng.choice([2, 4]))
    c.parts.append(lambda load, y, dt, i: sensor.amplifier(y, hz, order, dt))
    c.adds("amplifier_filter")
    c.fair, c.why = ["delay"], "a Bessel filter is nearly a delay"


def untared(c: Card):
    b = c.size(2.0, 15.0) * c.force_noise * np.array([1, 1, 1, 0.05, 0.05, 0.05]) * c.signs(6)
    c.parts.append(lambda load, y, dt, i: y + b[: y.shape[1]])
    c.adds("tare_offset")


def coarse(c: Card):
    c.quantum = c.size(4.0, 12.0)
    c.adds("quantisation", ("q", c.quantum * c.force_noise, "N"))


def dropping(c: Card):
    c.lost = True
    c.adds("sensor_dropout")


def gained(c: Card):
    k = 1 + c.sign() * c.size(0.015, 0.08)
    c.parts.append(lambda load, y, dt, i: y * np.where(np.arange(y.shape[1]) < 3, k, 1.0))
    c.wrong["reading_gain"] = {"believed": 1.0, "true": k}


def mixed_bench(c: Card):
    first, second = c.rng.choice([untared, creeping, bent, leaking, looping], 2, replace=False)
    first(c)
    second(c)


def mains(c: Card):
    """Hum that leaks in and beats with the sampling: no id of the catalogue."""
    beat, size = c.rng.uniform(0.3, 2.0), c.size(3, 12) * c.force_noise
    unit = np.array([1, 1, 1, 0.05, 0.05, 0.05]) * size

    def part(load, y, dt, i):
        t = np.arange(len(y)) * dt
        return y + np.sin(2 * np.pi * beat * t + i)[:, None] * unit[: y.shape[1]]

    c.parts.append(part)
    c.outside.append({"id": "mains_hum", "acceptable": ["structural_resonance", "vibration"], "parameters": []})


BENCH = {
    "clean": clean, "creeping": creeping, "looping": looping, "warming": warming, "bent": bent, "leaking": leaking,
    "ringing": ringing, "sluggish": sluggish, "untared": untared, "coarse": coarse, "dropping": dropping,
    "gained": gained, "mixed": mixed_bench, "mains": mains,
}  # fmt: skip


# ---- what is hidden in a vehicle on a stand --------------------------------------------------------------------


def wrong(c: Card):
    name = str(c.rng.choice(["thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "mass_kg", "arm_scale"]))
    c.changes["believed"] = (name, 1 + c.sign() * c.size(0.02, 0.1))


def off_centre(c: Card):
    r = c.size(0.0015, 0.01) * c.signs(3)
    c.changes["centre"] = r
    c.adds("com_offset")


def uneven(c: Card):
    d = c.size(0.01, 0.06) * c.signs(4)
    c.changes["gain"] = 1 + d - d.mean()
    c.adds("unequal_rotors")


def lagging(c: Card):
    tau = c.size(0.03, 0.12)
    c.changes["lag"] = tau
    c.columns, c.rate_hz = ("speed", "command"), 200
    c.adds("motor_lag", ("tau", tau, "s"))


def walled(c: Card):
    c.changes["wall"] = (c.size(0.008, 0.04), c.rng.uniform(3.0, 10.0))
    c.adds("wall_interference")
    c.fair, c.why, c.seconds = ["creep"], "both settle after a change", 60.0


def cabled(c: Card):
    """A cable that stiffens with the tilt of the mount."""
    c.changes["cable"] = c.size(0.05, 0.5)
    c.adds("cable_stiffness")
    c.fair, c.why = ["mount_tilt"], "both grow with the sine of the tilt"


def misplaced(c: Card):
    c.changes["origin"] = np.array([*(c.size(0.001, 0.008) * c.signs(2)), 0.0])
    c.adds("sensor_origin")
    c.fair, c.why = ["com_offset"], "the weight's moment shifts with the origin too"


def mixed_stand(c: Card):
    first = [off_centre, uneven, misplaced][c.rng.integers(3)]
    second = [leaking, untared, creeping][c.rng.integers(3)]
    first(c)
    second(c)


STAND = {
    "clean": clean, "wrong": wrong, "off_centre": off_centre, "uneven": uneven, "lagging": lagging, "walled": walled,
    "cabled": cabled, "misplaced": misplaced, "leaking": leaking, "warming": warming, "creeping": creeping,
    "untared": untared, "sluggish": sluggish, "ringing": ringing, "dropping": dropping, "mixed": mixed_stand,
}  # fmt: skip


# ---- programmes ------------------------------------------------------------------------------------------------


def stairs(t, levels, rng):
    """Levels held for unequal times, joined by raised cosines of 0.3 s; the last level is the first."""
    cuts = np.cumsum(rng.uniform(0.6, 1.4, len(levels)))
    cuts = cuts / cuts[-1] * t[-1]
    out = np.full(len(t), float(levels[0]))
    for a, b, cut in zip(levels[:-1], levels[1:], cuts[:-1], strict=True):
        out += (b - a) * 0.5 * (1 - np.cos(np.pi * np.clip((t - cut) / 0.3, 0, 1)))
    return np.clip(out, 0, None)  # what sums of steps leave below nothing is rounding


def course(t, rng):
    """A course between 0 and 1 that starts and ends unloaded."""
    kind = rng.choice(["ladder", "stairs", "slow"])
    if kind == "ladder":
        up = np.linspace(0, 1, int(rng.integers(4, 7)))
        return stairs(t, np.concatenate([[0], up, up[::-1][1:], [0]]), rng)
    if kind == "stairs":
        return stairs(t, np.concatenate([[0], rng.uniform(0.1, 1, int(rng.integers(5, 10))), [0]]), rng)
    f = rng.uniform(0.05, 0.6, 4)
    wave = np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6.28, 4)).sum(axis=1) / 8 + 0.5
    return np.clip(wave, 0, 1) * np.clip(np.minimum(t - 2, t[-1] - 2 - t) / 2, 0, 1)


def bench_runs(c: Card, seed: int):
    """Loads (n, 3) of each run on the fine clock."""
    together = bool(c.rng.random() < 0.5) if c.together is None else c.together
    count = int(c.rng.integers(4, 6)) if together else 6
    for i in range(count):
        rng = np.random.default_rng([seed, 31, i])
        t = np.arange(int(c.seconds * c.rate_hz * FINE)) / (c.rate_hz * FINE)
        load = np.zeros((len(t), 3))
        for k in range(3) if together else (i % 3,):
            load[:, k] = (-1.0 if k == 2 else 1.0) * rng.uniform(0.5, 0.85) * FULL[k] * course(t, rng)
        yield t, load


VEHICLE = {"mass": 0.74, "thrust": 1.62e-6, "torque": 2.3e-8, "top": 1650.0, "radius": 0.0635, "origin_z": 0.045}
HUBS = np.array([[0.095, 0.08, 0.0], [0.095, -0.08, 0.0], [-0.095, -0.08, 0.0], [-0.095, 0.08, 0.0]])
SPIN = np.array([1.0, -1.0, 1.0, -1.0])
TILTS = ((0.0, 0.0), (0.26, 0.0), (0.0, 0.3), (-0.4, 0.0), (0.0, -0.35))


def leaning(roll, pitch):
    """Body into level axes."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])


def stand_wrench(speed, tilt, level, tared, changes, dt):
    """Wrench on the sensor (n, 6) of rotors at `speed` (n, 4) and of the weight."""
    v = VEHICLE
    gain = changes.get("gain", np.ones(4))
    thrust = v["thrust"] * gain * speed**2
    if "wall" in changes:
        less, settle = changes["wall"]
        stirred = np.stack([sensor.warming(column, settle, dt) for column in (speed / v["top"]).T], axis=1)
        thrust = thrust * (1 - less * stirred)
    spun = v["torque"] * gain * speed**2
    force = np.zeros((len(speed), 3))
    force[:, 2] = -thrust.sum(axis=1)
    moment = np.stack([-thrust @ HUBS[:, 1], thrust @ HUBS[:, 0], spun @ SPIN], axis=1)
    origin = np.array([0.0, 0.0, v["origin_z"]]) + changes.get("origin", np.zeros(3))
    moment = moment - np.cross(origin, force)
    body = leaning(*tilt)
    weight = body.T @ np.array([0.0, 0.0, v["mass"] * GRAVITY])
    turn = np.cross(changes.get("centre", np.zeros(3)) - origin, weight)
    if level:
        force, moment, weight, turn = force @ body.T, moment @ body.T, body @ weight, body @ turn
    out = np.concatenate([force, moment], axis=1)
    if not tared:
        out = out + np.concatenate([weight, turn])
    if "cable" in changes:
        k = changes["cable"]
        out = out + k * np.array(
            [np.sin(tilt[1]), -np.sin(tilt[0]), 0, 0.04 * np.sin(tilt[0]), 0.04 * np.sin(tilt[1]), 0]
        )
    return out


def stand_runs(c: Card, seed: int, tared: bool, level: bool):
    """Time, command and speed (n, 4), tilt, wrench of each run on the fine clock."""
    dt = 1 / (c.rate_hz * FINE)
    lag = c.changes.get("lag", 0.0)
    for i in range(5):
        rng = np.random.default_rng([seed, 31, i])
        t = np.arange(int(c.seconds * c.rate_hz * FINE)) * dt
        common = course(t, rng)
        wave = np.stack(
            [
                np.sin(2 * np.pi * f * t + p)
                for f, p in zip(rng.uniform(0.3, 3.0, 4), rng.uniform(0, 6, 4), strict=True)
            ],
            1,
        )
        top = rng.uniform(0.65, 0.9)
        command = VEHICLE["top"] * top * np.sqrt(common)[:, None] * (1 + 0.12 * wave * rng.choice([0.0, 1.0]))
        command = command * (1 + 0.08 * rng.uniform(-1, 1, 4))
        # motors: a lag; where it is not what is hidden, of 20 ms, and only speeds are recorded
        real = lag or (0.02 if "command" not in c.columns else 0.0)
        speed = np.stack([sensor.warming(x, real, dt) for x in command.T], axis=1) if real else command
        tilt = TILTS[i]
        yield t, command, speed, tilt, stand_wrench(speed, tilt, level, tared, c.changes, dt)


# ---- recording -------------------------------------------------------------------------------------------------


def rms_of_means(x, count):
    """Rms of the means of every `count` neighbours."""
    whole = x[: len(x) // count * count].reshape(-1, count)
    return float(np.sqrt(np.mean(whole.mean(axis=1) ** 2)))


def drafted(kind: str, family: str, seed: int) -> Card:
    """What is hidden and with what it is read."""
    rng = np.random.default_rng([seed, 30])
    c = Card(kind, rng)
    c.rate_hz = int(rng.choice([50, 80, 100] if kind == "bench" else [50, 100, 200]))
    c.force_noise = c.size(0.004, 0.02) * (1 if kind == "bench" else 2.5)
    c.moment_noise = c.size(0.0004, 0.0015)
    c.flicker = float(rng.choice([0.0, 0.2, 0.5]))
    (BENCH if kind == "bench" else STAND)[family](c)
    return c


def make(kind: str, family: str, seed: int):
    """The set of a family of a bench or a stand and a seed, its truth and its noise-free tables."""
    c = drafted(kind, family, seed)
    rng = np.random.default_rng([seed, 32])
    level, tared = bool(rng.random() < 0.5), bool(rng.random() < 0.3)
    if {"centre", "origin", "cable"} & set(c.changes) or family in ("mixed", "wrong"):
        tared = False
    vehicle, off = believed(c, rng, level, tared)
    channels = FORCES if kind == "bench" else (*FORCES, *MOMENTS)
    sigma = np.array([c.force_noise] * 3 + [c.moment_noise] * 3)[: len(channels)]
    dt = 1 / (c.rate_hz * FINE)
    tables, ideals, oracle, windows = {}, {}, {}, []
    runs = bench_runs(c, seed) if kind == "bench" else stand_runs(c, seed, tared, level)
    plain_vehicle = {}
    for i, made in enumerate(runs):
        name = f"run{i + 1:02d}"
        if kind == "bench":
            t, load = made
            known = {f"reference_force_{a}_n": load[:, k] for k, a in enumerate("xyz")}
            baseline = load
        else:
            t, command, speed, tilt, load = made
            known = {}
            if "speed" in c.columns:
                known |= {f"rotor_speed_{j + 1}_rad_s": speed[:, j] for j in range(4)}
            if "command" in c.columns:
                known |= {f"rotor_command_{j + 1}_rad_s": command[:, j] for j in range(4)}
            known |= {"roll_rad": np.full(len(t), tilt[0]), "pitch_rad": np.full(len(t), tilt[1])}
            baseline = stand_wrench(speed, tilt, level, tared, plain_vehicle, dt)
        reading = load.copy()
        for part in c.parts:
            reading = part(load, reading, dt, i)
        pick = slice(0, len(t), FINE)
        reading, baseline = reading[pick], baseline[pick]
        k = len(reading)
        noise = sigma * (
            np.sqrt(1 - c.flicker) * rng.standard_normal((k, len(channels)))
            + np.sqrt(c.flicker) * sensor.pink(k, len(channels), rng)
        )
        step = sigma * (c.quantum or 0.1)
        written = np.round((reading + noise) / step) * step
        table = {"time_s": t[pick]} | {n: v[pick].copy() for n, v in known.items()}
        for n in table:
            if n.startswith("rotor_speed"):
                table[n] = table[n] * (1 + 0.0005 * rng.standard_normal(k))
        if "temperature" in c.changes:
            rise, time = c.changes["temperature"]
            warm = 22.0 + rise * (1 - np.exp(-t[pick] / time))
            table["temperature_c"] = np.round(warm + 0.05 * rng.standard_normal(k), 2)
        ideal = {"time_s": t[pick]}
        for j, n in enumerate(channels):
            ideal[n], table[n] = reading[:, j], written[:, j]
        if c.lost and i == 0:
            first = int(rng.uniform(0.3, 0.6) * k)
            span = slice(first, first + int(3.0 * c.rate_hz))
            column = channels[int(np.argmax(np.ptp(load[:, :3], axis=0)))]  # one that is loaded in this run
            values = table[column].copy()
            values[span] = {0: 0.0, 1: values[first], 2: np.nan}[int(rng.integers(3))]
            table[column] = values
            windows.append(
                {"id": "sensor_dropout", "run": name, "start_s": t[pick][first], "stop_s": t[pick][first] + 3.0}
            )
        tables[name], ideals[name] = pd.DataFrame(table), pd.DataFrame(ideal)
        mismatch, left = reading - baseline, written - reading
        oracle[name] = {
            n.removesuffix("_n_m").removesuffix("_n"): {
                "noise_rms_of_means": {str(m): rms_of_means(left[:, j], m) for m in MEANS},
                "noise_rms": rms_of_means(left[:, j], 1),
                "mismatch_rms": float(np.sqrt(np.mean(mismatch[:, j] ** 2))),
            }
            for j, n in enumerate(channels)
        }
    return finished(c, vehicle, off, tables, ideals, oracle, windows, seed)


def believed(c: Card, rng, level: bool, tared: bool):
    """vehicle.yaml and what is wrong in it."""
    noise = {"force_n": c.force_noise}
    off = dict(c.wrong)
    if c.kind == "bench":
        return {"name": "bench", "kind": "bench", "tared": True, "noise": noise}, off
    v = VEHICLE
    values = {"thrust_coefficient_n_s2": v["thrust"], "torque_coefficient_n_m_s2": v["torque"], "mass_kg": v["mass"],
              "arm_scale": 1.0}  # fmt: skip
    if "believed" in c.changes:
        name, factor = c.changes["believed"]
        off[name] = {"believed": values[name] * factor, "true": values[name]}
        values[name] *= factor
    return {
        "name": "stand",
        "kind": "stand",
        "mass_kg": values["mass_kg"],
        "inertia_kg_m2": {"xx": 0.0029, "yy": 0.0033, "zz": 0.0055},
        "rotors": [
            {"x_m": x, "y_m": y, "z_m": 0.0, "spin": "ccw" if s > 0 else "cw"}
            for (x, y, _), s in zip(values["arm_scale"] * HUBS, SPIN, strict=True)
        ],
        "thrust_coefficient_n_s2": values["thrust_coefficient_n_s2"],
        "torque_coefficient_n_m_s2": values["torque_coefficient_n_m_s2"],
        "rotor_radius_m": v["radius"],
        "sensor_position_m": [0.0, 0.0, v["origin_z"]],
        "sensor_mount": "level" if level else "tilting",
        "tared": tared,
        "rotor_speed_limits_rad_s": [0.0, v["top"]],
        "noise": {**noise, "moment_n_m": c.moment_noise},
    }, off  # fmt: skip


def finished(c: Card, vehicle, off, tables, ideals, oracle, windows, seed):
    """The recording and its truth; what is much smaller than the noise need not be found."""
    ratios = {
        n: max(run[n]["mismatch_rms"] / max(run[n]["noise_rms_of_means"]["10"], 1e-12) for run in oracle.values())
        for n in next(iter(oracle.values()))
    }
    main = max(ratios, key=ratios.get)
    for entry in (*c.effects, *c.outside):
        entry |= {"size_over_noise": ratios[main], "main_channel": main, "amount": 1.0}
    sealed = bool(c.effects or c.outside or off)
    verdict = ["no_mismatch"]
    if sealed:
        verdict = ["partly_explained", "unexplained"] if c.outside else ["explained", "partly_explained"]
    # a lag shows between command and speed, steps and dropouts in the columns themselves
    small = (
        sealed and not (c.quantum or c.lost or "lag" in c.changes or "believed" in c.changes) and ratios[main] < SMALL
    )
    if small:
        verdict.append("no_mismatch")
    truth = {
        "effects": c.effects,
        "wrong_parameters": off,
        "outside_catalogue": c.outside,
        "fair": c.fair + ([e["id"] for e in c.effects] if small else []),
        "fair_why": c.why,
        "need_not_be_found": small,
        "grade": f"{c.rate_hz} Hz, {'1/f' if c.flicker else 'white'}",
        "locations": windows,
        "verdict": verdict,
        "oracle": {"cutoff_hz": 20.0, "runs": oracle},
        "seed": seed,
    }
    return Recording(vehicle, tables, (), ("csv", "csv.gz", "parquet")[seed % 3]), plain(truth), ideals
