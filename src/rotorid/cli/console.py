"""What every command shares: one sentence for bad input, how far a command is, and how long is left of it.

What is left is said from the steps measured in this run and from earlier runs on this machine: if the rest goes as it
went then, each step at its pace of now. A number is shown only where they agree: a first run has none.
"""

from __future__ import annotations

import errno
import json
import os
import sys
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path
from statistics import mean

import typer

from rotorid.errors import InputError
from rotorid.io.text.writing import write_texts
from rotorid.steps import heard_by

_Run = list[tuple[str, float]]
"""Steps one after the other, and the seconds of each."""
KEPT, _ALIKE, _LEAST = 24, 5, 3
"""Runs that the record keeps of a command; those asked, the most alike in their steps so far; and how many at least."""
_AGREE, SOON_S = 2.0, 5.0
"""Factor within which all but the shortest must agree; what is less than `SOON_S` counts as that."""
UNMET, _LONGER = 0.3, 0.3
"""Power of the pace at which a step not yet met is taken to follow it; share of its time that an overdue step lasts."""
_PAUSE_S = 10.0
"""Between two lines where there is no terminal."""
INTERRUPTED = 130
TRACEBACK = "ROTORID_TRACEBACK"
"""Environment variable with which an unexpected error shows its traceback."""


def time_left(runs: Sequence[_Run], done: _Run, name: str, spent_s: float) -> float | None:
    """Seconds left after `spent_s` in the step `name`; None where earlier runs do not say it."""
    if not done or len(runs) < _LEAST:  # while it reads, nothing is known of the recordings
        return None
    alike = sorted((_as_then(run, done, name, spent_s) for run in reversed(runs)), key=lambda then: then[0])[:_ALIKE]
    found = sorted(max(seconds, SOON_S) for _, seconds in alike)
    low, middle, high = (found[int(share * len(found))] for share in (0.2, 0.5, 0.8))
    return middle if high <= _AGREE * low else None


def _as_then(run: _Run, done: _Run, name: str, spent_s: float) -> tuple[int, float]:
    """How many steps only one of two runs has met so far, and the seconds left if all goes on as in the earlier one.

    As many of each step follow as then, from the newest that both have met.
    """
    now, then = _times_of(done), _times_of(run)
    own, whole = [*(step for step, _ in done), name], [step for step, _ in run]
    newest = max(set(own) & set(whole), key=own.index, default=None)
    start = 0 if newest is None else whole.index(newest)
    rest = Counter(whole[start:])
    rest.subtract(own if newest is None else own[own.index(newest) :])
    both = [step for step in now if step in then]
    took = 0.3 + sum(len(now[step]) * mean(then[step]) for step in both)
    takes = 0.3 + sum(sum(now[step]) for step in both)
    usual = mean(then.get(name, [0.0]))
    if spent_s * took > usual * takes:  # the step itself says that all is slower
        took, takes = took + usual, takes + spent_s

    def again(step: str) -> float:
        return mean(now[step]) if step in now else mean(then.get(step, [0.0])) * (takes / took) ** UNMET

    going = again(name) - spent_s if again(name) > spent_s else _LONGER * spent_s
    rest_s = sum(count * again(step) for step, count in rest.items() if count > 0)
    return len(set(own) ^ set(whole[: start + 1])), going + rest_s


def _times_of(run: _Run) -> dict[str, list[float]]:
    """Seconds of each step, every time that it was met."""
    out = defaultdict(list)
    for step, seconds in run:
        out[step].append(seconds)
    return dict(out)


def words_left(seconds: float | None) -> str:
    """`about 40 s left` or `about 3 min left`; nothing where it is not known."""
    if seconds is None:
        return ""
    if seconds < 2 * SOON_S:
        return "; a few seconds left"
    return f"; about {round(seconds, -1):.0f} s left" if seconds < 95 else f"; about {seconds / 60:.0f} min left"


class Waiting:
    """Hears of the steps of a command, and says at which it is, since when and how long is left."""

    def __init__(
        self,
        runs: Sequence[_Run],
        say: Callable[[str], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ):
        """`say` takes a line when a step begins or ends, every `_PAUSE_S` seconds at most."""
        self.runs, self.say, self.clock = runs, say, clock
        self.done: _Run = []
        self.path: tuple[str, ...] = ()
        self.began = self.since = clock()
        self.said = -_PAUSE_S

    def heard(self, path: tuple[str, ...]) -> None:
        """A step began or ended."""
        now = self.clock()
        self.done.append(("/".join(self.path), now - self.since))
        self.path, self.since = path, now
        self.speak()

    def speak(self) -> None:
        """Say the line, if it is time."""
        if self.say and self.clock() - self.began - self.said >= _PAUSE_S:
            self.said = self.clock() - self.began
            self.say(self.line())

    def line(self) -> str:
        """Elapsed time, the step and what is left."""
        now, step = self.clock(), ": ".join(self.path[-2:]) or ("writing" if self.done else "reading")
        known = time_left(self.runs, self.done, "/".join(self.path), now - self.since)
        return f"  {now - self.began:4.0f} s  {step}{words_left(known)}"


def record_file() -> Path:
    """Where the record of earlier runs is: names of steps and seconds, nothing of the recordings."""
    cache = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "rotorid" / "waiting.json"


def read_record() -> dict[str, list[_Run]]:
    """The last runs by command; none where the file is missing, broken or of another version."""
    with suppress(Exception):
        content = json.loads(record_file().read_text(encoding="utf-8"))
        runs = {c: [[(str(s), float(t)) for s, t in run] for run in own] for c, own in content["runs"].items()}
        if content["version"] == version("rotorid") and all(
            0 <= t < 1e6 for o in runs.values() for r in o for _, t in r
        ):
            return runs
    return {}


def keep(command: str, done: _Run) -> None:
    """Add a run to the record, where it can be written."""
    runs = read_record()
    runs[command] = [*runs.get(command, []), [(step, round(seconds, 2)) for step, seconds in done]][-KEPT:]
    with suppress(Exception):
        write_texts({record_file(): json.dumps({"version": version("rotorid"), "runs": runs})})


@contextmanager
def one_sentence() -> Iterator[None]:
    """Bad input, and what nobody foresaw, end the command with one sentence and exit code 1, without a traceback."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("rotorid: stopped; nothing is left half written", err=True)
        raise typer.Exit(INTERRUPTED) from None
    except typer.Exit:
        raise
    except Exception as error:
        if (said := sentence_of(error)) is None:
            raise
        typer.echo(f"rotorid: {said}", err=True)
        raise typer.Exit(1) from None


def sentence_of(error: Exception) -> str | None:
    """What is said of an error to a person, in one sentence; None where it is to be raised as it is."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, OSError):  # a full disk, a folder that cannot be written
        if error.errno is None or error.errno == errno.EPIPE:
            return None
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{(error.strerror or str(error)).lower()}"
    return None if os.environ.get(TRACEBACK) else _unexpected(error)


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
def heard(command: str, say: Callable[[str], None] | None = None) -> Iterator[Waiting]:
    """Hear of the steps inside, next to earlier runs of a command; a run that ends well is added to the record."""
    waiting = Waiting(read_record().get(command, []), say)
    with heard_by(waiting.heard):
        yield waiting
    waiting.heard(())
    keep(command, waiting.done)


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
    with heard(command, None if quiet or terminal else partial(typer.echo, err=True)) as waiting:

        def line() -> Text:
            return Text(waiting.line(), no_wrap=True, overflow="ellipsis")

        kept_up_to_date = Live(get_renderable=line, console=Console(stderr=True), transient=True)
        with kept_up_to_date if terminal and not quiet else nullcontext():
            yield
