"""The steps of a long computation, as whoever waits for it hears of them, and how many threads it has."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_Listener = Callable[[tuple[str, ...]], None]
"""Takes the names of the steps that are open, the outermost first."""

_open: ContextVar[tuple[str, ...]] = ContextVar("open", default=())
_listener: ContextVar[_Listener] = ContextVar("listener", default=lambda path: None)


@contextmanager
def heard_by(listener: _Listener) -> Iterator[None]:
    """The listener is called with the open steps whenever one begins or ends."""
    outer = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(outer)


@contextmanager
def step(name: str) -> Iterator[None]:
    """A step of that name, as a block or on a function: `@step("searching")`."""
    tell, outer = _listener.get(), _open.get()
    token = _open.set((*outer, name))
    tell((*outer, name))
    try:
        yield
    finally:
        _open.reset(token)
        tell(outer)


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra in one thread, as a block or on a function.

    The matrices are small: a second thread saves no time where a core is free, and where none is the two wait for each
    other and take several times as long.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield
