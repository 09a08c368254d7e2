"""Speeds, commanded speeds and throttles of rotors."""

from __future__ import annotations

import numpy as np

from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.draft import (
    BY_NUMBERS_ALONE,
    CONTRADICTED,
    Draft,
)
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import OPEN
from rotorid.recordings.importers.units import UNITS


def guess_rotors(draft: Draft, quantity: str) -> None:
    offered = [f for f in named.numbered(draft.free()) if named.is_rotor(f, quantity)]
    how = "by their names"
    if (
        not offered
        and quantity == "throttle"
        and not {"throttle", "rotor_speed", "rotor_command"} & set(draft.channels)
    ):
        offered, how = (
            [f for f in named.numbered(draft.free()) if _carries(draft, f) > BY_NUMBERS_ALONE - 0.1],
            "no name says it",
        )
    if not offered:
        return
    family = offered[0]
    values = draft.values(family.columns)
    if not np.isfinite(values).any():
        return
    top = float(np.nanquantile(values, 0.99))
    evidence = f"{how}; up to {top:.5g}"
    follows = _carries(draft, family)
    if follows > CONTRADICTED:
        evidence += f"; with them grows the specific force along z (correlation {follows:.2f})"
    if quantity != "throttle":
        unit, why = _speed_unit(family, float(np.nanmedian(values)))
        draft.put(quantity, family.columns, f"{evidence}; {why}", "" if unit != OPEN else why, unit=unit)
        return
    if top <= 1.05:
        draft.put(quantity, family.columns, f"{evidence}, so a share", unit="1")
        return
    low, high = (0, 100) if top <= 105 else (1000, 2000) if top <= 2100 else (0, 65535)
    more = f"so no throttle is taken as {low} and full throttle as {high}"
    draft.put(quantity, family.columns, f"{evidence}, {more}", unit="raw", range=(float(low), float(high)))


def _speed_unit(family: Family, middle: float) -> tuple[str, str]:
    """Unit of rotor speeds by their names, else by where only one is possible; and why."""
    if family.unit in UNITS["rotor"]:
        return family.unit, "the names state the unit"
    if "rpm" in "_".join(family.words) and middle > 1000:
        return "rpm", "the names state the unit"
    if middle > 5000:
        return "rpm", f"a median of {middle:.4g} is too fast for rad/s"
    if 600 < middle < 1500:
        return "rad/s", f"a median of {middle:.4g} is too slow for rpm and too fast for Hz"
    return OPEN, f"a median of {middle:.4g} can be {'rad/s or Hz' if middle <= 600 else 'rad/s or rpm'}"


def _carries(draft: Draft, family: Family) -> float:
    """Correlation of the mean of the columns with the size of the specific force along z, over short steps."""
    force = draft.channels.get("specific_force")
    if force is None or draft.instants is None:
        return 0.0
    values = draft.values(family.columns)
    if not np.nanmin(values) >= 0:
        return 0.0
    drive = draft.integrated(values.mean(axis=1, keepdims=True))[:, 0]
    pull = np.abs(draft.integrated(draft.values(force.columns)[:, [2]]))[:, 0]
    known = np.isfinite(drive) & np.isfinite(pull)
    if known.sum() < 10 or drive[known].std() == 0 or pull[known].std() == 0:
        return 0.0
    return float(np.corrcoef(drive[known], pull[known])[0, 1])
