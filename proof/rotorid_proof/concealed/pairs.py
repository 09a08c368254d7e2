"""Pairs of recordings of one vehicle, flown on other paths with other noise: between them nothing, one or two things
changed.

`make(name)` draws a pair whole from the hash of its name, `<simulator>/<seed>/<number>`: the vehicle with what is
already there in both, the instruments, and the changes.
"""

import hashlib
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from .continuous import cases as continuous
from .continuous import craft as crafts
from .continuous.equations import Strayed
from .continuous.instruments import Kit
from .multibody import cases as multibody
from .multibody import course, logger, vehicle
from .multibody.engine import Lost
from .write import Recording, plain

SMALL = 0.25
"""Below this rms over the noise (in the channel where it is largest) a change need not be found."""
RATIOS = {
    "mass_kg": "thrust_coefficient_n_s2",
    "thrust_coefficient_n_s2": "mass_kg",
    "torque_coefficient_n_m_s2": "inertia_zz_kg_m2",
    "inertia_zz_kg_m2": "torque_coefficient_n_m_s2",
}
"""Values of which a flight shows little but the ratio."""
RUNS, RUN_S = 3, 25.0


@dataclass(frozen=True)
class Pair:
    """Two sets of one vehicle, and what is otherwise in the second."""

    base: Recording
    new: Recording
    truth: dict
    """`changes`: id, parameters, equivalent ids, `need_not_be_found`; `fair`: ids that are no wrong names."""


def names(seed: str, count: int) -> list[str]:
    """Names of the first pairs of each simulator that a seed (a commit's hash) draws."""
    return [f"{simulator}/{seed}/{k:03d}" for k in range(count) for simulator in MAKERS]


def make(name: str) -> Pair:
    """The pair of a name; a vehicle that no controller holds is drawn anew."""
    simulator, _, _ = name.split("/")
    drawn = f"pair|{name}"
    while True:
        try:
            return MAKERS[simulator](int(hashlib.sha256(drawn.encode()).hexdigest()[:12], 16))
        except (Lost, Strayed):
            drawn += "|again"


def drawn_families(rng: np.random.Generator, families: tuple[str, ...]) -> list[str]:
    """Nothing in three of ten pairs, two changes in three of twenty, else one; two weak rotors are one change."""
    count = int(rng.choice(3, p=(0.3, 0.55, 0.15)))
    chosen = [str(f) for f in rng.choice(families, count, replace=False)]
    return chosen if set(chosen) <= {"value"} else list(dict.fromkeys(chosen))


def other_value(body, rng: np.random.Generator):
    """A vehicle with one number 4 to 15 per cent larger or smaller, the name of that number, and the factor."""
    while True:
        name = str(rng.choice(VALUES))
        factor = 1 + float(rng.choice([-1, 1])) * float(np.exp(rng.uniform(np.log(0.04), np.log(0.15))))
        changed = with_value(body, name, factor)
        a, b, c = np.linalg.eigvalsh(changed.inertia)
        if a + b > c:  # no body has another
            return changed, name, factor


def with_value(body, name: str, factor: float):
    """A vehicle with one of its numbers multiplied."""
    if name.startswith("inertia"):
        i = "xyz".index(name[8])
        turn = np.ones(3)
        turn[i] = np.sqrt(factor)
        return replace(body, inertia=body.inertia * np.outer(turn, turn))
    short = {"mass_kg": "mass", "thrust_coefficient_n_s2": "thrust", "torque_coefficient_n_m_s2": "torque"}[name]
    return replace(body, **{short: getattr(body, short) * factor})


VALUES = (
    "mass_kg",
    "thrust_coefficient_n_s2",
    "torque_coefficient_n_m_s2",
    "inertia_xx_kg_m2",
    "inertia_yy_kg_m2",
    "inertia_zz_kg_m2",
)


def truth_of(effects: list[dict], factors: dict[str, float], fair: list[str], hidden: list[str], **more) -> dict:
    """What changed, in the form of `Pair.truth`; ids in `hidden` are too small that they had to be found."""
    values = [
        {
            "id": name,
            "parameters": [{"symbol": name, "value": factor - 1, "unit": "1"}],
            "equivalent": [RATIOS[name]] if name in RATIOS else [],
        }
        for name, factor in factors.items()
    ]
    changes = [{**c, "need_not_be_found": c["id"] in hidden} for c in (*effects, *values)]
    return plain({"changes": changes, "fair": fair, **more})


def with_drags_added(draft: multibody.Draft) -> list[dict]:
    """Effects of a vehicle, each rotor drag with the whole k_d: one by speed and one by thrust act together."""
    q, world = draft.quad, draft.world
    whole = world.drag_speed + world.drag_thrust * q.mass * multibody.GRAVITY / 4 / q.hover
    return [
        {**e, "parameters": [{**p, "value": whole} for p in e["parameters"]]} if e["id"] == "rotor_drag" else e
        for e in draft.effects
    ]


def beyond(base: list[dict], new: list[dict]) -> list[dict]:
    """Effects of the second set that the first has not, or by how much their parameters are more."""
    before = {(e["id"], p["symbol"]): p["value"] for e in base for p in e["parameters"]}
    return [
        {
            **e,
            "parameters": [
                {**p, "value": p["value"] - before.get((e["id"], p["symbol"]), 0.0)} for p in e["parameters"]
            ],
        }
        for e in new[len(base) :]
    ]


def small(channels: dict) -> bool:
    """Whether a mismatch is below a quarter of the noise in every channel of every run."""
    ratios = [c["mismatch_rms"] / max(c["noise_rms"], 1e-12) for run in channels.values() for c in run.values()]
    return max(ratios) < SMALL


# --- MuJoCo ----------------------------------------------------------------------------------------------------------

BOTH_OF_MULTIBODY = ("clean", "rotor_drag", "frame_drag")
CHANGES_OF_MULTIBODY = (
    "value", "value", "rigid_payload", "slung_load", "off_centre", "products", "weak_rotor", "weak_rotor", "rotor_drag",
    "spinning", "lag",
)  # fmt: skip
LAG_S = 0.022


def slower(draft: multibody.Draft) -> None:
    """Motors that follow their commands more slowly."""
    draft.world.lag *= draft.size(1.3, 2.2)
    draft.adds("motor_lag", [("tau_up", draft.world.lag - LAG_S, "s"), ("tau_down", draft.world.lag - LAG_S, "s")])


@dataclass(frozen=True)
class Multibody:
    """A vehicle that MuJoCo flies, with its loggers."""

    seed: int
    quad: vehicle.Quad
    grade: logger.Grade

    def draft_of(self, families: dict[int, str]) -> tuple[multibody.Draft, dict[str, float]]:
        """The vehicle with some families of changes, by the number that each is drawn with; factors of its values."""
        draft, factors = multibody.Draft(self.quad, np.random.default_rng([self.seed, 52])), {}
        if "command" in self.grade.groups:
            draft.world.lag = LAG_S
        for k, family in families.items():
            draft.rng = np.random.default_rng([self.seed, 53, k, len(family)])
            if family == "value":
                draft.quad, name, factor = other_value(draft.quad, draft.rng)
                factors[name] = factor
            else:
                (slower if family == "lag" else multibody.FAMILIES[family])(draft)
        return draft, factors

    def flights(self, draft: multibody.Draft, file: dict, number: int, count: int = RUNS):
        """Runs on drawn paths, and what the changes amount to in each channel."""
        own = np.random.default_rng([self.seed, 54, number])
        runs = [(tuple(own.choice(course.KINDS, 4)), RUN_S) for _ in range(count)]
        return multibody.recorded(draft, self.grade, runs, file, self.seed + number)


def pair_of_multibody(seed: int) -> Pair:
    """A pair on MuJoCo."""
    rng = np.random.default_rng([seed, 51])
    quad = vehicle.drawn(rng)
    both, changes = str(rng.choice(BOTH_OF_MULTIBODY)), drawn_families(rng, CHANGES_OF_MULTIBODY)
    grade = logger.drawn(str(rng.choice(["lab", "lab", "tele"])), rng, command="lag" in changes or rng.random() < 0.3)
    own = Multibody(seed, quad, grade)
    base, _ = own.draft_of({0: both})
    new, factors = own.draft_of(dict(enumerate([both, *changes])))
    file, _ = multibody.believed(base, np.random.default_rng([seed, 2]), grade)
    hidden = []
    for k, family in enumerate(changes, start=1):
        alone, own_factors = own.draft_of({k: family})
        if small(own.flights(alone, file, 1, 1)[2]):
            hidden += [*(e["id"] for e in alone.effects), *own_factors]
    return Pair(
        base=Recording(file, own.flights(base, file, 0)[0], form="parquet"),
        new=Recording(file, own.flights(new, file, 1)[0], form="parquet"),
        truth=truth_of(
            beyond(with_drags_added(base), with_drags_added(new)),
            factors,
            new.fair,
            hidden,
            both=both,
            families=changes,
            grade=grade.name,
        ),
    )


@dataclass(frozen=True)
class Flown:
    """A vehicle over its flights."""

    flights: tuple[Recording, ...]
    since: int | None
    """Number of the first flight with the change, None where nothing changes."""
    truth: dict
    """As `Pair.truth`."""


EVENTS = ("value", "value", "rigid_payload", "off_centre", "weak_rotor")


def flown(name: str, flights: int, good: int) -> Flown:
    """Some flights of the vehicle `<seed>/<number>`; with an odd number one thing changes after the `good` first ones.

    The vehicle's `vehicle.yaml` stays the same.
    """
    seed = int(hashlib.sha256(f"fleet|{name}".encode()).hexdigest()[:12], 16)
    rng = np.random.default_rng([seed, 55])
    own = Multibody(seed, vehicle.drawn(rng), logger.drawn(str(rng.choice(["lab", "tele"])), rng, command=False))
    both = str(rng.choice(BOTH_OF_MULTIBODY))
    events = [str(rng.choice(EVENTS))] if int(name.rsplit("/")[-1]) % 2 else []
    since = int(rng.integers(good, flights)) if events else None
    base, _ = own.draft_of({0: both})
    new, factors = own.draft_of(dict(enumerate([both, *events])))
    file, _ = multibody.believed(base, np.random.default_rng([seed, 2]), own.grade)

    def flight(k: int) -> Recording:
        draft = new if since is not None and k >= since else base
        return Recording(file, own.flights(draft, file, k, 1)[0], form="parquet")

    truth = truth_of(beyond(with_drags_added(base), with_drags_added(new)), factors, new.fair, [], families=events)
    return Flown(tuple(flight(k) for k in range(flights)), since, truth)


# --- differential equations ------------------------------------------------------------------------------------------

BOTH_OF_CONTINUOUS = ("clean", "frame", "blades")
CHANGES_OF_CONTINUOUS = (
    "value", "value", "frame", "flapping", "damping", "tilted", "off_centre", "uneven", "uneven", "accelerometer",
    "gyroscope", "lever_arm", "late", "skewed", "mistaken", "lag",
)  # fmt: skip


def slower_motors(sheet: continuous.Sheet) -> None:
    """Motors that follow their commands more slowly."""
    before = sheet.nature.lag
    sheet.nature.lag *= sheet.size(1.3, 2.2)
    more = sheet.nature.lag - before
    sheet.adds("motor_lag", ("tau_up", more, "s"), ("tau_down", more, "s"))


def pair_of_continuous(seed: int) -> Pair:
    """A pair by differential equations."""
    rng = np.random.default_rng([seed, 61])
    craft = crafts.drawn(rng)
    both, changes = str(rng.choice(BOTH_OF_CONTINUOUS)), drawn_families(rng, CHANGES_OF_CONTINUOUS)
    noise = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6))))
    command = "lag" in changes or rng.random() < 0.3
    groups = ("speed", *(("command",) if command else ()), *continuous.POSE)
    rate = int(rng.choice([100, 200, 250])) if "late" not in changes else 250
    kit = Kit("capture", rate, groups, 0.0005 * noise, 0.015 * noise, 0.0012 * noise, 0.008 * noise, 0.12 * noise,
              0.003 * noise)  # fmt: skip
    styles = tuple(rng.permutation(["sprint", "spin", "stir", "survey"])[:RUNS])

    def sheet_of(families: dict[int, str]) -> tuple[continuous.Sheet, Kit, dict[str, float]]:
        sheet, factors = continuous.Sheet(craft, np.random.default_rng([seed, 62])), {}
        sheet.nature.lag = craft.lag_s
        apply: dict[str, Callable] = {**continuous.FAMILIES, "lag": slower_motors}
        for k, family in families.items():
            sheet.rng = np.random.default_rng([seed, 63, k, len(family)])
            if family == "value":
                sheet.craft, name, factor = other_value(sheet.craft, sheet.rng)
                factors[name] = factor
            else:
                apply[family](sheet)
        own = {k: v for k, v in sheet.kit.items() if k != "late_s"}
        if "late_s" in sheet.kit:
            own["fraction"] = sheet.kit["late_s"] * kit.rate_hz
        sheet.styles = styles
        return sheet, replace(kit, **own), factors

    base, kit_of_base, _ = sheet_of({0: both})
    new, kit_of_new, factors = sheet_of(dict(enumerate([both, *changes])))
    file, _ = continuous.believed(base, np.random.default_rng([seed, 22]), kit)
    hidden = []
    for k, family in enumerate(changes, start=1):
        alone, own_kit, own_factors = sheet_of({k: family})
        alone.styles = styles[:1]
        if not alone.edits and small(continuous.recorded(alone, own_kit, file, seed + 1)[2]):
            hidden += [*(e["id"] for e in alone.effects), *own_factors]
    return Pair(
        base=Recording(file, continuous.recorded(base, kit_of_base, file, seed)[0], form="parquet"),
        new=Recording(turned(file, new.edits), continuous.recorded(new, kit_of_new, file, seed + 1)[0], form="parquet"),
        truth=truth_of(
            beyond(base.effects, new.effects), factors, new.fair, hidden, both=both, families=changes, grade=kit.name
        ),
    )


def turned(file: dict, edits: list[str]) -> dict:
    """The vehicle file with the spins reversed where that is the mistake of the second set."""
    out = deepcopy(file)
    if "spin" in edits:
        for rotor in out["rotors"]:
            rotor["spin"] = "cw" if rotor["spin"] == "ccw" else "ccw"
    return out


MAKERS = {"multibody": pair_of_multibody, "continuous": pair_of_continuous}
