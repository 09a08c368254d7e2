"""Which concealed cases a proof takes, in which batches, and about how long that lasts. Light: read at every start.

The list of all cases is `proof/rotorid_proof/concealed/cases.tsv` (`case`, `set`, the recording set's name that says
nothing). The first part of a case's name is its family (of an instrument the first two: `stand-clean`), its last number
the seed. Cases drawn whole from a seed (`multibody/slung_load/development/003`) are the family `multibody`, clean ones
`multibody-clean`; a release draws the same ones anew, with its date in place of `development`.
"""

from __future__ import annotations

import csv
import difflib
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.wording import listed

BUILD_S, JUDGE_S, PEERS_S, START_S = 6.0, 8.0, 3.0, 4.0
"""Usual seconds of one core: to fly and record a case, to judge it, to ask the peers, to start a job."""
INSTRUMENT_S = 2.5
"""The same to record and judge a case of a stand or a bench, of which no peer is asked."""
INSTRUMENTS = ("stand", "bench")
DRAWN = ("multibody", "continuous", "feedback", "stand-rig", "bench-rig")
"""Simulators whose cases are drawn whole from one seed."""
DEVELOPMENT = "/development/"
MADE = Path("results/proof")
"""Where the workflow itself makes the tables of a proof."""


@dataclass(frozen=True)
class Entry:
    """One concealed case of the list."""

    case: str
    set: str

    @cached_property
    def family(self) -> str:
        """Kind of case: `single`, `clean`, `stand-clean`, ..."""
        first, second, *rest = self.case.split("/")
        family = f"{first}-{second}" if first in INSTRUMENTS else first
        if family not in DRAWN:
            return family
        return f"{family}-clean" if (rest[0] if first in INSTRUMENTS else second) == "clean" else family

    @property
    def is_flight(self) -> bool:
        """Whether the case is of a vehicle that flies."""
        return self.case.split("/")[0] not in INSTRUMENTS

    @property
    def seed(self) -> int:
        """Number of the repetition; seeds below n are taken where n repetitions are asked for."""
        return int(self.case.rsplit("/", 1)[1])


def read_index(path: Path) -> list[Entry]:
    """All concealed cases, in their order."""
    with path.open(encoding="utf-8", newline="") as text:
        return [Entry(row["case"], row["set"]) for row in csv.DictReader(text, delimiter="\t")]


def choose(entries: Sequence[Entry], seeds: Mapping[str, int], patterns: Sequence[str]) -> list[Entry]:
    """Cases whose seed lies below the number for their family (0 for one not named) and whose name fits a pattern."""
    return [
        e for e in entries if e.seed < seeds.get(e.family, 0) and any(fnmatch(e.case, pattern) for pattern in patterns)
    ]


def spread(entries: Sequence[Entry], count: int) -> list[Entry]:
    """So many of the cases, evenly over the list, which is in the order of its families."""
    if count >= len(entries):
        return list(entries)
    return [entries[k * len(entries) // count] for k in range(count)]


def check_families(entries: Sequence[Entry], seeds: Mapping[str, int], key: str = "proof.seeds") -> None:
    """InputError where `seeds` names a family that is not there, or asks for more repetitions than one has.

    A misspelled family would leave its cases out. `key` is where the configuration holds `seeds`.
    """
    families = list(dict.fromkeys(e.family for e in entries))
    for family, repetitions in seeds.items():
        if family not in families:
            close = difflib.get_close_matches(family, families, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(families)}."
            raise InputError(f"config.yaml: {key}.{family} is no family of concealed cases; {hint}")
        most = 1 + max(e.seed for e in entries if e.family == family)
        if repetitions > most:
            raise InputError(
                f"config.yaml: {key}.{family} is {repetitions}, expected at most {most}, all that there are"
            )


def check_patterns(names: Sequence[str], patterns: Sequence[str], key: str) -> None:
    """InputError where a pattern of the configuration's `key` fits none of the names."""
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in names):
            raise InputError(
                f"config.yaml: {key} has {pattern!r}, expected a pattern that fits a name, as {names[0]!r}"
            )


def check_chosen(chosen: Sequence[Entry], drawn: Sequence[Entry], date: str) -> None:
    """InputError where a proof's settings leave no case at all, or none of the release that they name a date of."""
    if date and not drawn:
        raise InputError(
            f"config.yaml: proof.release is {date!r}, but proof.released and proof.cases leave no case of it; "
            "expected a family of 1 or more in proof.released whose cases fit a pattern in proof.cases"
        )
    if not chosen and not drawn:
        raise InputError(
            "config.yaml: proof.seeds and proof.cases leave no case; expected a family of 1 or more in proof.seeds "
            "whose cases fit a pattern in proof.cases"
        )


def check_tables(folder: str, names: Sequence[str]) -> None:
    """InputError where `proof.tables` is no folder with these tables; results/proof, which is made, may lack them."""
    if Path(folder) == MADE:
        return
    if not Path(folder).is_dir():
        raise InputError(
            f"config.yaml: proof.tables is {folder!r}, expected a folder: docs/proof, or results/proof, which is made"
        )
    if lacking := [name for name in names if not (Path(folder) / name).is_file()]:
        raise InputError(f"config.yaml: proof.tables is {folder!r}, a folder that lacks {listed(lacking)}")


def released(entries: Sequence[Entry], date: str) -> list[Entry]:
    """The drawn cases of the list as a release of this date draws them; none without a date.

    Their sets are named when they are recorded, from seeds that hang on the date.
    """
    drawn = [e for e in entries if DEVELOPMENT in e.case] if date else []
    return [replace(e, case=e.case.replace(DEVELOPMENT, f"/{date}/"), set="") for e in drawn]


def batches(entries: Sequence[Entry], size: int) -> dict[str, list[Entry]]:
    """Cases in batches of one family, lower seeds first, each named by what is in it.

    With more seeds asked for, full batches keep their name and are not judged again; a batch that holds other cases has
    another name, so what was judged under another plan is never taken for it.
    """
    out: dict[str, list[Entry]] = {}
    for family in dict.fromkeys(e.family for e in entries):
        own = sorted((e for e in entries if e.family == family), key=lambda e: e.seed)
        for start in range(0, len(own), size):
            part = own[start : start + size]
            content = hashlib.sha256("\n".join(e.case for e in part).encode()).hexdigest()[:8]
            out[f"{family}-{start // size:03d}-{content}"] = part
    return out


def estimate_s(missing: Sequence[Sequence[Entry]], peers: bool, cores: int = 2) -> float:
    """About how many seconds the missing batches last."""
    flight = BUILD_S + JUDGE_S + (PEERS_S if peers else 0.0)
    each = sum(flight if entry.is_flight else INSTRUMENT_S for own in missing for entry in own)
    return (each + len(missing) * (3 if peers else 2) * START_S) / cores


def announcement(chosen: Mapping[str, Sequence[Entry]], done: Sequence[str], peers: bool) -> str:
    """One line for the person who waits: how many cases, how many done, about how long."""
    missing = [name for name in chosen if name not in done]
    cases = sum(len(own) for own in chosen.values())
    left = sum(len(chosen[name]) for name in missing)
    minutes = estimate_s([chosen[name] for name in missing], peers) / 60
    return (
        f"Proof: {cases} concealed cases in {len(chosen)} batches, {cases - left} judged before; "
        f"about {minutes:.0f} minutes on two cores"
    )
