"""The table of faults: what was tried, and what was seen before it was mended (or that it held from the first).

`python -c "from tests.acquire.fault_table import show; show()"` prints it.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

HELD = "held when it was first tried"
TABLE: list[tuple[str, str, str]] = []  # fault, what was seen before, test


def seen(fault: str, before: str = HELD) -> Callable:
    """Enter a test into the table."""

    def enter(test: Callable) -> Callable:
        TABLE.append((fault, before, test.__name__))
        return test

    return enter


def show() -> None:
    """Print the table: fault, what was seen before, test."""
    for path in sorted(Path(__file__).parent.glob("test_*.py")):  # importing them fills it
        import_module(f"{__package__}.{path.stem}")
    for fault, before, test in TABLE:
        print(f"{fault}\t{before}\t{test}")
