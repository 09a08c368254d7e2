"""What every command shares: one sentence for bad input, how far a command is."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path

import typer

from rotorid.cli.waiting import Waiting, keep, read_record
from rotorid.errors import InputError
from rotorid.steps import heard_by

INTERRUPTED = 130
TRACEBACK = "ROTORID_TRACEBACK"
"""Environment variable with which an unexpected error shows its traceback."""


@contextmanager
def one_sentence() -> Iterator[None]:
    """Bad input, and what nobody foresaw, end the command with one sentence and exit code 1, without a traceback."""
    try:
        yield
    except InputError as error:
        typer.echo(f"rotorid: {error}", err=True)
        raise typer.Exit(1) from None
    except OSError as error:  # a full disk, a folder that cannot be written
        if error.errno is None or error.errno == errno.EPIPE:
            raise
        where = f"{error.filename}: " if error.filename else ""
        typer.echo(f"rotorid: {where}{(error.strerror or str(error)).lower()}", err=True)
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        typer.echo("rotorid: stopped; nothing is left half written", err=True)
        raise typer.Exit(INTERRUPTED) from None
    except typer.Exit:
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK):
            raise
        typer.echo(f"rotorid: {_unexpected(error)}", err=True)
        raise typer.Exit(1) from None


def _unexpected(error: Exception) -> str:
    """The sentence on an error that nobody foresaw: what it is, where it arose, and what to do."""
    package = Path(__file__).parents[1]
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).is_relative_to(package)]
    where = f" in {Path(frames[-1].filename).relative_to(package)}, line {frames[-1].lineno}" if frames else ""
    what = " ".join(str(error).split())
    return (
        f"unexpected {type(error).__name__}{f' ({what})' if what else ''}{where}: a fault of rotorid, not of your "
        f"files; please report it with the set ({TRACEBACK}=1 shows the whole way there)"
    )


@contextmanager
def progress(command: str, quiet: bool = False) -> Iterator[None]:
    """Show at which step a command is, since when, and how long is left where earlier runs of it tell.

    All goes to standard error, so that standard output holds results alone: on a terminal a line that is kept up to
    date, else a line now and then.
    """
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    terminal = sys.stderr.isatty()
    say = None if quiet or terminal else partial(typer.echo, err=True)
    waiting = Waiting(read_record().get(command, []), say)

    def line() -> Text:
        return Text(waiting.line(), no_wrap=True, overflow="ellipsis")

    shown = Live(get_renderable=line, console=Console(stderr=True), transient=True) if terminal and not quiet else None
    with shown or nullcontext(), heard_by(waiting.heard):
        yield
    waiting.heard(())
    keep(command, waiting.done)
