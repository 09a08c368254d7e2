"""The unit of recorded rotor speeds by physics: in hover the rotors carry the weight.

Logs name a unit and write another (Gazebo puts rad/s into PX4's `esc_rpm`). The speeds at which rotors hover follow
from the mass within a third for vehicles from 27 g to 2 kg, or from a known thrust coefficient, while units are 6 to 60
apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from rotorid.recordings import columns as c
from rotorid.recordings.importers.propose import thrust_coefficient
from rotorid.recordings.importers.report import ImportFault
from rotorid.recordings.importers.units import UNITS

_USUAL_COEFFICIENT = 1.7e-5
"""C_F / (mass of the vehicle a rotor)^(4/3), N s² kg^(-4/3): thrust grows with the fourth power of the size, mass with
its third. The templates (Crazyflie to x500) have 1.4e-5 to 2.1e-5."""
_IMPOSSIBLE = 3.5
"""Speeds of hover so many times off, or more, are not in the unit that is stated."""
POSSIBLE = 2.2
"""Speeds of hover within this factor are."""


def usual_coefficient(mass_kg: float, rotors: int) -> float:
    """C_F of a multirotor of usual propellers, N s²."""
    return _USUAL_COEFFICIENT * (mass_kg / rotors) ** (4 / 3)


def in_unit_of_weight(
    runs: Mapping[str, pd.DataFrame],
    stated: Mapping[str, str],
    mass_kg: float,
    rotors: int,
    coefficient_n_s2: float | None = None,
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Flights whose rotor speeds are in the unit that carries the weight, and what was changed.

    Parameters
    ----------
    runs
        Flights in contract columns, rotor speeds by the unit that the log states.
    stated
        To each run that unit: `rad/s`, `rpm` or `hz`.
    mass_kg, rotors
        Mass as flown and number of rotors.
    coefficient_n_s2
        C_F where it is known; else that of usual propellers.
    """
    out, faults = dict(runs), []
    for written in dict.fromkeys(stated[run] for run in runs):
        mine = [run for run in runs if stated[run] == written]
        for kind in ("rotor_speed", "rotor_command"):
            names = list(c.rotor_columns(kind, rotors))
            tables = [out[run] for run in mine]
            unit, off = carrying_unit(tables, kind, written, mass_kg, rotors, coefficient_n_s2)
            if unit == written:
                if not 1 / _IMPOSSIBLE < off < _IMPOSSIBLE and np.isfinite(off):
                    found = (
                        f"in {written}, as stated, the rotors hover at {off:.2g} times the speed that carries "
                        f"{mass_kg:.3g} kg, which no unit explains: electrical turns (divide by half of the motor's "
                        "poles), or another vehicle"
                    )
                    faults.append(ImportFault("unit", kind, found, "kept as recorded", sum(len(t) for t in tables)))
                continue
            factor = UNITS["rotor"][unit] / UNITS["rotor"][written]
            for run in mine:
                if set(names) <= set(out[run].columns):
                    out[run] = out[run].assign(**{name: out[run][name] * factor for name in names})
            found = (
                f"in {written}, as the log states, the rotors hover at {off:.2g} times the speed that carries "
                f"{mass_kg:.3g} kg, in {unit} at {off * factor:.2g} times"
            )
            faults.append(ImportFault("unit", kind, found, f"taken as {unit}", sum(len(t) for t in tables)))
    return out, faults


def carrying_unit(
    tables: Sequence[pd.DataFrame],
    kind: str,
    stated: str,
    mass_kg: float,
    rotors: int,
    coefficient_n_s2: float | None = None,
) -> tuple[str, float]:
    """The unit of speeds that carries the weight, and the speed of hover in the stated one over the one expected.

    The stated one where its speeds are possible, or no other's are.
    """
    flown = thrust_coefficient(tables, mass_kg, rotors, kind=kind)
    if flown is None:
        return stated, np.nan
    expected = coefficient_n_s2 or usual_coefficient(mass_kg, rotors)
    off = float(np.sqrt(expected / flown))
    if 1 / _IMPOSSIBLE < off < _IMPOSSIBLE:
        return stated, off
    others = {u: abs(np.log(off * f / UNITS["rotor"][stated])) for u, f in UNITS["rotor"].items() if u != stated}
    best = min(others, key=others.get)
    return (best, off) if others[best] < np.log(POSSIBLE) else (stated, off)
