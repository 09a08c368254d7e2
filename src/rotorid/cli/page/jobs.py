"""Who works for the page: one process that looks at logs, and one at a time that makes verdicts; the others queue."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from contextlib import suppress
from typing import Any

from rotorid.cli.page.looks import Wishes
from rotorid.cli.page.shelf import NotThere, Shelf

_PATIENCE_S = 120.0
"""How long a look may take: a log of hundreds of MB takes some tens of seconds."""
_LONGEST_LINE = 50_000_000
"""Bytes of a message of a process: a look has the text of a vehicle and some sentences."""
KILLED = "The work ended without an answer (stopped from outside, or out of memory); nothing is lost, ask again."
STOPPED = "Stopped; the logs are still here, ask again whenever you like."


async def _start(*words: str, talks: bool = False) -> asyncio.subprocess.Process:
    """A process of ours; it computes in one thread, as two that wait for each other take several times as long."""
    threads = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "rotorid.cli.page.work", *words,
        stdin=asyncio.subprocess.PIPE if talks else asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
        limit=_LONGEST_LINE, env=threads | os.environ, start_new_session=True,
    )  # fmt: skip


class Looker:
    """One process that looks at logs, one after the other, and is started anew where it ended."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._one = asyncio.Lock()

    async def ready(self) -> asyncio.subprocess.Process:
        """The process, started if it does not run."""
        if self._process is None or self._process.returncode is not None:
            self._process = await _start("look", talks=True)
        return self._process

    async def look(self, shelf: Shelf, id_: str, wishes: Wishes) -> dict[str, Any]:
        """`look` with what is there, or `refused` with a sentence."""
        folder = shelf.path(id_)
        asked = {"folder": str(folder), "logs": [p.name for p in shelf.logs(id_)], "wishes": vars(wishes)}
        async with self._one:
            process = await self.ready()
            try:
                process.stdin.write(json.dumps(asked).encode() + b"\n")
                await process.stdin.drain()
                line = await asyncio.wait_for(process.stdout.readline(), _PATIENCE_S)
                if line:
                    return json.loads(line)
            except (OSError, ValueError):
                pass
            except TimeoutError:
                await self.stop()
                return {"refused": f"the logs were not read within {_PATIENCE_S:.0f} s; use `rotorid import` for them"}
            except asyncio.CancelledError:
                await self.stop()  # its answer would be taken for that to the next request
                raise
            await self.stop()
            return {"refused": "reading the logs took more than this computer gives, or was stopped; try them singly"}

    async def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()


class Queue:
    """Questions in the order in which they were asked, one at a time in a process of its own."""

    def __init__(self, shelf: Shelf) -> None:
        self._shelf = shelf
        self._asked: list[tuple[str, str]] = []
        self._new = asyncio.Event()
        self._now: tuple[str, asyncio.subprocess.Process | None] | None = None
        self._stopped: set[str] = set()
        self.lines: dict[str, dict[str, Any]] = {}
        """To the id of a set at work the last message on how far it is; not worth writing down."""

    def ask(self, id_: str, question: str) -> None:
        """Put a question at the end."""
        self._stopped.discard(id_)
        self._shelf.change(id_, stage="waiting", sentence="", said=[], question=question, exports=[], page="")
        self._asked.append((id_, question))
        self._new.set()

    def before(self, id_: str) -> int:
        """How many are answered before this one."""
        place = next((n for n, (asked, _) in enumerate(self._asked) if asked == id_), 0)
        return place + (self._now is not None)

    def stop(self, id_: str) -> None:
        """Answer a question no more."""
        if any(asked == id_ for asked, _ in self._asked):
            self._asked = [(asked, question) for asked, question in self._asked if asked != id_]
            self._shelf.change(id_, stage="failed", sentence=STOPPED)
        if self._now and self._now[0] == id_:
            self._stopped.add(id_)
            self._kill()

    def _kill(self) -> None:
        if self._now and self._now[1]:
            with suppress(ProcessLookupError):
                self._now[1].kill()

    async def work(self) -> None:
        """Answer questions until this task is cancelled; the process at work then ends with it."""
        try:
            while True:
                while not self._asked:
                    self._new.clear()
                    await self._new.wait()
                id_, question = self._asked.pop(0)
                with suppress(NotThere, OSError):  # deleted meanwhile, or the disk is full: the next one's turn
                    await self._answer(id_, question)
                self.lines.pop(id_, None)
                self._now = None
        finally:
            self._kill()

    async def _answer(self, id_: str, question: str) -> None:
        self._now = (id_, None)
        self._shelf.change(id_, stage="working")
        process = await _start(question, str(self._shelf.path(id_)))
        self._now, found = (id_, process), {"stage": "failed", "sentence": KILLED}
        if id_ in self._stopped:  # while the process was being started
            self._kill()
        async for line in process.stdout:
            message = json.loads(line)
            if "done" in message:
                found = {"stage": "done", **message["done"]}
            elif "refused" in message:
                found = {"stage": "failed", "sentence": message["refused"]}
            elif "said" in message:
                self._shelf.change(id_, said=message["said"])
            else:
                self.lines[id_] = message
        await process.wait()
        if id_ in self._stopped:
            found = {"stage": "failed", "sentence": STOPPED}
        self._shelf.change(id_, **found)
