"""Cases that are drawn whole from one seed: name, seed and simulator of each, for development and for a release.

`multibody/slung_load/2026-11-22/003` is number 3 of a family, drawn for the release proof of that date; its seed is a
hash of date, family and number, so that nobody has seen it before the date is chosen. With `development` in place of
the date it is one to look at while mending. A released case that was looked at is listed in `looked_at.txt`: from then
on it counts as a development case.
"""

import hashlib
import re
from pathlib import Path

from . import feedback
from .continuous import cases as continuous
from .continuous.equations import Strayed
from .multibody import cases as multibody
from .rig import cases as rig

DEVELOPMENT = "development"
NUMBERS = 4
"""Development cases listed of each family with something hidden."""
CLEAN = 40
"""And of clean ones of each simulator."""
SIMULATORS = {
    "multibody": multibody.FAMILIES,
    "continuous": continuous.FAMILIES,
    "feedback": feedback.FAMILIES,
    "bench/rig": rig.BENCH,
    "stand/rig": rig.STAND,
}
NAME = re.compile(
    r"(multibody|continuous|feedback|bench/rig|stand/rig)/(\w+)/(development|\d{4}-\d\d-\d\d|[0-9a-f]{8})/(\d{3})"
)


def seed_of(date: str, family: str, number: int) -> int:
    """Seed of a case: 48 bits of the hash of date (or `development`), family (with its simulator) and number."""
    return int(hashlib.sha256(f"{date}|{family}|{number}".encode()).hexdigest()[:12], 16)


def parts(name: str) -> tuple[str, str, str, int] | None:
    """Simulator, family, date and number of a drawn case's name; None of any other name."""
    found = NAME.fullmatch(name)
    return (found[1], found[2], found[3], int(found[4])) if found else None


def names(date: str = DEVELOPMENT) -> list[str]:
    """Names of all cases of a date: some of each family, more of the clean ones."""
    return [
        f"{simulator}/{family}/{date}/{k:03d}"
        for simulator, families in SIMULATORS.items()
        for family in families
        for k in range(CLEAN if family == "clean" else NUMBERS)
    ]


def make(name: str, seed: int):
    """The set, its truth and its noise-free tables; a vehicle that no controller holds is drawn anew."""
    simulator, family, date, number = parts(name)
    try:
        if simulator == "multibody":
            made = multibody.make(family, seed)
        elif simulator == "continuous":
            made = continuous.make(family, seed)
        elif simulator == "feedback":
            made = feedback.make(family, seed)
        else:
            made = rig.make(simulator.split("/")[0], family, seed)
    except (Strayed, feedback.Strayed):
        return make(name, seed_of(f"{seed} again", f"{simulator}/{family}", number))
    recording, truth, ideals = made
    truth["released"] = "" if date == DEVELOPMENT or name in looked_at() else date
    return recording, truth, ideals


def looked_at() -> frozenset[str]:
    """Names of released cases that somebody has looked at."""
    text = Path(__file__).with_name("looked_at.txt").read_text(encoding="utf-8")
    return frozenset(line.strip() for line in text.splitlines() if line.strip() and not line.startswith("#"))
