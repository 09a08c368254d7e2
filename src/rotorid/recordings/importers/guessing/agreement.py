"""What is known so far while a table is looked through, and whether one quantity of it is what another integrates to.

A gyroscope integrates to the attitude, an accelerometer (turned by the attitude, with gravity) to the velocity, a
velocity to the position. Compared are the changes over `STEP_S`, so that noise averages out and offsets hardly count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import scipy

from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import OPEN, UNITS, MappedChannel, Mapping, continuous

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
RATES_HZ = (5.0, 8000.0)
"""Rates at which tables are recorded."""
FASTEST_GYRO_RAD_S = 40.0
STEP_S = 0.2


@dataclass(frozen=True)
class Agreement:
    """How the changes of a quantity (n, 3) follow those of a candidate (n, 3) that should integrate to it.

    `correlation` about zero over all axes together, `slope` quantity per candidate, `size`, the 95 % quantile of
    the changes of the quantity, and `by_axis`, the correlation of each axis alone.
    """

    correlation: float = 0.0
    slope: float = 0.0
    size: float = 0.0
    by_axis: tuple[float, ...] = (0.0,)

    @property
    def in_words(self) -> str:
        return f"correlation {self.correlation:.2f}, factor {self.slope:.4g}"


def compare(quantity: np.ndarray, candidate: np.ndarray) -> Agreement:
    """`Agreement` of changes (n, 3); rows with a missing value take no part, and less than ten rows say nothing."""
    known = np.isfinite(quantity).all(axis=1) & np.isfinite(candidate).all(axis=1)
    if known.sum() < 10:
        return Agreement()
    a, b = quantity[known], candidate[known]
    a, b = a - np.median(a, axis=0), b - np.median(b, axis=0)
    aa, bb, ab = (a * a).sum(axis=0), (b * b).sum(axis=0), (a * b).sum(axis=0)
    if not (aa.sum() > 0 and bb.sum() > 0):
        return Agreement()
    correlation = float(ab.sum() / np.sqrt(aa.sum() * bb.sum()))
    size = float(np.quantile(np.linalg.norm(a, axis=1), 0.95))
    by_axis = tuple(float(c / np.sqrt(p * q)) if p * q > 0 else 0.0 for c, p, q in zip(ab, aa, bb, strict=True))
    return Agreement(correlation, float(ab.sum() / bb.sum()), size, by_axis)


def steps_of(time_s: np.ndarray) -> np.ndarray:
    """Instants `STEP_S` apart (longer where the clock is slow) from the first to the last of a clock (n,), s."""
    usual = float(np.median(np.diff(time_s)))
    step = max(STEP_S, 4 * usual)
    return np.arange(time_s[0], time_s[-1] + 1e-9, step)


def _at(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, k) at instants (m,) by straight lines between the samples that are there; NaN where none is."""
    out = np.full((len(instants), values.shape[1]), np.nan)
    known = np.isfinite(values).all(axis=1)
    if known.sum() > 1:
        for k in range(values.shape[1]):
            out[:, k] = np.interp(instants, time_s[known], values[known, k], left=np.nan, right=np.nan)
    return out


def changes(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Changes (m − 1, k) of values (n, k) between instants (m,)."""
    return np.diff(_at(instants, time_s, values), axis=0)


def integrated(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integrals (m − 1, k) of values (n, k) between instants (m,)."""
    known = np.isfinite(values).all(axis=1)
    if known.sum() < 2:
        return np.full((len(instants) - 1, values.shape[1]), np.nan)
    total = scipy.integrate.cumulative_trapezoid(values[known], time_s[known], axis=0, initial=0)
    return changes(instants, time_s[known], total)


def turned(instants: np.ndarray, time_s: np.ndarray, wxyz: np.ndarray) -> np.ndarray:
    """Rotations in body axes (m − 1, 3), rad, between instants by quaternions (n, 4), scalar first, body to world."""
    turns = rotations(_at(instants, time_s, wxyz))
    if turns is None:
        return np.full((len(instants) - 1, 3), np.nan)
    rotation, known = turns
    out = np.full((len(instants) - 1, 3), np.nan)
    both = known[1:] & known[:-1]
    full = np.full((len(instants), 4), [0.0, 0.0, 0.0, 1.0])
    full[known] = rotation.as_quat()
    every = scipy.spatial.transform.Rotation.from_quat(full)
    out[both] = (every[:-1].inv() * every[1:]).as_rotvec()[both]
    return out


def rotations(wxyz: np.ndarray) -> tuple[scipy.spatial.transform.Rotation, np.ndarray] | None:
    """Rotations of the quaternions (n, 4) that are known, and their mask; None where there is none."""
    known = np.isfinite(wxyz).all(axis=1) & (np.linalg.norm(np.nan_to_num(wxyz), axis=1) > 1e-6)
    return (scipy.spatial.transform.Rotation.from_quat(wxyz[known][:, [1, 2, 3, 0]]), known) if known.any() else None


def into_world(time_s: np.ndarray, wxyz: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of the body turned into the world by quaternions (n, 4) with gaps, which are bridged."""
    out = np.full(vectors.shape, np.nan)
    turns = rotations(_at(time_s, time_s, wxyz))
    if turns is not None:
        rotation, known = turns
        out[known] = rotation.apply(vectors[known])
    return out


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
    compass: bool = False
    """Whether the attitude's yaw is a compass heading, clockwise where the world's z is up."""
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
        return integrated(self.instants, self.time_s, values)

    def changes(self, values: np.ndarray) -> np.ndarray:
        return changes(self.instants, self.time_s, values)


def triples_of(draft: Draft) -> list[Family]:
    free = draft.free()
    more = {n for f in named.numbered(free) if len(f.columns) > 3 for n in f.columns}  # `w0` to `w3` are no three axes
    found = [f for axes in named.AXES for f in named.families(free, axes) if axes.isalpha() or not more & {*f.columns}]
    found += named.body_rates(free)
    found += _with_units(draft, named.of_mavlink(free))
    return [f for f in found if np.isfinite(draft.values(f.columns)).all(axis=1).sum() > 1]


def _with_units(draft: Draft, families: list[Family]) -> list[Family]:
    """MAVLink's sensors: m/s² and rad/s in HIGHRES_IMU; thousandths of g and rad/s in the messages of raw integers."""
    thousandths = 100.0  # Median size of an accelerometer's reading above which it counts thousandths of g.
    message = {f.words - {f.stem}: f for f in named.of_mavlink(draft.table.columns) if f.stem == "acc"}
    out = []
    for family in families:
        if (force := message.get(family.words - {family.stem})) is not None:
            sizes = np.linalg.norm(draft.values(force.columns), axis=1)
            raw = bool(np.isfinite(sizes).any()) and float(np.nanmedian(sizes)) > thousandths
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
    # The same where counts of usual sensors are near: 16.4 to 1 deg/s are 1.064 thousandths of rad/s each.
    factor_off_counts = 0.03
    off = {"mrad/s": factor_off_counts}
    return next((u for u, f in UNITS[kind].items() if abs(slope / f - 1) < off.get(u, FACTOR_OFF)), None)


def in_words(agreed: Agreement, kind: str, what: str) -> str:
    """What a comparison that did not confirm says."""
    if agreed.size <= MOVES[kind]:
        return f"too little motion to compare with {what}"
    if agreed.correlation < CONTRADICTED:
        return f"does not agree with {what} ({agreed.in_words})"
    return f"agrees with {what} in part only ({agreed.in_words})"
