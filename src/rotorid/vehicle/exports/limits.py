"""What other tools ask of a vehicle beyond that it is one: asked before a file for them is made.

Whether a vehicle may be delivered is asked elsewhere (`rotorid.mismatch.delivery.usable`, with room for the error of an
estimate). A tool that wants more takes nothing from the vehicle: its file is not written, and a sentence says why.
"""

from __future__ import annotations

import numpy as np

from rotorid.io.text.names import listed

FOUR_ROTORS = {"rotorpy": "RotorPy", "gym-pybullet-drones": "gym-pybullet-drones"}
"""Forms of tools that fly four rotors and no other number."""
EXACT_BODIES = {"mjcf": "MuJoCo", "sdf": "Gazebo"}
"""Forms of tools that take no inertia with a principal moment above the sum of the others, by however little."""


def refusal(to: str, rotor_count: int, inertia_kg_m2: np.ndarray) -> str:
    """Why the tool of a form does not take a vehicle with this inertia (3, 3); no full stop, empty where it does."""
    if to in FOUR_ROTORS and rotor_count != 4:
        return f"{FOUR_ROTORS[to]} knows four rotors, found {rotor_count}"
    principal = np.linalg.eigvalsh(inertia_kg_m2)
    if to in EXACT_BODIES and (principal[0] <= 0 or principal[2] > (principal[0] + principal[1]) * (1 + 1e-9)):
        shown = listed([f"{moment:.5g}" for moment in principal])
        return (
            f"{EXACT_BODIES[to]} takes no principal moment of inertia above the sum of the others, found {shown} kg m2"
        )
    return ""
