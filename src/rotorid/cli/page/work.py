"""What the page's own processes do: look at logs, make a verdict, compare. They speak a line of JSON a message.

A process of its own for each verdict: one that is killed, or takes all memory, ends alone, and the page says so. One
for all looks, which has its libraries loaded, so that a look takes no longer than reading the log does.

    python -m rotorid.cli.page.work look              reads requests from standard input until it closes
    python -m rotorid.cli.page.work verdict FOLDER    FOLDER is that of a set on the page's shelf
    python -m rotorid.cli.page.work compare FOLDER
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import threading
import time
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from rotorid.cli.console import heard, sentence_of
from rotorid.cli.page.looks import Wishes, look
from rotorid.cli.page.shelf import ANSWER, LOGS, SET, STATE
from rotorid.errors import InputError
from rotorid.io.text.writing import write_texts


def _speaker() -> Callable[..., None]:
    """A function that writes messages where standard output was; what libraries print goes nowhere from now on."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    lock = threading.Lock()

    def say(**message: Any) -> None:
        try:
            with lock:
                out.write(json.dumps(message, ensure_ascii=True) + "\n")
                out.flush()
        except BrokenPipeError:  # the page is gone: nobody would read the answer
            os._exit(1)

    return say


def _looks(say: Callable[..., None]) -> None:
    """Answer requests until nobody asks."""
    # Loaded before the first log comes: what importers and checks load when they need it.
    import scipy.interpolate
    import scipy.optimize
    import scipy.signal
    import scipy.sparse.linalg  # noqa: F401

    from rotorid.cli.page import looks
    from rotorid.recordings.importers import guessing, logfile  # noqa: F401

    looks.known_templates()

    for line in sys.stdin:
        asked = json.loads(line)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                folder = Path(asked["folder"])
                say(look=look(folder, [folder / LOGS / n for n in asked["logs"]], Wishes(**asked["wishes"])))
        except Exception as error:
            say(refused=_sentence_on(error, Path(asked["folder"])))


def _sentence_on(error: Exception, folder: Path) -> str:
    """The sentence on an error, without the page's own folders: a visitor knows the log's name alone."""
    said = sentence_of(error) or f"unexpected {type(error).__name__}"
    for own in (folder / LOGS, folder / SET, folder):
        said = said.replace(f"{own}{os.sep}", "")
    return said


@contextmanager
def _heard(command: str, say: Callable[..., None]) -> Iterator[None]:
    """Inside, it is said every second at which step the work is and how long is left, where earlier runs tell."""
    say_every_s, over = 1.0, threading.Event()
    with heard(command) as waiting:

        def tell() -> None:
            while not over.wait(say_every_s):
                say(step=": ".join(waiting.path[-2:]) or "reading", line=waiting.line().strip())

        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            yield
        finally:
            over.set()
            teller.join()


def _verdict(folder: Path, state: dict[str, Any], say: Callable[..., None]) -> dict[str, Any]:
    """Import the logs, write the set and the verdict's files, and every export; what the page says of it."""
    from rotorid.cli.sets import make_set
    from rotorid.cli.verdicts import write_verdict
    from rotorid.mismatch.tell.steps import steps_sentence

    logs = [folder / LOGS / name for name in state["logs"]]
    own, answer = folder / SET / logs[0].name.split(".")[0], folder / ANSWER
    shutil.rmtree(folder / SET, ignore_errors=True)
    with _heard("verdict", say):
        stated = Wishes(**state["wishes"]).stated(folder)
        say(step="importing", line="importing the logs")
        make_set(logs, own, stated)
        found = write_verdict(own, answer)
    _pack(own, answer / "recording_set.zip")
    exported = _exports(answer)
    said = [text for text in (steps_sentence(found),) if text]  # doubts and warnings stand on top of the report
    return {"sentence": found.sentence, "said": said, "exports": exported, "page": "report.html"}


def _exports(answer: Path) -> list[dict[str, Any]]:
    """Write the improved vehicle in every form that takes it; to each form its file, or why there is none."""
    from rotorid.recordings import read_vehicle
    from rotorid.vehicle.exports import export_vehicle, names

    path, out = answer / "improved_vehicle.yaml", []
    if not path.is_file():
        return out
    vehicle = read_vehicle(path)
    for form in names():
        try:
            made = export_vehicle(vehicle, form)
        except InputError as error:
            out.append({"form": form, "file": "", "left_out": [str(error)]})
            continue
        name, texts = f"{form}.zip", {made.file_name: made.text, **made.companions}
        if len(texts) == 1:
            name = f"{form}-{made.file_name}"
            write_texts({answer / name: made.text})
        else:
            with zipfile.ZipFile(answer / name, "w", zipfile.ZIP_DEFLATED) as packed:
                for file, text in texts.items():
                    packed.writestr(file, text)
        out.append({"form": form, "file": name, "left_out": list(made.left_out)})
    return out


def _pack(folder: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(p for p in folder.iterdir() if p.is_file()):
            packed.write(path, f"{folder.name}/{path.name}")


def _compare(folder: Path, state: dict[str, Any], say: Callable[..., None]) -> dict[str, Any]:
    """Hold the log in question against the others: what differs is said as soon as it is known."""
    from rotorid.cli.verdicts import MOST_PARAMETERS, changes_text, compared
    from rotorid.mismatch.changes.words import sentences
    from rotorid.recordings.settings import differing_sentences
    from rotorid.report.page import make_changes_page

    asked = state["in_question"]
    logs = [folder / LOGS / name for name in (*(n for n in state["logs"] if n != asked), asked)]
    answer, said = folder / ANSWER, []

    def tell(sentences: Sequence[str]) -> None:
        said.extend(sentences)
        say(said=said)

    with _heard("compare on the page", say):
        found, changed = compared(logs, tell, lambda command: nullcontext(), Wishes(**state["wishes"]).stated(folder))
    texts = {"changes.html": make_changes_page(found), "changes.json": changes_text(found, changed)}
    write_texts({answer / name: text for name, text in texts.items()})
    first, *more = sentences(found)
    said = [*differing_sentences(changed, MOST_PARAMETERS), *more]
    return {"sentence": first, "said": said, "exports": [], "page": "changes.html"}


def main(words: list[str]) -> None:
    """Do what the words say; see the module."""
    nice = 5  # By how much a verdict gives way to the page and to whatever else runs.
    say = _speaker()
    if words == ["look"]:
        _looks(say)
        return
    question, folder = words[0], Path(words[1])
    if hasattr(os, "nice"):
        os.nice(nice)
    started = time.monotonic()
    try:
        state = json.loads((folder / STATE).read_text(encoding="utf-8"))
        shutil.rmtree(folder / ANSWER, ignore_errors=True)
        (folder / ANSWER).mkdir()
        found = {"verdict": _verdict, "compare": _compare}[question](folder, state, say)
    except Exception as error:
        say(refused=_sentence_on(error, folder))
        return
    say(done=found | {"seconds": round(time.monotonic() - started, 1)})


if __name__ == "__main__":
    main(sys.argv[1:])
