"""What a planting is, and what a verdict must say of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from rotorid.recordings import RecordingSet

LARGE, SMALL = "large", "small"


@dataclass(frozen=True)
class Size:
    """One true number of a planted cause, in the symbol and unit of the catalogue's effect."""

    effect: str
    symbol: str
    value: float
    added: bool = True
    """Whether it adds to what the untouched flight states of the symbol; a length of time without sign does not."""


@dataclass(frozen=True)
class Ratio:
    """A product of believed values that the flight shows: Σ exponent · log(refitted / believed) is what is true of it.

    A flight shows thrust over mass, not either: which of the two is refitted is free, their ratio is not.
    """

    exponents: Mapping[str, float]
    value: float
    """True logarithm of the product over the believed one, beyond what the untouched flight states."""


@dataclass(frozen=True)
class Truth:
    """What was planted and what counts as naming it."""

    names: frozenset[str]
    """Ids of effects, or names of vehicle.yaml, each of which names the cause by itself."""
    fair: frozenset[str]
    """Further names that no such flight distinguishes from it: a class of these and `names` is a fair answer."""
    sizes: tuple[tuple[Size, ...], ...] = ()
    """True numbers, one tuple for each form in which the effect may be reported."""
    ratio: Ratio | None = None
    form_bound: bool = False
    """Whether an effect reported in a form that has none of `sizes` counts as one of wrong size."""
    unseen: str = ""
    """Why the columns of this flight cannot show it at all; empty where they can."""
    shown_by: frozenset[str] = frozenset()
    """Ids of which the untouched flight must state one for the cause to show at all (wind shows through drag)."""
    hidden_by: frozenset[str] = frozenset()
    """Ids that make up for the cause where the untouched flight states one (a curve of the throttle for a mass)."""
    first_only: frozenset[str] = frozenset()
    """Ids given which the true form is none of the catalogue's (two lags in series), so that no size is compared."""


def named(*names: str, fair: tuple[str, ...] = (), **more) -> Truth:
    """A truth by its names and what is fair in addition."""
    return Truth(frozenset(names), frozenset(fair), **more)


Plant = Callable[[RecordingSet, float, np.random.Generator], tuple[RecordingSet, Truth]]


@dataclass(frozen=True)
class Kind:
    """One way of planting, in two sizes."""

    family: str
    name: str
    touches: frozenset[str]
    """Sensors or values that it changes: kinds of a pair must not share any."""
    sizes: Mapping[str, float]
    """Number for `large` and `small`, or for `large` alone where a size has no meaning."""
    fits: Callable[[RecordingSet], bool]
    """Whether a set has what is to be changed."""
    plant: Plant = field(compare=False)


def both(large: float, small: float) -> dict[str, float]:
    """The two sizes of a kind."""
    return {LARGE: large, SMALL: small}


def once(value: float = 1.0) -> dict[str, float]:
    """The one size of a mistake that is there or not."""
    return {LARGE: value}
