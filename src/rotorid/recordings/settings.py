"""What an autopilot's parameters were in the logs of a set, kept next to its runs, and where two sets differ."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_METADATA, read_text
from rotorid.io.text.writing import write_texts

FILE = "autopilot_parameters.json"
Settings = Mapping[str, float | str]
"""Parameters by name."""
_COUNTED = re.compile(
    r"STAT_\w+|LND_FLIGHT_T_\w+|COM_FLIGHT_UUID|SYS_\w*UUID|(BARO\d*|GND)_(GND|ABS)_(PRESS|TEMP)\w*|"
    r"(Log start|Firmware) \w+|deviceUID|Device UID|.*DEV_?ID"
)
"""What is counted, measured at the start or numbers a part: no setting of a person."""


@dataclass(frozen=True)
class Differing:
    """A parameter that the logs in question have otherwise than the good ones."""

    name: str
    good: tuple[float | str, ...]
    """Its values in the good logs, each once; empty where none states it."""
    new: tuple[float | str, ...]

    @property
    def sentence(self) -> str:
        """`MC_ROLL_P: 6.5 in the good logs, now 7.2`."""
        return f"{self.name}: {_words(self.good)} in the good logs, now {_words(self.new)}"


def write_settings(folder: Path, settings: Mapping[str, Settings]) -> None:
    """Write down the parameters of each log (by its name) next to what is known of a set's other logs."""
    known = {name: dict(own) for name, own in settings.items() if own}
    if known:
        write_texts({folder / FILE: json.dumps(read_settings(folder) | known, indent=1, sort_keys=True)})


def read_settings(folder: Path) -> dict[str, Settings]:
    """The parameters of each log of a set; empty where they are not known.

    InputError where the file is none of ours.
    """
    path = folder / FILE
    if not path.is_file():
        return {}
    try:
        found = json.loads(read_text(path, LARGEST_METADATA))
        if all(isinstance(v, int | float | str) for own in found.values() for v in own.values()):
            return found
    except (ValueError, AttributeError):
        pass
    raise InputError(f"{path}: expected the parameters of each log by name; move the file away")


def differing(good: Iterable[Settings], new: Iterable[Settings]) -> tuple[Differing, ...]:
    """Parameters of which a log in question has a value that no good log has, by name.

    Empty where one side states none: a log without parameters says nothing of them.
    """
    good, new = ([own for own in side if own] for side in (good, new))
    if not good or not new:
        return ()
    out = []
    for name in sorted({name for own in (*good, *new) for name in own}):
        before, after = ([own[name] for own in side if name in own] for side in (good, new))
        if _COUNTED.fullmatch(name) or (before and after and all(any(_same(a, b) for b in before) for a in after)):
            continue
        out.append(Differing(name, _each_once(before), _each_once(after)))
    return tuple(sorted(out, key=lambda d: (not d.good or not d.new, d.name)))


def differing_sentences(found: tuple[Differing, ...], most: int) -> list[str]:
    """A sentence a parameter that both sides state, at most so many; then how many more, and which one side lacks."""
    if not found:
        return []
    changed = [d for d in found if d.good and d.new]
    out = [f"Parameters of the autopilot that differ: {len(changed)}."] if changed else []
    out += [f"  {d.sentence}" for d in changed[:most]]
    if len(changed) > most:
        out.append(f"  and {len(changed) - most} more (--json has all)")
    lost, gained = ([d.name for d in found if not side(d)] for side in (lambda d: d.new, lambda d: d.good))
    for names, words in ((lost, "only the good logs state"), (gained, "only the new log states")):
        if names:
            shown = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
            out.append(f"Parameters that {words}: {len(names)} ({shown}).")
    return out


def _same(a: float | str, b: float | str) -> bool:
    same = 1e-6  # Share within which two numbers are one: they were logged with seven digits.
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return math.isclose(a, b, rel_tol=same) or (math.isnan(a) and math.isnan(b))


def _each_once(values: Iterable[float | str]) -> tuple[float | str, ...]:
    out: list[float | str] = []
    for value in values:
        if not any(_same(value, known) for known in out):
            out.append(value)
    return tuple(out)


def _words(values: tuple[float | str, ...]) -> str:
    return " or ".join(v if isinstance(v, str) else f"{v:.7g}" for v in values) or "not stated"
