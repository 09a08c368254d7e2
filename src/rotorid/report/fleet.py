"""A fleet: verdicts on many sets, their tables and page (one HTML file), and each vehicle over its flights.

Many sets are judged by one process: Python starts once, a set that fails costs only itself. Each is judged in a process
of its own, branched off after everything is imported (which takes milliseconds), so that neither a fault nor the memory
of one reaches the next. A verdict is remembered by the content of its set and the code that judged it: a batch that was
broken off, or is cut anew because sets were added, judges nothing twice. A set that could not be read, or whose process
was killed, is not remembered: another day it may end otherwise.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import re
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml
from rotorid.io.text.writing import copy_together, only_writer, staging, take_name
from rotorid.mismatch.changes.level_one import (
    FALSE_ALARMS,
    Difference,
    as_one,
    differences,
    differences_at,
    measured,
    of_one_vehicle,
    usual_scatter,
)
from rotorid.mismatch.changes.quantities import Flown, flown, grid_of
from rotorid.mismatch.changes.words import difference_words, in_unit_of_words, quantity_words, unit_of
from rotorid.recordings import RecordingSet, read_set
from rotorid.recordings.templates import read
from rotorid.report.deliver import FILES, OTHERS, deliver
from rotorid.report.page import drawing, drawn, filled
from rotorid.steps import one_thread
from rotorid.vehicle.control import swings

_NUMBERS = ("vehicle", "set", "day", "good", "name", "quantity", "unit", "change", "low_95", "high_95", "limit")
EVENTS = ("vehicle", "set", "day", "id", "lasts", "sentence")
_Z95 = 1.96
FAILED = "failed.json"
"""What stands in its place where there is none: `reason`, and `fault` where it is none of the set's."""
_SHOWN = ("established", "ambiguous", "suggested")
"""Words of effects that a summary counts; what is absorbed or not established shows nothing."""
_DATE = re.compile(r"(?<!\d)(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])(?!\d)")
"""A day in the name of a set: 2026-11-22, 2026_11_22 or 20261122."""


def judge_sets(
    folders: Sequence[Path], code: str, out: Path, memory: Path, progress: Callable[[str], None] = lambda text: None
) -> None:
    """Judge sets of different names: `out/<set>/` each, with the files of its verdict or `failed.json`.

    `memory` is the folder that remembers verdicts by content and `code`, the hash of the code that judges. `progress`
    gets one line a set. OSError: the disk is full, or the like, no fault of a set; what was judged before stays
    remembered.
    """
    # Sets to judge from which on it pays to load beforehand what every one of them would load by itself.
    worth_a_start = 4
    out.mkdir(parents=True, exist_ok=True)
    places = {folder: memory / code / content_of(folder) for folder in folders}
    if sum(not known.is_dir() for known in places.values()) >= worth_a_start:
        _load()
    for folder, known in places.items():
        start = time.monotonic()
        if known.is_dir():
            _hand_over(known, out / folder.name)
        else:
            _judge_apart(folder, known, out / folder.name)
        failed = " (failed)" if (out / folder.name / FAILED).is_file() else ""
        progress(f"{folder.name}: {time.monotonic() - start:.1f} s{failed}")


def content_of(folder: Path) -> str:
    """Sixteen hexadecimal digits that stand for a set: its name and every file in it."""
    whole = hashlib.sha256(folder.name.encode())
    for path in sorted(p for p in folder.iterdir() if p.is_file()):
        with open(path, "rb") as file:
            whole.update(f"\n{path.name} {hashlib.file_digest(file, 'sha256').hexdigest()}".encode())
    return whole.hexdigest()[:16]


def _load() -> None:
    """Judge a short flight made up for it, so that modules, compiled code and fonts are there in every branch.

    They are two fifths of what a short set costs.
    """
    made_up = swings(read("thesis"), "first", 3.0, 2, 1)
    with tempfile.TemporaryDirectory() as folder:
        deliver(made_up, Path(folder))


def _judge_apart(folder: Path, known: Path, out: Path) -> None:
    """Judge a set in a process of its own; results appear as the folder `known`, whole or not at all, and in `out`."""
    with staging(known) as part:
        context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
        process = context.Process(target=_judge_one, args=(folder, part))
        process.start()
        process.join()
        if process.exitcode == _DISK:
            raise OSError(f"{folder.name}: {(part / FAILED).read_text(encoding='utf-8')}")
        if process.exitcode not in (0, _UNREADABLE):
            _write_failure(part, f"its process ended by signal or exit code {process.exitcode}", fault=True)
        _hand_over(part, out)
        # Another batch may have judged the same set meanwhile.
        with only_writer(known.parent):
            if process.exitcode == 0 and not known.is_dir():
                take_name(part, known)


def _hand_over(judged: Path, out: Path) -> None:
    """Copy the files of a judged set, or why there are none."""
    first = FILES[0] if (judged / FILES[0]).is_file() else FAILED
    copy_together(judged, out, first, (*FILES, *OTHERS, FAILED))


_DISK, _UNREADABLE = 74, 66
"""Exit codes of a process that could not write, and of one that could not read its set (sysexits.h)."""


def _judge_one(folder: Path, target: Path) -> None:
    """The files of a set's verdict, or why there are none, into `target`."""
    try:
        recordings = read_set(folder)
    except OSError as error:
        _write_failure(target, str(error), fault=False)
        sys.exit(_UNREADABLE)
    except InputError as error:
        _write_failure(target, str(error), fault=False)
        return
    try:
        deliver(recordings, target)
    except InputError as error:
        _write_failure(target, str(error), fault=False)
    except OSError as error:
        (target / FAILED).write_text(str(error), encoding="utf-8")
        sys.exit(_DISK)
    except Exception as error:  # any fault of the stage costs this set alone
        traceback.print_exc()
        _write_failure(target, f"{type(error).__name__}: {error}", fault=True)


def _write_failure(target: Path, reason: str, fault: bool) -> None:
    for name in FILES:
        (target / name).unlink(missing_ok=True)
    text = json.dumps({"reason": reason, "fault": fault}, indent=1, ensure_ascii=False) + "\n"
    (target / FAILED).write_text(text, encoding="utf-8")


def collect(folders: Sequence[Path], recordings: Path) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Tables of sets, of effects in sets and of parameters in sets.

    `folders`: one a set, with its verdict or `failed.json`; `recordings`: that of the sets, for their vehicles' names.

    Returns
    -------
    sets
        One row a set: `set`, `vehicle`, `day` (of the set's name, empty where it has none), `verdict`,
        `unexplained` (share), `effects`, `person` (why a person should look, empty where nobody need), `sentence`.
    effects
        One row a set and effect that shows: `set`, `vehicle`, `day`, `effect`, `status`, `share`.
    parameters
        One row a set and number: `set`, `vehicle`, `day`, `parameter`, `unit`, `value`, `low_95`, `high_95`, `status`.
    """
    rows, effects, parameters = [], [], []
    for folder in sorted(folders, key=lambda path: path.name):
        own = {"set": folder.name, "vehicle": _vehicle(recordings / folder.name), "day": day_of(folder.name)}
        if (folder / FAILED).is_file():
            reason = json.loads((folder / FAILED).read_text(encoding="utf-8"))
            what = "a fault of rotorid" if reason["fault"] else "the set cannot be judged"
            rows.append(own | {"verdict": "failed", "effects": "", "person": what, "sentence": reason["reason"]})
            continue
        verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
        found = [e for e in verdict["effects"] if e["status"] in _SHOWN]
        shown = " ".join(e["id"] for e in found if e["status"] != "suggested")
        own_row = {"verdict": verdict["verdict"], "unexplained": verdict["unexplained"]["share"], "effects": shown}
        rows.append(own | own_row | {"person": "; ".join(_reasons(verdict)), "sentence": verdict["sentence"]})
        effects += [own | {"effect": e["id"], "status": e["status"], "share": e["share"]} for e in found]
        parameters += [own | row for row in _numbers(verdict, found)]
    return (
        pd.DataFrame(rows, columns=[*_OWN, "verdict", "unexplained", "effects", "person", "sentence"]),
        pd.DataFrame(effects, columns=[*_OWN, "effect", "status", "share"]),
        pd.DataFrame(parameters, columns=[*_OWN, *_STATED]),
    )


_OWN = ("set", "vehicle", "day")
_STATED = ("parameter", "unit", "value", "low_95", "high_95", "status")


def _reasons(verdict: dict[str, Any]) -> list[str]:
    """Why a person should look at a verdict; nothing where it stands by itself."""
    out = []
    if verdict["verdict"] == "not_judged":
        out.append("not judged: " + "; ".join(d["sentence"].rstrip(".") for d in verdict["doubts"] if d["stops"]))
    elif verdict["verdict"] == "unexplained":
        out.append("a mismatch that nothing of the catalogue explains")
    elif verdict["verdict"] == "partly_explained":
        out.append(f"{verdict['unexplained']['share']:.0%} of the mismatch unexplained")
    for status, words in (("ambiguous", "cannot be distinguished from another cause"), ("suggested", "only suggested")):
        named = [e["id"] for e in verdict["effects"] if e["status"] == status]
        if named:
            out.append(f"{words}: {', '.join(named)}")
    kinds = {name: effect.kind for name, effect in catalogue().items()}
    wrong = [e["id"] for e in verdict["effects"] if e["status"] == "established" and kinds.get(e["id"]) == "mistake"]
    if wrong:
        out.append(f"a mistake in the set: {', '.join(wrong)}")
    return out


def by_effect(effects: pd.DataFrame, sets: pd.DataFrame) -> pd.DataFrame:
    """One row an effect: in how many sets and vehicles it is `established`, `ambiguous`, `suggested`, and its median
    `share` of the error that goes; the most frequent first."""
    rows = []
    for name, own in effects.groupby("effect"):
        counts = [int((own["status"] == status).sum()) for status in _SHOWN]
        surely = own[own["status"] == "established"]
        rows.append((name, *counts, surely["vehicle"].nunique(), surely["share"].median()))
    table = pd.DataFrame(rows, columns=["effect", *_SHOWN, "vehicles", "share"])
    table.insert(1, "of_sets", int((sets["verdict"] != "failed").sum()))
    return table.sort_values([*_SHOWN, "effect"], ascending=[False] * 3 + [True], ignore_index=True)


def by_vehicle(effects: pd.DataFrame, sets: pd.DataFrame) -> pd.DataFrame:
    """One row a vehicle: `vehicle`, `sets`, `failed`, `person` (how many need one), `effects` (established, and in how
    many sets, the most frequent first), `last` (verdict of its last set by day and name)."""
    sure = effects[effects["status"] == "established"]
    rows = []
    for name, own in sets.sort_values(["day", "set"]).groupby("vehicle"):
        counts = sure.loc[sure["vehicle"] == name, "effect"].value_counts()
        ordered = sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
        failed, person = int((own["verdict"] == "failed").sum()), int((own["person"] != "").sum())
        found = ", ".join(f"{effect} {count}" for effect, count in ordered)
        rows.append((name, len(own), failed, person, found, own["verdict"].iloc[-1]))
    return pd.DataFrame(rows, columns=["vehicle", "sets", "failed", "person", "effects", "last"])


def day_of(name: str) -> str:
    """Day in the name of a set as YYYY-MM-DD, else empty."""
    found = _DATE.search(name)
    return "-".join(found.groups()) if found else ""


def _numbers(verdict: dict[str, Any], found: Sequence[dict[str, Any]]):
    """Every number that a verdict states with an interval."""
    for effect in found:
        for p in effect["parameters"]:
            name = f"{effect['id']}.{p['symbol']}"
            yield dict(zip(_STATED, (name, p["unit"], p["value"], *p["interval_95"], effect["status"]), strict=True))
    for name, value in verdict["parameters"].items():
        yield dict(zip(_STATED, (name, "", value["refitted"], *value["interval_95"], "wrong value"), strict=True))


def _vehicle(folder: Path) -> str:
    """Name of a set's vehicle, else the set's own."""
    try:
        return str(read_yaml(folder / "vehicle.yaml")["name"])
    except (InputError, KeyError):
        return folder.name


def vehicle_page(vehicle: str, numbers: pd.DataFrame, events: pd.DataFrame) -> str:
    """The page of one vehicle with its figure, from its rows of the tables of `history`."""
    from rotorid.report.plots.mismatch import draw_vehicle

    return filled(
        "vehicle.html",
        vehicle=vehicle,
        sets=list(dict.fromkeys(numbers["set"])),
        events=events.to_dict("records"),
        figure=drawn(draw_vehicle, numbers, events),
    )


def make_page(
    name: str,
    sets: pd.DataFrame,
    counts: pd.DataFrame,
    fleet: pd.DataFrame,
    links: dict[str, str],
    figure: Path,
    history: tuple[pd.DataFrame, Path] | None = None,
) -> str:
    """The page of a fleet from its tables (`rotorid.report.fleet`); `links` lead to each set's own page.

    `history` are the events of `rotorid.report.fleet` and their figure, where they were asked for.
    """
    rows = [{**row, "link": links.get(row["set"], "")} for row in sets.to_dict("records")]
    words = sets["verdict"].value_counts()
    return filled(
        "fleet.html",
        name=name,
        total=len(sets),
        vehicles=sets["vehicle"].nunique(),
        words=", ".join(f"{count} {word.replace('_', ' ')}" for word, count in sorted(words.items())),
        people=int((sets["person"] != "").sum()),
        figure=drawing(figure),
        history=drawing(history[1]) if history else "",
        events=history[0].to_dict("records") if history else [],
        counts=counts.to_dict("records"),
        fleet=fleet.to_dict("records"),
        looked=[row for row in rows if row["person"]],
        alone=[row for row in rows if not row["person"]],
    )


def sets_of_vehicles(
    folders: Sequence[Path], progress: Callable[[str], None] = lambda text: None
) -> dict[str, list[RecordingSet]]:
    """Sets of flights by the name of their vehicle, each in the order of its days, then of its names.

    A set that cannot be read, or is none of flights, is left out; `progress` gets a line that says so.
    """
    out: dict[str, list[RecordingSet]] = {}
    for folder in sorted(folders, key=lambda f: (day_of(f.name), f.name)):
        try:
            own = read_set(folder)
        except InputError as error:
            progress(f"{folder.name} is left out: {error}")
            continue
        if own.vehicle.kind == "flight":
            out.setdefault(own.vehicle.name, []).append(own)
    return out


@one_thread()
def history(
    sets: Mapping[str, Sequence[RecordingSet]], good: int, left_out: Callable[[str], None] = lambda text: None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Numbers and events of every vehicle, by sets in the order they were flown, of which the first `good` surely are.

    `left_out` gets a line for each vehicle and each set that is left out.

    Returns
    -------
    numbers
        One row a set and quantity: `vehicle`, `set`, `day`, `good` (1 of the first ones), `name`, `quantity` in words,
        `unit`, `change` against the mean of the good ones, `low_95`, `high_95` by the set's own pieces and the scatter
        from flight to flight, `limit` that the mean of the later sets must pass to be stated in 19 of 20 histories.
    events
        One row a quantity that differs from a set on: `vehicle`, `set`, `day`, `id` of the quantity, `lasts` (how many
        sets there are from this one to the next event), `sentence`.
    """
    numbers, events = [], []
    for vehicle, own in sets.items():
        if len(own) <= good:
            continue
        try:
            own = of_one_vehicle(own)
            as_one(own[:good])
            shown = shown_by(own, good, lambda text, v=vehicle: left_out(f"{v}: {text}"))
        except InputError as error:
            left_out(f"{vehicle} is left out: {error}")
            continue
        numbers += _numbers_of(vehicle, shown, good)
        for name, lasts, differing in change_points(shown, good):
            head = {"vehicle": vehicle, "set": name, "day": day_of(name), "lasts": lasts}
            on = f"{vehicle}, from {name} on: "
            events += [head | {"id": d.quantity.key, "sentence": on + difference_words(d)} for d in differing]
    return pd.DataFrame(numbers, columns=_NUMBERS), pd.DataFrame(events, columns=EVENTS)


_Shown = Mapping[str, Sequence[Flown]]
"""What the runs of each set show, in the order they were flown; each set counts as one flight."""


def shown_by(sets: Sequence[RecordingSet], good: int, left_out: Callable[[str], None]) -> _Shown:
    """What each set shows; one that lacks something that the good ones have is left out, with a line.

    Raises InputError: a good set has no stretch of flight that is long enough.
    """
    first = tuple(sets[:good])
    grid, out, needed = grid_of(first), {}, set()
    for k, own in enumerate(sets):
        runs = [flown(run, own.vehicle, grid) for run in own.runs] if grid_of((*first, own)).like(grid) else []
        runs = [run for run in runs if run is not None]
        if k < good:
            if not runs:
                raise InputError(f"set {own.name}: no stretch of flight is long enough; expected some seconds")
            needed |= set(runs[0].y)
        elif not runs or any(needed - set(run.y) for run in runs):
            left_out(f"{own.name} is left out: it lacks flight or columns that the first sets have")
            continue
        out[own.name] = runs
    return out


def change_points(shown: _Shown, good: int) -> list[tuple[str, int, tuple[Difference, ...]]]:
    """The sets from which on something differs, in their order, in how many sets it lasts, and what differs.

    Each splits the history in two parts, looked at again. The false alarms of a vehicle are those of all sets at which
    it may have changed. A further change needs as many good sets before it as the first one.
    """
    names = list(shown)
    places = range(good, len(names))
    if not places:
        return []
    numbers = measured(list(shown.values()))
    differing = {k: differences_at(k, numbers, names, usual_scatter()) for k in places}
    stated_at = {k: tuple(d for d in found if d.false_alarms * len(places) <= FALSE_ALARMS)
                 for k, found in differing.items()}  # fmt: skip
    if not any(stated_at.values()):
        return []

    def rarity(k: int) -> tuple[float, float]:
        """The rarest first; of those that are equally rare, by their size."""
        rarest = stated_at[k][0]
        return rarest.false_alarms, -abs(rarest.value) / rarest.sd

    k = min(filter(stated_at.get, places), key=rarity)
    stated = stated_at[k]
    before, after = ({n: shown[n] for n in part} for part in (names[:k], names[k:]))
    earlier, later = change_points(before, good), change_points(after, good)
    first = list(after).index(later[0][0]) if later else len(after)
    return [*earlier, (names[k], first, stated), *later]


def _numbers_of(vehicle: str, shown: _Shown, good: int) -> list[dict]:
    """Rows of every quantity of all sets."""
    first, later = dict(list(shown.items())[:good]), dict(list(shown.items())[good:])
    if not later:
        return []
    out = []
    for d in differences(first, later, usual_scatter()):
        middle = sum(f.value for f in d.good) / len(d.good)
        for place, f in enumerate((*d.good, *d.new)):
            reach = _Z95 * (d.scatter**2 * (1.0 + 1.0 / len(d.good)) + f.sd**2) ** 0.5
            ends = (f.value - middle, f.value - middle - reach, f.value - middle + reach)
            change, low, high, limit = (in_unit_of_words(d, end) for end in (*ends, d.smallest))
            row = {"vehicle": vehicle, "set": f.name, "day": day_of(f.name), "good": int(place < len(d.good))}
            row |= {"name": d.quantity.key, "quantity": quantity_words(d), "unit": unit_of(d)}
            out.append(row | {"change": change, "low_95": low, "high_95": high, "limit": limit})
    return out
