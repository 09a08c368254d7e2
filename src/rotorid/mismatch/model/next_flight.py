"""What to do next about the first class that a set leaves open.

By how many standard errors a flight would separate the class is not stated here: that hangs on what can be flown, and
takes every candidate flown in simulation by every competing model, ten seconds and more. `rotorid plan`
(`rotorid.plan.plan`) computes it, and is the only one to state it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of, ids_of_stage
from rotorid.effects.contract import CURVE
from rotorid.effects.describe import advice
from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.model.fitted import Fitted
from rotorid.recordings import RecordingSet
from rotorid.vehicle.mixer import hover_speed_rad_s

CURVES = (*ids_of_stage(CURVE), *ids_of("curves_thrust"))
"""Between throttle and speed, and between speed and thrust: one column where no speed is measured."""


@dataclass(frozen=True)
class NextFlight:
    """What to do, and the ids that it separates; empty where nothing is open."""

    manoeuvre: str = ""
    separates: tuple[str, ...] = ()


def next_flight(findings: Sequence[Finding], recordings: RecordingSet, found: Fitted | None = None) -> NextFlight:
    """For the first class that the data leave open; `found` is the model of a flight's set."""
    for finding in findings:
        if finding.status == "ambiguous":
            ids = tuple(finding.alternatives)
            needed = "" if found is None else beyond_flying(found, ids)
            return NextFlight(needed or advice(catalogue()[finding.id], recordings), ids)
    return NextFlight()


def beyond_flying(found: Fitted, ids: Sequence[str]) -> str:
    """What it takes to settle a class that no flight with the columns of its set can settle; empty where one may."""
    if not (found.commanded and set(CURVES) <= set(ids)):
        return ""
    throttle, thrust = _speeds_in_hover(found)
    return (
        f"record the rotor speeds, or hold an optical tachometer to a rotor in hover ({throttle:.0f} rad/s if the "
        f"throttle is curved, {thrust:.0f} rad/s if the thrust is): where speeds are known from their commands alone "
        "both curves are one"
    )


def _speeds_in_hover(found: Fitted) -> tuple[float, float]:
    """Rotor speed, rad/s, in hover if a throttle curve is at work, and if a thrust curve is.

    With a throttle curve the rotors turn as fast as the believed C_F needs; with a thrust curve as commanded.
    """
    commands = np.concatenate([s.command.mean(axis=1) for s in found.prepared.segments if s.command is not None])
    return hover_speed_rad_s(found.prepared.vehicle), float(np.median(commands))
