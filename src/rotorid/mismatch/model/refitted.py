"""The believed vehicle with values refitted and no physics added: what an effect must do better than."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rotorid.mismatch.decision.decide import wrong_values
from rotorid.mismatch.decision.select import Selection
from rotorid.mismatch.model.delivered import Values
from rotorid.mismatch.model.wrench import WrenchModel


def values_alone(model: WrenchModel) -> Values:
    """The believed values that the recordings contradict where no effect is at work.

    Given a wind no value is called wrong: it acts through the drag.
    """
    if model.wind is not None:
        return {}
    nothing = Selection([], model.selection.fit)
    return wrong_values(model.search.regression, nothing, size_of_value(model))


def size_of_value(model: WrenchModel) -> Callable[[str, float], float]:
    """Function of a value and its relative change that gives the change's size in units of the noise."""

    def size(key: str, change: float) -> float:
        return float(model.search.ask.sizes_of(key, np.array([change])).max())

    return size
