"""Four rotors in X shape in the order that PX4 and ArduPilot share: front right, rear left, front left, rear right."""

from __future__ import annotations

import numpy as np

from rotorid.errors import InputError

CORNERS = ((1, 1), (-1, -1), (1, -1), (-1, 1))
"""Signs of the places (x forward, y right) in that order."""
SENSES = (1, 1, -1, -1)
"""Signs of the yaw moments: front right and rear left turn counter-clockwise."""


def order_in_x(places: np.ndarray, yaw_signs: np.ndarray, name: str, tool: str) -> list[int]:
    """Which of our rotors, from 0, are the tool's 1 to 4.

    `places` (n, 3) and `yaw_signs` (n,) are those of the vehicle `name`. InputError where the rotors are not four in X
    shape, or turn the other way.
    """
    corners = {(int(np.sign(x)), int(np.sign(y))): i for i, (x, y, _) in enumerate(places)}
    if len(places) != 4 or set(corners) != set(CORNERS):
        raise InputError(f"{name}: {tool} wants four rotors in X shape, found {len(places)} rotors")
    order = [corners[corner] for corner in CORNERS]
    if tuple(int(yaw_signs[i]) for i in order) != SENSES:
        raise InputError(
            f"{name}: {tool} wants front right and rear left counter-clockwise, seen from above, the others clockwise"
        )
    return order
