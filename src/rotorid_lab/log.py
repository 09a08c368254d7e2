"""One log file per job that holds everything: messages, warnings, a failure's traceback, the reason of a refusal."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rotorid.errors import InputError

_FORMAT = "%(levelname)s %(name)s: %(message)s"


@contextmanager
def to(path: str | Path) -> Iterator[None]:
    """Send `logging`, warnings and the traceback of an exception to `path` while the block runs.

    The file is made anew. Lines carry no time of day, so that two runs leave the same log. The exception is
    raised again after it is written. Bad input is no fault of the code: it ends the process with its one sentence,
    which is then the log's last line. Previous handlers, level and warning settings come back at the end.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handler = logging.FileHandler(path, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter(_FORMAT))
    root = logging.getLogger()
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        logging.captureWarnings(True)
        try:
            yield
            logging.getLogger("rotorid").info("done")
        except InputError as error:
            logging.getLogger("rotorid").error("%s", error)
            raise SystemExit(f"rotorid: {error}") from None
        except SystemExit as end:
            logging.getLogger("rotorid").error("%s", str(end.code).removeprefix("rotorid: "))
            raise
        except BaseException:
            logging.getLogger("rotorid").exception("failed")
            raise
        finally:
            logging.captureWarnings(False)
            root.removeHandler(handler)
            root.setLevel(level)
            handler.close()


_REFUSED = "ERROR rotorid: "
"""How the last line of the log of a refused job begins."""


def refusal(path: str | Path) -> str | None:
    """The sentence that a job ended with, from its log; None where it ended otherwise."""
    lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    return lines[-1].removeprefix(_REFUSED) if lines and lines[-1].startswith(_REFUSED) else None


def progress(text: str) -> None:
    """One line for the person who waits."""
    print(f"  {text}", file=sys.stderr, flush=True)
