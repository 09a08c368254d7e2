"""What every command shares: one sentence for bad input, progress with the time left."""

from __future__ import annotations

import errno
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from rotorid.errors import InputError

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
        typer.echo(f"rotorid: {unexpected(error)}", err=True)
        raise typer.Exit(1) from None


def unexpected(error: Exception) -> str:
    """The sentence on an error that nobody foresaw: what it is, where it arose, and what to do."""
    package = Path(__file__).parents[1]
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).is_relative_to(package)]
    where = f" in {Path(frames[-1].filename).relative_to(package)}, line {frames[-1].lineno}" if frames else ""
    what = " ".join(str(error).split())
    return (
        f"unexpected {type(error).__name__}{f' ({what})' if what else ''}{where}: a fault of rotorid, not of your "
        f"files; please report it with the set ({TRACEBACK}=1 shows the whole way there)"
    )


def span(seconds: float) -> str:
    """`40 s` or `3 min`, for people."""
    return f"{max(seconds, 1):.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


@contextmanager
def progress(expected_s: float | None, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """A function that takes a step's name; on a terminal a bar with the time left, else a line a step.

    All goes to standard error, so that standard output holds results alone.
    """
    if quiet:
        yield lambda text: None
    elif not sys.stderr.isatty():
        start = time.monotonic()
        if expected_s is not None:
            typer.echo(f"  about {span(expected_s)} to go", err=True)
        yield lambda text: typer.echo(f"  {time.monotonic() - start:5.1f} s  {text}", err=True)
    else:
        with _bar(expected_s) as step:
            yield step


@contextmanager
def _bar(expected_s: float | None) -> Iterator[Callable[[str], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class Left(ProgressColumn):
        """Time left by what such recordings cost, in words."""

        def render(self, task) -> Text:
            if expected_s is None or task.elapsed is None:
                return Text("")
            left = expected_s - task.elapsed
            return Text(f"about {span(left)} left" if left > 0 else "longer than usual", style="dim")

    class Share(BarColumn):
        """The bar follows the clock: the steps differ too much in length to count them."""

        def render(self, task):
            if expected_s is not None and task.elapsed is not None:
                task.completed = min(task.elapsed / expected_s, 0.98) * (task.total or 1)
            return super().render(task)

    columns = [TextColumn("{task.description}"), Share(), TimeElapsedColumn(), Left()]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None if expected_s is None else 1.0)
        yield lambda text: bar.update(task, description=text)
