"""`rotorid plan` and `rotorid together`: the next flight, and what it settled.

The plan on the verdict's page: into the section on what to fly next, in place of an earlier plan.
"""

from __future__ import annotations

import base64
import json
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from markupsafe import Markup

from rotorid.cli.console import one_sentence, progress
from rotorid.cli.sets import Quiet
from rotorid.errors import InputError
from rotorid.io.text.wording import neighbour
from rotorid.io.text.writing import write_texts
from rotorid.steps import step

OPEN, _CLOSE = "<!-- plan -->", "<!-- end of the plan -->"
SECTION = re.compile(r"(<section><h2>What to fly next</h2>.*?)(?:" + OPEN + ".*?" + _CLOSE + r")?(</section>)", re.S)


def plan(
    verdict: Annotated[Path, typer.Argument(metavar="VERDICT", help="A verdict's folder, or its verdict.json.")],
    recordings: Annotated[
        list[Path] | None,
        typer.Option("--set", help="The recording set, or sets judged together; by default those next to the verdict."),
    ] = None,
    limits: Annotated[Path | None, typer.Option(help="YAML file of what the flight, or session, may ask for.")] = None,
    want: Annotated[
        list[str] | None,
        typer.Option(
            help="An interval to reach, as torque_coefficient_n_m_s2=1%, or a limit of what is not at work, as "
            "ground_effect=2% of the weight."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the plan; default VERDICT/plan.")] = None,
    quiet: Quiet = False,
) -> None:
    """Find the flight that settles what a verdict left open, and write it for the vehicle.

    Writes `plan.json`, `plan.png`, `trajectory.csv` (north-east-down), `px4_offboard.csv`, `crazyflie.csv` and, where
    it can be one, `px4_mission.plan`; of a stand or bench `session.csv`: loads, throttles, tilts and waiting times.
    Fly it, record it as a set of its own, and judge both by `rotorid together`. The verdict's page shows the plan.

    Example: `rotorid plan flights-verdict --limits room.yaml`
    """
    with one_sentence():
        from rotorid.plan.candidates import Limits, SessionLimits, read_limits

        wishes = _wished(want or [])
        folder, content = _read_verdict(verdict)
        flight = content["kind"] == "flight"
        allowed = read_limits(limits, Limits if flight else SessionLimits)
        if wishes and not flight:
            raise InputError(f"--want: intervals are planned for flights; this verdict is of a {content['kind']}")
        sources = recordings or sets_of(folder, content)
        with progress("plan", quiet), step("planning"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from rotorid.plan.questions import joined_sets
            from rotorid.recordings import read_set

            sets = [read_set(p) for p in sources]
            source = sets[0] if len(sets) == 1 else joined_sets(*sets)[0]
            target = out or folder / "plan"
            if flight:
                from rotorid.plan.plan import plan as make_plan
                from rotorid.plan.questions import known_from
                from rotorid.plan.write import text, write

                made = make_plan(known_from(source, content), allowed, wishes)
            else:
                from rotorid.plan.session import known_instrument_from, plan_session, text, write

                made = plan_session(known_instrument_from(source, content), allowed)
            files, said = write(made, target), text(made)
            picture = (target / "plan.png").read_bytes() if made.pieces else None
            if (page := folder / "report.html").is_file():
                write_texts({page: with_plan(page.read_text(encoding="utf-8"), source.name, said, picture)})
        for line in said:
            typer.echo(line)
        typer.echo(f"{files[0].parent}: {', '.join(f.name for f in files)}")


def _wished(texts: list[str]) -> dict[str, float]:
    """Wishes as `name=1%` or `name=0.01`; an effect's share is one of the weight."""
    out = {}
    for text in texts:
        name, _, size = text.partition("=")
        try:
            value = float(size.rstrip("% ")) / (100.0 if size.strip().endswith("%") else 1.0)
        except ValueError:
            value = 0.0
        if not name or not 0 < value < 1:
            raise InputError(
                f"--want {text}: expected a value of vehicle.yaml, or an effect, and a share, as mass_kg=1%"
            )
        out[name] = value
    return out


def _read_verdict(path: Path) -> tuple[Path, dict]:
    """Folder and content of a verdict."""
    file = path / "verdict.json" if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected the verdict.json of `rotorid verdict`{neighbour(path)}")
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError):
        raise InputError(f"{file}: this is no JSON; expected the verdict.json of `rotorid verdict`") from None
    if not isinstance(content, dict) or not {"set", "kind", "effects"} <= set(content):
        raise InputError(f"{file}: no verdict (set, kind and effects are missing)")
    return file.parent, content


def sets_of(folder: Path, content: dict) -> list[Path]:
    """The recording sets that a verdict is of, where they usually lie: `a+b` is of the sets a and b together."""
    here = folder.resolve()

    def place_of(name: str) -> Path | None:
        places = [here / name, here.parent / name, Path(name), Path("raw/recordings") / name]
        return next((p for p in places if (p / "vehicle.yaml").is_file()), None)

    for names in ([content["set"]], content["set"].split("+")):
        found = {name: place_of(name) for name in names}
        if None not in found.values():
            return list(found.values())
    lacking = next(name for name, place in found.items() if place is None)
    raise InputError(f"{folder}: the recording set {lacking} of this verdict is not next to it; name it with --set")


def together(
    first: Annotated[Path, typer.Argument(help="The recording set that left something open.")],
    later: Annotated[list[Path], typer.Argument(help="The sets flown to settle it, one after the other.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; default FIRST+LATER-verdict.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Judge a set together with those flown later, and say what they settled.

    All must be of one vehicle as believed. Writes the files of `rotorid verdict` for the sets together, and
    `answers.json`. What is still open `rotorid plan` plans for again, from the folder written.

    Example: `rotorid together flights next_flight`
    """
    with one_sentence():
        with progress("together", quiet), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from rotorid.plan.questions import answers, joined_sets, open_classes
            from rotorid.recordings import read_set
            from rotorid.report.deliver import analysis_of, write_files

            sets = [read_set(p) for p in (first, *later)]
            whole, notes = joined_sets(*sets)
            target = out or Path(f"{whole.name}-verdict")
            with step("the first set alone"):
                before = open_classes(analysis_of(sets[0]))
            analysis = analysis_of(whole)
            analysis = replace(analysis, notes=(*analysis.notes, *notes))
            said = write_files(analysis, target)
            found = answers(before, analysis.findings)
            write_texts({target / "answers.json": json.dumps(found, indent=1) + "\n"})
        typer.echo(said.sentence)
        for line in (*notes, *(answer["sentence"] for answer in found)):
            typer.echo(f"  - {line}")
        if not before:
            typer.echo("  - The first set left nothing open.")
        if open_classes(analysis):
            typer.echo(f"  - Not all is settled: `rotorid plan {target}` plans the next flight.")
        typer.echo(f"{target / 'report.html'}")


def with_plan(page: str, name: str, said: Sequence[str], picture: bytes | None = None) -> str:
    """A verdict's page with the sentences of a plan for a set, and its picture (PNG) where there is one.

    Sentences that are set in belong to the first: its steps. A page without that section stays as it is.
    """
    first = Markup("<br>").join([said[0], *(line.strip() for line in said if line.startswith("  "))])
    others = [line for line in said[1:] if not line.startswith("  ")]
    lines = Markup("").join(Markup("<li>{}</li>").format(line) for line in (first, *others))
    out = Markup("<ul>{}</ul>").format(lines)
    if picture:
        data = base64.b64encode(picture).decode()
        words = f"What is planned for {name}, step by step, and the expected separations"
        out += Markup('<img style="max-width:100%" alt="{}" src="data:image/png;base64,{}">').format(words, data)
    return SECTION.sub(lambda found: f"{found[1]}{OPEN}{out}{_CLOSE}{found[2]}", page, count=1)
