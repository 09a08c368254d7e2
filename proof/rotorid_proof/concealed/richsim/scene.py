"""From a plan to a recording set and its truth: fly every run, hide the causes, size them by the noise."""

import zlib
from dataclasses import asdict, dataclass, field, replace

import numpy as np
import pandas as pd

from ..residuals import CUTOFF_HZ, residuals, rms
from ..write import Recording, plain
from . import flight as flying
from . import manoeuvres, sensors
from .hidden import CAUSES, MISTAKES, OUTSIDE, Hidden, World
from .programmes import programme
from .vehicles import AIRFRAMES, Airframe


@dataclass(frozen=True)
class Run:
    purpose: str
    duration_s: float


@dataclass(frozen=True)
class Plan:
    """All that defines a simulated recording set besides its seed."""

    vehicle: str = "thesis"
    rate_hz: float = 250.0
    groups: tuple[str, ...] = ("speed", "position", "velocity", "attitude", "rates", "force")
    runs: tuple[Run, ...] = (Run("rich", 25.0), Run("rich", 25.0), Run("rich", 25.0))
    noise: sensors.Noise = field(default_factory=sensors.Noise)
    hidden: tuple[Hidden, ...] = ()
    wrong: tuple[tuple[str, float], ...] = ()  # name of vehicle.yaml, believed over true
    late_fraction: float = 0.0  # motor columns late by this part of a sample: a nuisance, not a finding
    flown_for_hz: float | None = None  # flown as for this rate of recording; None: as for `rate_hz`
    jitter_s: float = 0.0
    trim_s: float = 0.0  # left out at both ends of a flight
    pose_every: int = 1
    held_out: bool = False
    form: str = "csv"
    noise_hint: float | None = 1.0  # factor on the `noise:` entry of vehicle.yaml; None leaves it out
    believes: tuple[str, ...] = ("rotor_radius_m",)  # optional keys of vehicle.yaml to write
    equivalent: tuple[tuple[str, ...], ...] = ()  # sets of names that these data cannot distinguish


def _rng(seed: int, *labels) -> np.random.Generator:
    return np.random.default_rng([seed, *(zlib.crc32(str(x).encode()) for x in labels)])


def _references(plan: Plan, airframe: Airframe, seed: int):
    rate_hz = plan.flown_for_hz or plan.rate_hz
    slow = rate_hz < 120
    out = []
    for i, run in enumerate(plan.runs):
        rng = _rng(seed, "flight", i)
        segments, altitude = programme(run.purpose, run.duration_s, airframe, rng, slow)
        top = float(np.clip(rate_hz / 20, 2.5, 8.0))
        out.append(manoeuvres.build(segments, altitude, airframe.step_s, airframe.n, rng, top_hz=top))
    return out


def _world(airframe: Airframe, hidden, amounts, seed: int) -> tuple[World, list]:
    world = World.clean(airframe)
    truths = []
    for h, amount in zip(hidden, amounts, strict=True):
        truths.append(CAUSES[h.id].apply(world, amount, h, _rng(seed, h.id, h.form)))
    return world, truths


def _needs(hidden) -> tuple[Hidden, ...]:
    """Causes that must act too for the hidden ones to show (a wind shows through drag), where not listed."""
    listed = {h.id for h in hidden}
    names = dict.fromkeys(
        n for h in hidden for n in CAUSES[h.id].needs if n not in listed and "frame_drag" not in listed
    )
    return tuple(Hidden(n) for n in names)


def _fly(plan: Plan, airframe: Airframe, world: World, reference, i: int, seed: int):
    wind = sum((blow(reference.time_s) for blow in world.winds), np.zeros((len(reference.time_s), 3)))
    ring = None
    if world.ring:
        rng = _rng(seed, "ring", i)
        raw = rng.standard_normal((len(reference.time_s), airframe.n))
        a = np.exp(-2 * np.pi * 4.0 * airframe.step_s)
        ring = sensors.lfilter([1 - a], [1, -a], raw, axis=0)
        ring = sensors.lfilter([1 - a], [1, -a], ring, axis=0)
        ring /= ring.std()
    values = flying.tuned(world.values, plan.flown_for_hz or plan.rate_hz)
    charge = 0.9 - world.discharge * (0.16 * i + 0.02 * _rng(seed, "charge", i).random())
    return manoeuvres.flown(lambda r: flying.fly(airframe, values, r, wind, ring, charge), reference)


def _edit(table: pd.DataFrame, edits, run_index: int, start_s: float, n: int) -> pd.DataFrame:
    """Do to a table what a mistaken logger or user would have done."""
    table = table.copy()
    for e in edits:
        if e["kind"] == "swap":
            i, j = e["rotors"]
            for form in ("rotor_speed_{}_rad_s", "rotor_command_{}_rad_s", "throttle_{}"):
                a, b = form.format(i), form.format(j)
                if a in table:
                    table[[a, b]] = table[[b, a]].to_numpy()
        elif e["kind"] == "scale":
            columns = e.get("columns") or [c for c in table if c.startswith(e["prefix"])]
            table[columns] *= e["factor"]
        elif e["kind"] == "dropout" and (e["runs"] is None or run_index in e["runs"]):
            t = table["time_s"].to_numpy() - start_s
            inside = (t >= e["windows"][0]) & (t <= e["windows"][1])
            rotor = 1 + e["draw"] % n
            column = [
                c for c in (f"rotor_speed_{rotor}_rad_s", "specific_force_x_m_s2", "velocity_x_m_s") if c in table
            ][0]
            if e["form"] == "zero":
                table.loc[inside, column] = 0.0
            elif e["form"] == "hold":
                table.loc[inside, column] = table[column].to_numpy()[max(int(np.argmax(inside)) - 1, 0)]
            else:
                table.loc[inside, column] = np.nan
    return table


def _believed(plan: Plan, airframe: Airframe, world: World) -> tuple[dict, dict]:
    """vehicle.yaml as the user believes it, and the wrong values in it."""
    factors = dict(plan.wrong)
    arm = factors.get("arm_scale", 1.0)
    spin = [int(s) for s in airframe.spin]
    for e in world.file_edits:
        if e["kind"] == "spin":
            for r in e["rotors"]:
                spin[r - 1] *= -1
    truth = {
        "mass_kg": airframe.mass_kg,
        "thrust_coefficient_n_s2": airframe.thrust_coefficient,
        "torque_coefficient_n_m_s2": airframe.torque_coefficient,
        **{f"inertia_{k}_kg_m2": v for k, v in zip(("xx", "yy", "zz"), airframe.inertia_kg_m2, strict=True)},
        "arm_scale": 1.0,
    }
    belief = {k: v * factors.get(k, 1.0) for k, v in truth.items()}
    vehicle = {
        "name": airframe.name,
        "kind": "flight",
        "mass_kg": belief["mass_kg"],
        "inertia_kg_m2": {k: belief[f"inertia_{k}_kg_m2"] for k in ("xx", "yy", "zz")},
        "rotors": [
            {"x_m": p[0] * arm, "y_m": p[1] * arm, "z_m": p[2], "spin": "ccw" if s > 0 else "cw"}
            for p, s in zip(airframe.positions_m, spin, strict=True)
        ],
        "thrust_coefficient_n_s2": belief["thrust_coefficient_n_s2"],
        "torque_coefficient_n_m_s2": belief["torque_coefficient_n_m_s2"],
        "gravity_m_s2": airframe.gravity_m_s2,
    }
    if "throttle" in plan.groups:
        vehicle["rotor_speed_limits_rad_s"] = [0.0, world.believed_limit or airframe.max_speed_rad_s]
    optional = {
        "rotor_radius_m": airframe.rotor_radius_m,
        "rotor_inertia_kg_m2": airframe.rotor_inertia_kg_m2,
        "ground_z_m": 0.0,
    }
    vehicle |= {k: optional[k] for k in plan.believes if k in optional}
    if plan.noise_hint is not None:
        hint = plan.noise_hint
        vehicle["noise"] = {
            "specific_force_m_s2": plan.noise.specific_force_m_s2 * hint,
            "angular_velocity_rad_s": plan.noise.angular_velocity_rad_s * hint,
            "rotor_speed_relative": plan.noise.rotor_speed_relative * hint,
            "velocity_m_s": plan.noise.velocity_m_s * hint,
        }
    if "trust" in plan.believes:
        vehicle["trust"] = {"mass_kg": 0.005, "thrust_coefficient_n_s2": 0.05}
    wrong = {k: {"believed": belief[k], "true": truth[k]} for k in factors}
    if world.believed_limit:
        wrong["rotor_speed_limits_rad_s"] = {
            "believed": world.believed_limit,
            "true": airframe.max_speed_rad_s,
        }
    return vehicle, wrong


def _record(plan, airframe, world, flight, i, seed, start_s=0.0):
    late = world.errors.get("late_motor_s", 0.0) + plan.late_fraction / plan.rate_hz
    errors = sensors.Errors(**(world.errors | {"late_motor_s": late}))
    layout = sensors.Layout(plan.rate_hz, plan.groups, start_s, plan.jitter_s, plan.pose_every, 0.15 + plan.trim_s)
    ideal, written = sensors.record(
        flight, layout, plan.noise, errors, airframe.max_speed_rad_s, _rng(seed, "noise", i)
    )
    edits = world.file_edits
    return tuple(_edit(x, edits, i, start_s, airframe.n) for x in (ideal, written))


def _silent(plan, airframe, causes, amounts, reference, seed) -> dict[str, np.ndarray]:
    """Residuals of the first run without noise, wrong values or clock trouble."""
    plain_plan = replace(plan, wrong=(), late_fraction=0.0, jitter_s=0.0)
    world, _ = _world(airframe, causes, amounts, seed)
    vehicle, _ = _believed(plain_plan, airframe, world)
    flight = _fly(plan, airframe, world, reference, 0, seed)
    return residuals(_record(plain_plan, airframe, world, flight, 0, seed)[0], vehicle)


def _noise_rms(plan, airframe, reference, seed) -> dict[str, float]:
    """What noise alone leaves in each channel of the first run, nothing hidden."""
    plain_plan = replace(plan, wrong=(), late_fraction=0.0, jitter_s=0.0)
    world = World.clean(airframe)
    vehicle, _ = _believed(plain_plan, airframe, world)
    flight = _fly(plan, airframe, world, reference, 0, seed)
    ideal, written = (residuals(x, vehicle) for x in _record(plain_plan, airframe, world, flight, 0, seed))
    return {c: rms(written[c] - ideal[c]) for c in ideal}


def _sized(plan, airframe, references, seed) -> list[dict]:
    """The amount of each hidden cause: as asked, or such that it stands at the wanted size over the noise.

    The size is the effect's rms over the noise's in the channel where that ratio is largest, both below the cutoff.
    """
    noise = _noise_rms(plan, airframe, references[0], seed)
    out: dict[str, dict] = {}
    # what others need comes first, so that a wind is sized with the drag through which it acts
    for h in sorted(plan.hidden, key=lambda h: len(CAUSES[h.id].needs)):
        if h.id in MISTAKES or h.id == "sensor_dropout":
            out[h.id] = {"amount": 1.0, "size": None, "channel": None}
            continue
        low, high = CAUSES[h.id].bounds
        needs = CAUSES[h.id].needs
        through = [x for x in plan.hidden if needs and x.id in out and x.id in (*needs, "frame_drag")]
        base = tuple(through) or _needs((h,))
        amounts = tuple(out[b.id]["amount"] if b.id in out else 1.0 for b in base)
        without = _silent(plan, airframe, base, amounts, references[0], seed)

        def over_noise(amount, h=h, base=base, amounts=amounts, without=without):
            found = _silent(plan, airframe, (*base, h), (*amounts, amount), references[0], seed)
            ratios = {c: rms(found[c] - without[c]) / noise[c] for c in noise if noise[c] > 0}
            main = max(ratios, key=ratios.get)
            return ratios[main], main

        amount = h.amount
        ratio, main = np.nan, None
        for _ in range(5):
            try:
                ratio, main = over_noise(amount)
            except RuntimeError:  # too much to fly with: less of it
                if h.size is None:
                    raise
                amount = max(low, amount / 4)
                continue
            if h.size is None or abs(np.log(max(ratio, 1e-9) / h.size)) < 0.1:
                break
            step = h.size / max(ratio, 1e-6)
            new = float(np.clip(amount * step, max(low, amount / 8), min(high, amount * 8)))
            if new == amount:
                break
            amount = new
        else:
            ratio, main = over_noise(amount)
        out[h.id] = {"amount": amount, "size": ratio, "channel": main}
    return [out[h.id] for h in plan.hidden]


def _intervals(mask, time_s, start_s, join_s=0.5) -> list[tuple[float, float]]:
    """Spans of time in which `mask` holds, gaps below `join_s` closed."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    spans = [[time_s[a] + start_s, time_s[min(b, len(time_s) - 1)] + start_s] for a, b in edges.reshape(-1, 2)]
    joined: list[list[float]] = []
    for s in spans:
        if joined and s[0] - joined[-1][1] < join_s:
            joined[-1][1] = s[1]
        else:
            joined.append(s)
    return [(round(a, 3), round(b, 3)) for a, b in joined]


def _locations(hidden, flights, names, starts) -> list[dict]:
    out = []
    for h in hidden:
        for i, (f, name, start) in enumerate(zip(flights, names, starts, strict=True)):
            if h.id in ("gust", "sensor_dropout"):
                if h.runs is None or i in h.runs or h.id == "gust":
                    out.append(
                        {
                            "id": h.id,
                            "run": name,
                            "start_s": h.window[0] + start,
                            "stop_s": h.window[1] + start,
                        }
                    )
                continue
            mask = {
                "ground_effect": f.ground_gain > 0.01,
                "command_saturation": f.saturated,
                "vortex_ring": f.in_ring,
            }.get(h.id)
            if mask is not None:
                out += [
                    {"id": h.id, "run": name, "start_s": a, "stop_s": b} for a, b in _intervals(mask, f.time_s, start)
                ]
    return out


def make(plan: Plan, seed: int) -> tuple[Recording, dict, dict[str, pd.DataFrame]]:
    """The set, its truth, and the noise-free tables of its runs."""
    airframe = AIRFRAMES[plan.vehicle]
    references = _references(plan, airframe, seed)
    sizes = _sized(plan, airframe, references, seed)
    extra = _needs(plan.hidden)
    hidden = (*plan.hidden, *extra)
    amounts = [*(s["amount"] for s in sizes), *(1.0 for _ in extra)]
    world, parameters = _world(airframe, hidden, amounts, seed)
    vehicle, wrong = _believed(plan, airframe, world)
    true_plan = replace(plan, wrong=())
    true_vehicle, _ = _believed(true_plan, airframe, world)
    runs, ideals, flights, starts, names = {}, {}, [], [], []
    channels: dict[str, dict] = {}
    for i, reference in enumerate(references):
        name = f"run{i + 1:02d}"
        start = float(np.round(_rng(seed, "start", i).uniform(0, 50), 3)) if seed % 2 else 0.0
        flight = _fly(plan, airframe, world, reference, i, seed)
        ideal, written = _record(plan, airframe, world, flight, i, seed, start)
        runs[name], ideals[name] = written, ideal
        flights.append(flight)
        starts.append(start)
        names.append(name)
        with_truth, with_noise = residuals(ideal, vehicle), residuals(written, vehicle)
        channels[name] = {
            c: {
                "noise_rms": rms(with_noise[c] - with_truth[c]),
                "mismatch_rms": rms(with_truth[c]),
                "before_rms": rms(with_noise[c]),
            }
            for c in with_truth
        }
    effects = []
    for k, h in enumerate(hidden):
        if h.id in OUTSIDE:
            continue
        size = sizes[k] if k < len(sizes) else {"amount": 1.0, "size": None, "channel": None}
        effects.append(
            {
                "id": h.id,
                "form": h.form,
                "parameters": [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters[k]],
                "size_over_noise": size["size"],
                "main_channel": size["channel"],
                "amount": size["amount"],
                "equivalent": sorted({x for group in plan.equivalent if h.id in group for x in group if x != h.id}),
            }
        )
    outside = [
        {
            "id": h.id,
            "acceptable": list(CAUSES[h.id].acceptable),
            "size_over_noise": sizes[k]["size"],
            "main_channel": sizes[k]["channel"],
            "parameters": [{"symbol": s, "value": v, "unit": u} for s, v, u in parameters[k]],
        }
        for k, h in enumerate(plan.hidden)
        if h.id in OUTSIDE
    ]
    if outside:
        verdict = ["partly_explained", "unexplained"]
        if all((x["size_over_noise"] or 0) < 0.3 for x in outside):  # once a revolution: above the cutoff
            verdict += ["no_mismatch", "explained"]
    elif effects or wrong:
        verdict = ["explained"]
        shown = [
            v["mismatch_rms"] / v["noise_rms"] for r in channels.values() for v in r.values() if v["noise_rms"] > 0
        ]
        if max(shown) < 0.08 or (sizes and not wrong and all((x["size"] or 9) < 0.08 for x in sizes)):
            verdict = ["no_mismatch", "explained"]
    else:
        verdict = ["no_mismatch"]
    truth = {
        "effects": effects,
        "wrong_parameters": wrong,
        "outside_catalogue": outside,
        "locations": _locations(hidden, flights, names, starts),
        "verdict": verdict,
        "oracle": {"cutoff_hz": CUTOFF_HZ, "runs": channels},
        "plan": asdict(plan),
        "seed": seed,
    }
    recording = Recording(vehicle, runs, (names[-1],) if plan.held_out and len(names) > 1 else (), plan.form)
    return recording, plain(truth), ideals
