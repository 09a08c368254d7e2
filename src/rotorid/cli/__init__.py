"""Command line for people: from a log file to an answer. A module for the commands of one subject."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from rotorid.cli import histories, modelling, page, planning, sets, verdicts

app = typer.Typer(
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="From a flight log to what your model leaves out.",
    epilog=(
        "The usual way:\n\n"
        "`rotorid import flight.ulg --mass-kg 1.52 -o flights`  a recording set of your logs\n\n"
        "`rotorid check flights`  what is in it, what it lacks, what looks wrong\n\n"
        "`rotorid verdict flights`  what the believed vehicle leaves out, and a better one\n\n"
        "Or `rotorid page`: the same in a browser, on this computer.\n\n"
        "Exit codes: 0 done, whatever the verdict says; 1 something in your files must be mended (one sentence says "
        "what); 2 the command itself was not understood."
    ),
)


def _version(wanted: bool) -> None:
    if wanted:
        from rotorid.report.provenance import own_commit

        try:
            known = f"rotorid {version('rotorid')}"
        except PackageNotFoundError:
            known = "rotorid (not installed)"
        source = own_commit()
        typer.echo(f"{known}, commit {source}" if source else known)
        raise typer.Exit()


@app.callback()
def main(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print version and commit, and leave.")
    ] = False,
) -> None:
    """From a flight log to what your model leaves out."""


app.command("verdict")(verdicts.verdict)
app.command("compare")(verdicts.compare)
app.command("history")(histories.history)
app.command("page")(page.page)
app.command("plan")(planning.plan)
app.command("together")(planning.together)
app.command("import")(sets.import_logs)
app.command("init")(sets.init)
app.command("check")(sets.check)
app.command("simulate")(modelling.simulate)
app.command("export")(modelling.export)
app.command("model")(modelling.model)
app.command("parameters")(modelling.parameters)
app.command("effects")(sets.effects)

OPEN = ("console",)
"""Modules that other rooms may import; all else is this room's own."""
