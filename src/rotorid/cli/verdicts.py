"""`rotorid verdict`: what the believed vehicle leaves out, from a recording set or straight from logs.

`rotorid compare`: what changed from one set of a vehicle, a stand or a bench to another.
"""

from __future__ import annotations

import json
import math
import re
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from rotorid.cli.console import keep, one_sentence, progress, read_record
from rotorid.cli.junit import as_junit
from rotorid.cli.sets import Like, MappingFile, MassKg, Quiet, Stated, VehicleFile, log_by_log, name_of, set_of
from rotorid.errors import InputError
from rotorid.io.text.writing import write_texts
from rotorid.steps import step

if TYPE_CHECKING:
    from rotorid.mismatch.changes.compare import Changes
    from rotorid.mismatch.tell.verdict import Verdict
    from rotorid.recordings import RecordingSet
    from rotorid.recordings.settings import Differing, Settings

JunitFile = Annotated[Path | None, typer.Option("--junit", help="File for the checks as JUnit XML, which a CI shows.")]
MOST_PARAMETERS = 20
"""Parameters that differ and are printed, each in a line."""
_PACE, _LATEST, _USUAL_PACE = "compare: pace", 5, 0.2
"""Name under which the pace of comparisons is kept, how many count, and seconds that a second of recording takes."""


def verdict(
    paths: Annotated[list[Path], typer.Argument(help="A recording set (folder with vehicle.yaml), or logs.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; default NAME-verdict.")
    ] = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
    series: Annotated[
        bool,
        typer.Option(
            "--series",
            help="Also write series.parquet: recorded minus simulated; where mcap or rerun is installed also "
            "series.mcap with layouts for Foxglove and PlotJuggler, and series.rrd.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print verdict.json on standard output.")] = False,
    quiet: Quiet = False,
    ci: Annotated[
        bool, typer.Option("--ci", help="Exit code 1 where the set is not judged, or by the two limits below.")
    ] = False,
    max_unexplained: Annotated[
        str, typer.Option("--max-unexplained", help="With --ci: largest share that may stay unexplained, 20% or 0.2.")
    ] = "100%",
    junit: JunitFile = None,
    no_doubts: Annotated[
        bool, typer.Option("--no-doubts", help="With --ci: no doubt about the set, and no warning, is let pass.")
    ] = False,
) -> None:
    """Say where a believed vehicle and its recordings part, why, and write a better vehicle.

    Writes `verdict.json`, `report.html` (open it in a browser) and `improved_vehicle.yaml`, and where there is
    something to write `conditions.yaml` (wind, payload for a time) and `instruments.yaml` (errors of sensors). Of logs
    a recording set is made first, as by `rotorid import`. A mismatch found is no error: the exit code is 0, but with
    --ci.

    Examples:

    `rotorid verdict flights`

    `rotorid verdict log.ulg --mass-kg 1.52 -o answer`

    `rotorid verdict flights --ci --max-unexplained 20% --no-doubts`
    """
    with one_sentence():
        from rotorid.mismatch.tell.steps import steps_sentence
        from rotorid.recordings.files import is_bag

        start, limit = time.monotonic(), share_of(max_unexplained)
        is_set = len(paths) == 1 and paths[0].is_dir() and not is_bag(paths[0])
        target, stated = out or Path(f"{name_of(paths[0])}-verdict"), Stated(mass_kg, like, vehicle, mapping)
        if is_set:
            folder = paths[0]
            if given := [f"--{n.replace('_', '-')}" for n, value in vars(stated).items() if value is not None]:
                play = "plays" if len(given) == 1 else "play"
                said = f"{folder} is a recording set, whose vehicle is that of {folder / 'vehicle.yaml'}"
                typer.echo(f"rotorid: {' and '.join(given)} {play} no part: {said}", err=True)
            if not (folder / "vehicle.yaml").is_file():
                raise InputError(_no_vehicle(folder))
        folder = set_of(paths, is_set, target, quiet or as_json, stated)
        with progress("verdict", quiet):
            found = write_verdict(folder, target, series)
        if as_json:
            typer.echo((target / "verdict.json").read_text(encoding="utf-8"), nl=False)
        else:
            typer.echo(found.basis.sentence)
            for line in (*(d.sentence for d in found.doubts), *found.warnings):
                typer.echo(f"! {line}")
            typer.echo(found.sentence)
            if steps := steps_sentence(found):
                typer.echo(steps)
            others = ", ".join(sorted(p.name for p in target.iterdir() if p.suffix in (".json", ".yaml")))
            typer.echo(f"{target / 'report.html'} (and {others}), {time.monotonic() - start:.0f} s")
        if junit is not None:
            cases = checks_of(found, limit, no_doubts)
            write_texts({junit: as_junit(f"verdict {folder.name}", cases, time.monotonic() - start)})
        faults = faults_of(found, limit, no_doubts) if ci else []
        for fault in faults:
            typer.echo(f"ci: {fault}", err=True)
    if faults:
        raise typer.Exit(1)


def share_of(text: str) -> float:
    """A share of `20%` or `0.2`; InputError where it is none."""
    number = text.strip().removesuffix("%")
    try:
        share = float(number) / (100.0 if text.strip().endswith("%") else 1.0)
    except ValueError:
        share = math.nan
    if not 0.0 <= share <= 1.0:
        raise InputError(f"--max-unexplained is {text!r}, expected a share such as 20% or 0.2")
    return share


def checks_of(verdict: Verdict, most: float, no_doubts: bool) -> dict[str, list[str]]:
    """What a regression test of an airframe asks of a verdict, each with the sentences by which it fails."""
    share = verdict.unexplained.share
    over = [f"{100 * share:.0f} % stays unexplained, more than {100 * most:.0f} %"] if share > most else []
    out = {
        "the set is judged": ["the set is not judged"] if verdict.verdict == "not_judged" else [],
        f"at most {100 * most:.0f} % stays unexplained": over,
    }
    if no_doubts:
        out |= {"no doubt about the set": [d.sentence for d in verdict.doubts]}
        out |= {"no warning": list(verdict.warnings)}
    return out


def faults_of(verdict: Verdict, most: float, no_doubts: bool) -> list[str]:
    """Why a verdict fails as a regression test of an airframe, one sentence each."""
    return [sentence for sentences in checks_of(verdict, most, no_doubts).values() for sentence in sentences]


def write_verdict(folder: Path, target: Path, series: bool = False) -> Verdict:
    """Analyse the set in `folder`, write the files into `target`, and return the verdict.

    With `series` the residuals are written, too, as `series.parquet` and for the viewers whose packages are installed.
    """
    from rotorid.recordings.tables import NO_PARQUET, parquet_is_here, write_table

    if series and not parquet_is_here():
        raise InputError(f"{target / 'series.parquet'}: {NO_PARQUET}")
    # What a module warns of goes to no log here; the verdict itself says what a reader must know.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from rotorid.recordings import read_set

        recordings = read_set(folder)
        # The effects bring a compiler along, whose start takes seconds.
        from rotorid.report.deliver import analysis_of, write_files

        analysis = analysis_of(recordings)
        verdict = write_files(analysis, target)
        if series:
            from rotorid.report.deliver import residuals_of
            from rotorid.report.series_files import write_viewers

            with step("writing the series"):
                write_table(residuals_of(analysis), target / "series.parquet")
                write_viewers(analysis, target)
        return verdict


def _no_vehicle(folder: Path) -> str:
    """What to do about a folder without vehicle.yaml, by what is in it."""
    files = [p for p in folder.iterdir() if p.is_file()]
    near = next((p.name for p in files if p.suffix in (".yaml", ".yml") and "vehicle" in p.name.lower()), None)
    if near:
        return f"{folder}: vehicle.yaml is missing; is {near} meant to be it?"
    logs = [p.name for p in files if p.suffix.lower() in (".ulg", ".csv", ".mat", ".parquet", ".bin", ".bbl")]
    if logs:
        return (
            f"{folder}: vehicle.yaml is missing; make a set of logs by `rotorid import {folder / logs[0]} …`, or write "
            f"one by `rotorid init {folder}`"
        )
    return f"{folder}: no vehicle.yaml and no log in it; expected a recording set (a folder with vehicle.yaml and runs)"


def compare(
    sets: Annotated[
        list[Path],
        typer.Argument(
            metavar="GOOD... NEW", help="Sets, or logs: one or more that were good, then the one in question."
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File for the result as JSON.")] = None,
    page: Annotated[Path | None, typer.Option("--page", help="File for a page with figures (HTML).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")] = False,
    quiet: Quiet = False,
    ci: Annotated[bool, typer.Option("--ci", help="Exit code 1 where a change is stated (probability 0.99).")] = False,
    junit: JunitFile = None,
    mass_kg: MassKg = None,
    like: Like = None,
    vehicle: VehicleFile = None,
    mapping: MappingFile = None,
) -> None:
    """Say what differs from the sets that were good, then what changed, and by how much at most everything else.

    First the autopilot's parameters that differ, where the logs state them. What differs in flight is stated within
    seconds and without a cause: trims, each rotor's share of the thrust, sensors, noise. Then what explains it.

    Flights of one vehicle, or recordings of one stand or bench: there the answer is whether to calibrate it again.
    Each set is held against its own vehicle.yaml: what was changed on purpose and is written there is no change. With
    three or more good flights their differences among themselves are the yardstick.
    A log is one flight; all logs get the same vehicle.yaml: that of --vehicle, or the one proposed for the first log.
    Not compared yet: what lies between command and rotor speed on a stand.

    Examples:

    `rotorid compare flights-of-monday flights-of-friday`

    `rotorid compare monday tuesday wednesday thursday`

    `rotorid compare reference today --ci --page changes.html`

    `rotorid compare bench-after-calibration bench-today`

    `rotorid compare good.ulg today.ulg --vehicle vehicle.yaml`

    `rotorid compare 'log.bin#1' 'log.bin#3'`, two flights of one log
    """
    with one_sentence():
        if len(sets) < 2:
            raise InputError(
                f"{sets[0]}: nothing to compare it with; expected two sets or more, the last one in question"
            )
        start = time.monotonic()

        def tell(sentences: Sequence[str]) -> None:
            for line in () if as_json else sentences:  # the JSON has them at the end
                typer.echo(line)

        stated = Stated(mass_kg, like, vehicle, mapping)
        found, changed = compared(sets, tell, partial(progress, quiet=quiet), stated)
        text = changes_text(found, changed)
        texts = {} if out is None else {out: text}
        if page is not None:
            from rotorid.report.page import make_changes_page

            texts[page] = make_changes_page(found)
        if junit is not None:
            texts[junit] = as_junit(f"compare {found.new}", _cases_of(found, changed), time.monotonic() - start)
        if texts:
            write_texts(texts)
        if as_json:
            typer.echo(text, nl=False)
    differs = found.level_1 is not None and bool(found.level_1.stated)
    if ci and (differs or any(c.status in ("established", "ambiguous") for c in found.changes)):
        raise typer.Exit(1)


def changes_text(found: Changes, changed: Sequence[Differing]) -> str:
    """A comparison as JSON."""
    from rotorid.mismatch.changes import words

    content = {"parameters": [asdict(d) for d in changed], **words.as_json(found)}
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _cases_of(found: Changes, changed: Sequence[Differing]) -> dict[str, list[str]]:
    """Cases of a test: each quantity of level 1, each change that is stated, the autopilot's parameters (which fail
    nothing: they were set on purpose)."""
    from rotorid.mismatch.changes import words

    out: dict[str, list[str]] = {f"parameter {d.name} differs": [] for d in changed if d.good and d.new}
    if found.level_1 is not None:
        for d in found.level_1.differences:
            out[f"unchanged: {words.quantity_words(d)}"] = [words.difference_words(d)] if d.stated else []
    for change in found.changes:
        if change.status in ("established", "ambiguous"):
            out[f"unchanged: {words.name_words(change.id)}"] = [words.change_words(change)]
    return out


def compared(
    paths: Sequence[Path],
    tell: Callable[[Sequence[str]], None],
    watch: Callable[[str], AbstractContextManager],
    stated: Stated,
) -> tuple[Changes, tuple[Differing, ...]]:
    """What changed from all sets and logs but the last one to it, and the autopilot's parameters that differ.

    `tell` gets sentences as soon as they are known: parameters, what differs, how long its explanation will take, and
    the explanation. `watch` gives the context, by a command's name, in which a part of the work is done and shown.
    """
    with watch("compare: what differs"):
        from rotorid.recordings.settings import differing, differing_sentences

        given = read_given(paths, stated)
        changed = differing([own for one in given[:-1] for own in one.settings], [own for own in given[-1].settings])
        tell(differing_sentences(changed, MOST_PARAMETERS))
        from rotorid.mismatch.changes.level_one import as_one, of_one_vehicle, seen_by
        from rotorid.mismatch.changes.words import level_one_sentences

        *known, second = of_one_vehicle([one.recordings for one in given])
        good = as_one(known)
        seen = seen_by(good, second)
    # What cannot be wrong comes first, and before the minutes that its explanation takes.
    flown_s = sum(float(run.time_s[-1] - run.time_s[0]) for own in (good, second) for run in own.runs)
    if seen is not None:
        tell([*level_one_sentences(seen), explanation_takes(flown_s)])
    began = time.monotonic()
    with watch("compare"), step("comparing"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from rotorid.mismatch.changes.compare import changes_between
        from rotorid.mismatch.changes.words import level_two_sentences

        found = changes_between(good, second, seen=seen)
    keep(_PACE, [("s a second of recording", (time.monotonic() - began) / max(flown_s, 1.0))])
    tell(level_two_sentences(found))
    return found, changed


def explanation_takes(flown_s: float) -> str:
    """How long level 2 will take: by the latest comparisons on this computer, else by those of an idle one."""
    paces = [seconds for run in read_record().get(_PACE, []) for _, seconds in run][-_LATEST:]
    likely_s = flown_s * (median(paces) if paces else _USUAL_PACE)
    shown = f"{max(likely_s, 10.0):.0f} s" if likely_s < 95 else f"{likely_s / 60:.0f} min"
    by = "by the last comparisons on this computer" if paces else "if this computer is like the one it was measured on"
    return f"What explains it comes next, in about {shown} ({by})."


@dataclass(frozen=True)
class Given:
    """A set that a command was given, or that was made of a log."""

    recordings: RecordingSet
    settings: tuple[Settings, ...]
    """Parameters of the autopilot, one entry a log; empty where they are not known."""


def read_given(paths: Sequence[Path], stated: Stated) -> list[Given]:
    """The sets of folders and logs, each log a set of its own; all logs have one vehicle.

    `log.bin#2` is the second flight in a log, `set#2` the second run of a set, as `rotorid import` lists them.

    Raises
    ------
    InputError
        A path is neither, or has no such flight.
    """
    from rotorid.recordings import read_set
    from rotorid.recordings.files import is_bag
    from rotorid.recordings.settings import read_settings

    out, sets = [], {}
    with log_by_log(stated) as made_of:
        for whole in paths:
            path, number = one_flight(whole)
            if path not in sets and path.is_dir() and not is_bag(path):
                sets[path] = Given(read_set(path), tuple(read_settings(path).values()))
            elif path not in sets:
                made = made_of(path, path.stem)
                sets[path] = Given(made.recordings(), tuple(own for own in made.settings.values() if own))
            found = sets[path].recordings
            if number is not None:
                if not 1 <= number <= len(found.runs):
                    names = ", ".join(run.name for run in found.runs)
                    raise InputError(
                        f"{whole}: has {len(found.runs)} flights ({names}), expected #1 to #{len(found.runs)}"
                    )
                name = f"{found.name}#{number}"
                found = replace(found, name=name, runs=(found.runs[number - 1],), held_out=None)
            out.append(replace(sets[path], recordings=found))
        return out


def one_flight(path: Path) -> tuple[Path, int | None]:
    """A path and the number of the flight that `#2` behind it asks for; None where it asks for all."""
    asked = re.fullmatch(r"(.+)#(\d{1,6})", path.name)
    if asked is None or path.exists():
        return path, None
    return path.with_name(asked[1]), int(asked[2])
