"""A fleet over its flights: what its history states, where it is known what changed and since when."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, fields

import pandas as pd

from rotorid.report.fleet import history
from rotorid_proof.changes.score import sought_in
from rotorid_proof.row_by_row import as_read

ROTORS = frozenset({"share", "trim", "yaw_trim", "lift"})
SEEN_BY = {
    **dict.fromkeys(("mass_kg", "thrust_coefficient_n_s2", "translational_lift"), frozenset({"lift"})),
    **dict.fromkeys(("payload", "unequal_rotors", "com_offset"), ROTORS),
    "torque_coefficient_n_m_s2": frozenset({"yaw_trim"}),
    **dict.fromkeys(("rotor_drag", "frame_drag"), frozenset({"drag", "sideways"})),
    "thrust_tilt": frozenset({"sideways", "drag"}),
    "accelerometer_error": frozenset({"accelerometer", "sideways", "lift"}),
    "gyro_error": frozenset({"gyroscope", "gyroscope_scale", "gyroscope_turn"}),
}
"""What a history shows of a change, by kind of quantity; of a change without an entry nothing."""
GOOD, FLIGHTS = 3, 10
"""Flights of a vehicle that are the good ones, and all of them."""


@dataclass(frozen=True)
class Row:
    """One vehicle."""

    vehicle: str
    changed: str
    """Ids that changed, empty for none."""
    since: str
    """The first flight with the change."""
    stated: str
    """What the history states, `flight: quantity`, one after the other."""
    right: int
    """1 if the change is stated since the right flight, and nothing else."""
    others: int
    """Events stated that are none: a quantity that the change does not move, or another flight."""
    compared: int
    """Flights compared with the good ones."""
    seconds: float
    judged_by: str = ""
    """The code that compared them."""


@dataclass(frozen=True)
class Case:
    """A vehicle that a hash draws."""

    name: str


def cases(seed: str, vehicles: int) -> list[Case]:
    """The vehicles of a fleet; every second one changes."""
    return [Case(f"{seed}/{number:03d}") for number in range(vehicles)]


def row_of(case: Case) -> Row:
    """What the history of a vehicle states."""
    from rotorid_proof.concealed.pairs import flown
    from rotorid_proof.concealed.write import write_set

    own = flown(case.name, FLIGHTS, GOOD)
    sets = [as_read(recording, write_set, day_of(k)) for k, recording in enumerate(own.flights)]
    start = time.process_time()
    _, events = history({case.name: sets}, GOOD)
    sought = sought_in(own.truth)
    fair = {kind for s in sought for i in (s.id, *s.equivalent) for kind in SEEN_BY.get(i, ())}
    true = [since_then(e, own.since) and e.id.split("/")[0] in fair for e in events.itertuples()]
    return Row(
        vehicle=case.name,
        changed="; ".join(s.id for s in sought),
        since="" if own.since is None else day_of(own.since),
        stated="; ".join(f"{e.set}: {e.id}" for e in events.itertuples()),
        right=int(all(true) and bool(true) == (own.since is not None)),
        others=true.count(False),
        compared=FLIGHTS - GOOD,
        seconds=round(time.process_time() - start, 1),
    )


def day_of(number: int) -> str:
    """Name of a vehicle's set: one flight a day."""
    return f"flight-2026-01-{number + 1:02d}"


def since_then(event, since: int | None) -> bool:
    """Whether an event is stated of the flight from which the vehicle changed."""
    return since is not None and event.set == day_of(since)


def table(found: list[Row]) -> pd.DataFrame:
    """One row a vehicle."""
    return pd.DataFrame([asdict(r) for r in found], columns=[f.name for f in fields(Row)])
