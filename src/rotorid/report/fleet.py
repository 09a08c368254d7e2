"""Tables of a fleet: which sets show which effect, each parameter over time, which verdicts need a person; its page.

The page is one HTML file that needs no other but the verdicts that it links to.

Verdicts on many recording sets in one process: Python starts once, a set that fails costs only itself.

Each set is judged in a process of its own, branched off after everything is imported (which takes milliseconds), so
that neither a fault nor the memory of one reaches the next. A verdict is remembered by the content of its set and the
code that judged it: a batch that was broken off, or is cut anew because sets were added, judges nothing twice. A set
that could not be read, or whose process was killed, is not remembered: another day it may end otherwise.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml
from rotorid.recordings import read_set
from rotorid.recordings.templates import read
from rotorid.report.deliver import deliver
from rotorid.report.page.make import drawing, filled
from rotorid.vehicle.control.swings import swings

FILES = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
"""What a verdict consists of."""
FAILED = "failed.json"
"""What stands in its place where there is none: `reason`, and `fault` where it is none of the set's."""
_WORTH_A_START = 4
"""Sets to judge from which on it pays to load beforehand what every one of them would load by itself."""
_SHOWN = ("established", "ambiguous", "suggested")
"""Words of effects that a summary counts; what is absorbed or not established shows nothing."""
_DATE = re.compile(r"(?<!\d)(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])(?!\d)")
"""A day in the name of a set: 2026-11-22, 2026_11_22 or 20261122."""


def judge_sets(
    folders: Sequence[Path], code: str, out: Path, memory: Path, progress: Callable[[str], None] = lambda text: None
) -> None:
    """Judge sets: `out/<set>/` each, with the files of its verdict or `failed.json`.

    Parameters
    ----------
    folders
        Folders of the sets; their names must differ.
    code
        Hash of the code that judges.
    out
        Folder of the results.
    memory
        Folder that remembers verdicts by content and code.
    progress
        Called with one line a set.

    Raises
    ------
    OSError
        The disk is full, or the like: no fault of a set. What was judged before stays remembered.
    """
    out.mkdir(parents=True, exist_ok=True)
    places = {folder: memory / code / content_of(folder) for folder in folders}
    if sum(not known.is_dir() for known in places.values()) >= _WORTH_A_START:
        _load()
    for folder, known in places.items():
        start = time.monotonic()
        if known.is_dir():
            shutil.copytree(known, out / folder.name, dirs_exist_ok=True)
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
        deliver(made_up, *(Path(folder) / name for name in FILES[:3]))


def _judge_apart(folder: Path, known: Path, out: Path) -> None:
    """Judge a set in a process of its own; results appear as the folder `known`, whole or not at all, and in `out`."""
    part = known.with_name(f".{known.name}.{os.getpid()}.part")
    # Nobody else judges this set: what lies here was left by a process that was killed.
    for left in known.parent.glob(f".{known.name}.*.part"):
        shutil.rmtree(left, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
        process = context.Process(target=_judge_one, args=(folder, part))
        process.start()
        process.join()
        if process.exitcode == _DISK:
            raise OSError(f"{folder.name}: {(part / FAILED).read_text(encoding='utf-8')}")
        if process.exitcode not in (0, _UNREADABLE):
            _write_failure(part, f"its process ended by signal or exit code {process.exitcode}", fault=True)
        shutil.copytree(part, out, dirs_exist_ok=True)
        if process.exitcode == 0 and not known.is_dir():
            os.replace(part, known)
    finally:
        shutil.rmtree(part, ignore_errors=True)


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
        deliver(recordings, *(target / name for name in FILES[:3]))
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

    Parameters
    ----------
    folders
        One folder a set, with its verdict or `failed.json`.
    recordings
        Folder of the sets themselves, for the names of their vehicles.

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
        rows.append(
            own
            | {
                "verdict": verdict["verdict"],
                "unexplained": verdict["unexplained"]["share"],
                "effects": " ".join(e["id"] for e in found if e["status"] != "suggested"),
                "person": "; ".join(_reasons(verdict)),
                "sentence": verdict["sentence"],
            }
        )
        effects += [own | {"effect": e["id"], "status": e["status"], "share": e["share"]} for e in found]
        parameters += [own | row for row in _numbers(verdict, found)]
    return (
        pd.DataFrame(rows, columns=[*_OWN, "verdict", "unexplained", "effects", "person", "sentence"]),
        pd.DataFrame(effects, columns=[*_OWN, "effect", "status", "share"]),
        pd.DataFrame(parameters, columns=[*_OWN, "parameter", "unit", "value", "low_95", "high_95", "status"]),
    )


_OWN = ("set", "vehicle", "day")


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
        counts = {status: int((own["status"] == status).sum()) for status in _SHOWN}
        surely = own[own["status"] == "established"]
        rows.append(
            {"effect": name, **counts, "vehicles": surely["vehicle"].nunique(), "share": surely["share"].median()}
        )
    table = pd.DataFrame(rows, columns=["effect", *_SHOWN, "vehicles", "share"])
    judged = int((sets["verdict"] != "failed").sum())
    table.insert(1, "of_sets", judged)
    return table.sort_values([*_SHOWN, "effect"], ascending=[False] * 3 + [True], ignore_index=True)


def by_vehicle(effects: pd.DataFrame, sets: pd.DataFrame) -> pd.DataFrame:
    """One row a vehicle: `vehicle`, `sets`, `failed`, `person` (how many need one), `effects` (established, and in how
    many sets, the most frequent first), `last` (verdict of its last set by day and name)."""
    sure = effects[effects["status"] == "established"]
    rows = []
    for name, own in sets.sort_values(["day", "set"]).groupby("vehicle"):
        counts = sure.loc[sure["vehicle"] == name, "effect"].value_counts()
        ordered = sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
        rows.append(
            {
                "vehicle": name,
                "sets": len(own),
                "failed": int((own["verdict"] == "failed").sum()),
                "person": int((own["person"] != "").sum()),
                "effects": ", ".join(f"{effect} {count}" for effect, count in ordered),
                "last": own["verdict"].iloc[-1],
            }
        )
    return pd.DataFrame(rows, columns=["vehicle", "sets", "failed", "person", "effects", "last"])


def day_of(name: str) -> str:
    """Day in the name of a set as YYYY-MM-DD, else empty."""
    found = _DATE.search(name)
    return "-".join(found.groups()) if found else ""


def _numbers(verdict: dict[str, Any], found: Sequence[dict[str, Any]]):
    """Every number that a verdict states with an interval."""
    for effect in found:
        for p in effect["parameters"]:
            low, high = p["interval_95"]
            yield {
                "parameter": f"{effect['id']}.{p['symbol']}",
                "unit": p["unit"],
                "value": p["value"],
                "low_95": low,
                "high_95": high,
                "status": effect["status"],
            }
    for name, value in verdict["parameters"].items():
        low, high = value["interval_95"]
        yield {
            "parameter": name,
            "unit": "",
            "value": value["refitted"],
            "low_95": low,
            "high_95": high,
            "status": "wrong value",
        }


def _vehicle(folder: Path) -> str:
    """Name of a set's vehicle, else the set's own."""
    try:
        return str(read_yaml(folder / "vehicle.yaml")["name"])
    except (InputError, KeyError):
        return folder.name


def make_vehicle_page(vehicle: str, numbers: pd.DataFrame, events: pd.DataFrame, figure: Path) -> str:
    """The page of one vehicle from its rows of the tables of `rotorid.report.fleet_history`, and their figure."""
    sets = list(dict.fromkeys(numbers["set"]))
    return filled(
        "vehicle.html",
        vehicle=vehicle,
        sets=len(sets),
        first=sets[0],
        last=sets[-1],
        events=events.to_dict("records"),
        figure=drawing(figure),
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

    `history` are the events of `rotorid.report.fleet_history` and their figure, where they were asked for.
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
