"""Whether what is believed of a vehicle can be true of any: bodies, rotors and names."""

from __future__ import annotations

import numpy as np

from rotorid.errors import InputError
from rotorid.io.text.names import hint, listed
from rotorid.recordings.vehicle import Vehicle

TRUSTED = (
    "mass_kg",
    "thrust_coefficient_n_s2",
    "torque_coefficient_n_m_s2",
    "inertia_kg_m2",
    *(f"inertia_{axis}{unit}" for axis in ("xx", "yy", "zz") for unit in ("_kg_m2", "")),
    "arm_scale",
    "rotor_speed_limits_rad_s",
    "reading_gain",
    *(f"reading_gain_{axis}" for axis in "xyz"),
)
"""Names that `trust` may give a one-sigma of."""
NO_BODY = 1.25
"""A principal moment is at most the sum of the others; an inertia believed may be wrong by this factor."""
ONE_SPOT_M = 1e-4


def check_belief(vehicle: Vehicle, where: str) -> None:
    """InputError in one sentence for what no vehicle of a recording set can be; `where` names its file."""
    for key in ("effects", "derivatives", "reading_gain"):
        if getattr(vehicle, key):
            raise InputError(
                f"{where}: {key}: belongs in improved_vehicle.yaml, which the simulator runs; a recording is compared "
                f"with a believed vehicle without {key}"
            )
    for key in vehicle.trust:
        if key not in TRUSTED:
            raise InputError(f"{where}: trust.{key}: no such value is known{hint(key, TRUSTED)}")
    _check_rotors(vehicle, where)
    if vehicle.inertia_kg_m2 is not None:
        least, middle, largest = np.linalg.eigvalsh(vehicle.inertia_kg_m2.matrix())
        if largest > NO_BODY * (least + middle):
            raise InputError(
                f"{where}: inertia_kg_m2: found principal moments {least:.3g}, {middle:.3g} and {largest:.3g}; no body "
                "has one that is larger than the sum of the others"
            )


def _check_rotors(vehicle: Vehicle, where: str) -> None:
    hubs = vehicle.rotor_positions_m()
    for first in range(len(hubs)):
        near = np.flatnonzero(np.linalg.norm(hubs[first + 1 :] - hubs[first], axis=1) < ONE_SPOT_M)
        if len(near):
            second = first + 1 + int(near[0])
            spot = listed([f"{name} {value:g} m" for name, value in zip("xyz", hubs[first], strict=True)])
            raise InputError(f"{where}: rotors {first + 1} and {second + 1} are on one spot ({spot})")
