"""What a person sees while recording: values, rate, gaps, elapsed, remaining; a plot on request."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import fmean

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from rotorid_acquire.recorder import Recorder

_REFRESH_HZ = 5
_PLOT_SAMPLES = 600
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # braille, rows by columns


def braille(values: list[float], width: int = 60, height: int = 8) -> list[str]:
    """A curve as lines of braille characters, oldest value left; `width` and `height` in characters."""
    if not values:
        return []
    low, high = min(values), max(values)
    span = (high - low) or 1.0
    columns, rows = 2 * width, 4 * height
    cells = [[0] * width for _ in range(height)]
    for x in range(columns):
        value = values[x * len(values) // columns]
        y = round((high - value) / span * (rows - 1))
        cells[y // 4][x // 2] |= _DOTS[y % 4][x % 2]
    lines = ["".join(chr(0x2800 + dots) for dots in row) for row in cells]
    lines[0] += f" {high:.5g}"
    lines[-1] += f" {low:.5g}"
    return lines


class Plot:
    """The last samples of one channel, kept as they come: `see` takes a sample's values, `number` is the channel's."""

    def __init__(self, column: str, number: int) -> None:
        self.column = column
        self._number = number
        self._values: deque[float] = deque(maxlen=_PLOT_SAMPLES)

    @classmethod
    def of(cls, recorder: Recorder, column: str) -> Plot:
        """A curve of what a recorder takes in; several of one recorder see every sample each."""
        plot, before = cls(column, recorder.instrument.columns.index(column)), recorder.on_row

        def see(row) -> None:
            if before is not None:
                before(row)
            plot.see(row.values)

        recorder.on_row = see
        return plot

    def see(self, values: Sequence[float]) -> None:
        """Take a sample."""
        self._values.append(values[self._number])

    def render(self) -> Text:
        values = list(self._values)
        # By the differences of successive samples: a load that was put on meanwhile is no noise.
        steps = [later - earlier for earlier, later in pairwise(values)]
        noise = f"   noise {math.sqrt(fmean(step**2 for step in steps) / 2):.3g}" if steps else ""
        return Text(f"{self.column}{noise}\n" + "\n".join(braille(values)))


class LinesPanel:
    """What is seen of an instrument that sends plain lines; nobody can count what its line lost."""

    def __init__(self, title: str, columns: Sequence[str], wanted: int | None, clock_s: Callable[[], float]) -> None:
        self._title, self._columns, self._wanted, self._clock_s = title, columns, wanted, clock_s
        self._values: Sequence[float] = ()
        self._lines, self._begun_s = 0, clock_s()

    def see(self, values: Sequence[float]) -> None:
        """Take a line's values."""
        self._values = values
        self._lines += 1

    def render(self) -> Table:
        elapsed_s = self._clock_s() - self._begun_s
        rate_hz = self._lines / elapsed_s if elapsed_s > 0 and self._lines else 0.0
        cells = {
            "lines": f"{self._lines}" + (f"/{self._wanted}" if self._wanted else ""),
            "rate [1/s]": f"{rate_hz:.1f}" if rate_hz else "–",
            "elapsed [s]": f"{elapsed_s:.1f}",
            "remaining [s]": f"{(self._wanted - self._lines) / rate_hz:.0f}" if self._wanted and rate_hz else "–",
        }
        return _table(f"{self._title} · lines", cells, self._columns, self._values)


def panel(recorder: Recorder) -> Table:
    """One instrument's table."""
    values, cells = recorder.status()
    return _table(f"{recorder.instrument.title} · {recorder.phase}", cells, recorder.instrument.columns, values)


def _table(title: str, cells: dict[str, str], columns: Sequence[str], values: Sequence[float]) -> Table:
    """One row: how it goes by heading, then the values of the columns."""
    table = Table(title=title, title_justify="left", box=None)
    for heading in cells:
        table.add_column(heading, justify="right")
    for column in columns:
        table.add_column(column, justify="right", style="cyan")
    table.add_row(*cells.values(), *(f"{value:.5g}" for value in values or [float("nan")] * len(columns)))
    return table


def bench_forces(recorder: Recorder) -> Text | None:
    """Forces on the vehicle in N by table 2.8's calibration, once the bench is tared (thesis fig. 2.38)."""
    tare, values = recorder.session.tare, recorder.status()[0]
    if recorder.instrument.name != "bench" or not tare or not values:
        return None
    # Here alone is numpy needed: it is a quarter of the time that every command takes to start.
    import numpy as np

    from rotorid_acquire.emulators.truth import body_forces, cell_forces

    volts = np.array(values) - np.array([tare[column] for column in recorder.instrument.columns])
    forces = body_forces(cell_forces(volts))
    text = "   ".join(f"{name} {value:8.3f}" for name, value in zip("xyz", forces, strict=True))
    return Text(f"force on the vehicle [N]   {text}", style="green")


def watch(
    recorders: list[Recorder],
    run: Callable[[], None],
    stop: threading.Event,
    plots: list[Plot],
    console: Console,
    panels: Sequence[LinesPanel] = (),
) -> None:
    """Run a recording and show it. Ctrl-C asks it to stop; a second one no longer asks.

    In a terminal the recording has a thread of its own, so that drawing never delays it; elsewhere there
    is nothing to draw. What the recording raises is raised here.
    """

    def interrupt(number, frame) -> None:
        if number == signal.SIGHUP:
            _leave_the_terminal()
        elif stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    ends = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # under nohup a recording outlives its terminal
        ends.append(signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in ends}
    try:
        if not console.is_terminal:
            run()
            return
        failure: list[BaseException] = []

        def work() -> None:
            try:
                run()
            except BaseException as error:
                failure.append(error)

        thread = threading.Thread(target=work, name="recording")
        thread.start()

        def picture() -> Group:
            forces = [text for recorder in recorders if (text := bench_forces(recorder)) is not None]
            return Group(
                *map(panel, recorders), *(p.render() for p in panels), *forces, *(plot.render() for plot in plots)
            )

        try:
            with Live(picture(), console=console, auto_refresh=False) as live:
                while thread.is_alive():
                    thread.join(1 / _REFRESH_HZ)
                    live.update(picture(), refresh=True)
        except BaseException:  # nobody looks any more: the device must not go on for that
            stop.set()
            thread.join()
            raise
        if failure:
            raise failure[0]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave_the_terminal() -> None:
    """The terminal is gone: what is still to be said must not fail for that."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        if os.isatty(descriptor):
            os.dup2(nowhere, descriptor)
    os.close(nowhere)


def stderr_console() -> Console:
    """Progress goes to standard error, so that standard output can be piped."""
    return Console(file=sys.stderr, highlight=False)
