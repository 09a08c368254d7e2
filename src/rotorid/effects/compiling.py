"""Functions compiled to machine code that is kept between runs where there is a place for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(**options: Any) -> Callable[[Callable], Callable]:
    """A decorator like `numba.njit`, with its cache where numba finds a folder that it may write into.

    An installation that cannot be written, for a user without a home directory, has none: there the function is
    compiled in each process anew.
    """

    def decorated(function: Callable) -> Callable:
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return decorated
