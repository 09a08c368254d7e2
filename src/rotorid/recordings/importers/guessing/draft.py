"""What is known so far while a table is looked through, and the limits by which numbers decide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import Agreement
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import OPEN, MappedChannel, Mapping, continuous
from rotorid.recordings.importers.units import UNITS

CONFIRMED = 0.8
"""Correlation of changes from which one quantity is what the other integrates to."""
BY_NUMBERS_ALONE = 0.95
"""The same where no name says it."""
CONTRADICTED = 0.5
_CLEARLY = 0.5
"""Share of another reading's unexplained energy that a reading may leave to be taken without a question."""
MOVES = {"angle": 0.02, "velocity": 0.1, "position": 0.05}
"""Changes over a step below which a table says nothing: rad, m/s, m."""
FACTOR_OFF = 0.15
"""How far a factor may be from that of a unit."""
_FACTOR_OFF_COUNTS = 0.03
"""The same where counts of usual sensors are near: 16.4 to 1 deg/s are 1.064 thousandths of rad/s each."""
RATES_HZ = (5.0, 8000.0)
"""Rates at which tables are recorded."""
_THOUSANDTHS = 100.0
"""Median size of an accelerometer's reading above which it counts thousandths of g."""
FASTEST_GYRO_RAD_S = 40.0


@dataclass
class Draft:
    """A mapping that is proposed, why (by channel, `body` and `world`), and what only a person can answer."""

    table: pd.DataFrame
    time_s: np.ndarray | None = None
    """(n,); None where no clock is recognised."""
    channels: dict[str, MappedChannel] = field(default_factory=dict)
    evidence: dict[str, str] = field(default_factory=dict)
    open: dict[str, str] = field(default_factory=dict)
    """To a channel, `body` or `world` the question."""
    left_out: list[str] = field(default_factory=list)
    """Columns that hold something else than numbers, a sentence each."""
    mapping: Mapping | None = None
    """What is proposed, once all has been looked at."""
    wxyz: np.ndarray | None = None
    """Attitude as recorded (n, 4), where its order is known."""
    instants: np.ndarray | None = None
    world: str = OPEN
    """Axes that the attitude refers to, where they are known."""

    def values(self, columns: Sequence[str]) -> np.ndarray:
        return self.table[list(columns)].to_numpy(float)

    def free(self) -> list[str]:
        taken = {n for channel in self.channels.values() for n in channel.columns}
        return [n for n in self.table.columns if n not in taken]

    def put(self, name: str, columns: Sequence[str], evidence: str, question: str = "", **more) -> None:
        self.channels[name] = MappedChannel(columns=tuple(columns), **more)
        self.evidence[name] = evidence
        if question:
            self.open[name] = question

    def integrated(self, values: np.ndarray) -> np.ndarray:
        return by.integrated(self.instants, self.time_s, values)

    def changes(self, values: np.ndarray) -> np.ndarray:
        return by.changes(self.instants, self.time_s, values)


def triples_of(draft: Draft) -> list[Family]:
    free = draft.free()
    more = {n for f in named.numbered(free) if len(f.columns) > 3 for n in f.columns}  # `w0` to `w3` are no three axes
    found = [f for axes in named.AXES for f in named.families(free, axes) if axes.isalpha() or not more & {*f.columns}]
    found += named.body_rates(free)
    found += _with_units(draft, named.of_mavlink(free))
    return [f for f in found if np.isfinite(draft.values(f.columns)).all(axis=1).sum() > 1]


def _with_units(draft: Draft, families: list[Family]) -> list[Family]:
    """MAVLink's sensors: m/s² and rad/s in HIGHRES_IMU; thousandths of g and rad/s in the messages of raw integers."""
    message = {f.words - {f.stem}: f for f in named.of_mavlink(draft.table.columns) if f.stem == "acc"}
    out = []
    for family in families:
        if (force := message.get(family.words - {family.stem})) is not None:
            sizes = np.linalg.norm(draft.values(force.columns), axis=1)
            raw = bool(np.isfinite(sizes).any()) and float(np.nanmedian(sizes)) > _THOUSANDTHS
            units = {"acc": ("m/s2", "mg"), "gyro": ("rad/s", "mrad/s")}[family.stem]
            family = replace(family, unit=units[raw])
        out.append(family)
    return out


def signed_continuous(wxyz: np.ndarray) -> np.ndarray:
    known = np.isfinite(wxyz).all(axis=1)
    out = np.array(wxyz, float)
    if known.any():
        out[known] = continuous(out[known])
    return out


def is_clear(agreed: Agreement, other: Agreement) -> bool:
    """Whether a reading leaves so much less unexplained than another that it is taken without a question."""
    return 1 - agreed.correlation**2 < _CLEARLY * (1 - max(other.correlation, 0.0) ** 2)


def unit_by_factor(kind: str, slope: float) -> str | None:
    """The unit whose factor a slope is within `FACTOR_OFF` of; None where there is none."""
    off = {"mrad/s": _FACTOR_OFF_COUNTS}
    return next((u for u, f in UNITS[kind].items() if abs(slope / f - 1) < off.get(u, FACTOR_OFF)), None)


def in_words(agreed: Agreement, kind: str, what: str) -> str:
    """What a comparison that did not confirm says."""
    if agreed.size <= MOVES[kind]:
        return f"too little motion to compare with {what}"
    if agreed.correlation < CONTRADICTED:
        return f"does not agree with {what} ({agreed.in_words})"
    return f"agrees with {what} in part only ({agreed.in_words})"
