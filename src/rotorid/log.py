"""One log file per job that holds everything: messages, warnings and the traceback of a failure."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FORMAT = "%(levelname)s %(name)s: %(message)s"


@contextmanager
def to(path: str | Path) -> Iterator[None]:
    """Send `logging`, warnings and the traceback of an exception to `path` while the block runs.

    The file is made anew. Lines carry no time of day, so that two runs leave the same log. The exception is
    raised again after it is written. Previous handlers, level and warning settings come back at the end.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handler = logging.FileHandler(path, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter(FORMAT))
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
        except BaseException:
            logging.getLogger("rotorid").exception("failed")
            raise
        finally:
            logging.captureWarnings(False)
            root.removeHandler(handler)
            root.setLevel(level)
            handler.close()


def progress(text: str) -> None:
    """One line for the person who waits."""
    print(f"  {text}", file=sys.stderr, flush=True)
