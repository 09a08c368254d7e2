"""Who chooses the effects of a flight: the search with its rules or, on the bench for decisions, the posterior."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from rotorid.mismatch.posterior.choose import PosteriorSearch
from rotorid.mismatch.regression import Regression
from rotorid.mismatch.select import Questions, Search


@dataclass(frozen=True)
class Choosing:
    """How the effects of a flight are chosen."""

    search: Callable[[Regression, Questions], Search | PosteriorSearch] = Search
    by_channel: bool = False
    """Whether products are kept channel by channel: the posterior needs them, the search does not."""


SEARCH, KEPT, POSTERIOR = Choosing(), Choosing(by_channel=True), Choosing(PosteriorSearch, by_channel=True)
"""The search alone, the same with evidence kept for the posterior, and the posterior in its place."""
_CHOOSING: ContextVar[Choosing] = ContextVar("choosing", default=SEARCH)


def choosing() -> Choosing:
    """How effects are chosen now."""
    return _CHOOSING.get()


@contextmanager
def chosen_by(how: Choosing) -> Iterator[None]:
    """Choose effects in some way inside."""
    token = _CHOOSING.set(how)
    try:
        yield
    finally:
        _CHOOSING.reset(token)
