"""A pendulum below a vehicle: how it swings, and how long its cable may be."""

from dataclasses import dataclass
from functools import lru_cache
from math import exp, sqrt

import numpy as np

from rotorid.effects.contract import compiled

_SWING_RATE_HZ = 100.0
"""Rate of the pendulum's own steps: thirty a radian for the shortest cable allowed."""
_SCAN_RATE_HZ = 20.0
"""Rate at which lengths are tried: a swing has less than 2 Hz."""
_SHORTEST_SCAN = 40
"""Instants that a stretch must have to say anything about a length."""
_PIECE_S = 10.0
"""Pieces that are scanned each by itself, two swings of the longest cable: what swings wildly in one manoeuvre, or hung
otherwise before, does not drown the others."""
_LENGTHS_TRIED = 180
"""Steps of two in a hundred: the phase of a swing of a minute determines the length so well."""
_MOST_LIKELY = 3
_LEAST_EXPLAINED = 0.1
"""Share of the pulls' squares that small swings must explain for a length to be looked at more closely."""
_NEAR, _LENGTHS_NEAR = 1.12, 17
"""A length of large swings is off by less in the scan of small ones; steps of 1.4 %."""
_RATIOS_TRIED = (0.005, 0.03)
_LEAST_HANG = 0.3
"""Share of gravity that must pull down for the small angles of the scan."""


def cable_pull(hanging, time_s, length_m, damping_ratio, gravity_m_s2, hung=None, swung_by=None):
    """Pull of a payload of one kilogram on its hook, (n, 3), N, world axes; as `swing`. A cable does not push.

    `swung_by` (n, 3) moves the payload where that is not `hanging`, which pulls at the cable.
    """
    swung_by = hanging if swung_by is None else swung_by
    direction, rate_square = swing(swung_by, time_s, length_m, damping_ratio, gravity_m_s2, hung)
    tension = np.maximum(np.einsum("ni,ni->n", hanging, direction) + length_m * rate_square, 0.0)
    return tension[:, None] * direction


def swing(hanging, time_s, length_m, damping_ratio, gravity_m_s2, hung=None):
    """Direction (n, 3) and squared rate (n,), rad²/s², of a pendulum in world axes; as `swing_states`."""
    states = swing_states(hanging, time_s, length_m, damping_ratio, gravity_m_s2, hung)
    return states[:, :3], states[:, 3]


def swing_states(hanging, time_s, length_m, damping_ratio, gravity_m_s2, hung=None):
    """Direction, squared rate (rad²/s²) and rate of the direction (1/s), (n, 7), of a spherical pendulum in world axes.

    n'' = (e − (e·n) n)/L − |n'|² n − 2 ζ ω n', ω² = g/L, e = `hanging` (n, 3), m/s2, by leapfrog on blocks of
    instants, which are averaged before and interpolated between afterwards. It takes the states `hung` (as
    `Motion.hung`) at their instants, or starts at rest.
    """
    size = len(hanging)
    dt = float(np.median(np.diff(time_s))) if size > 1 else 1.0 / _SWING_RATE_HZ
    block = max(1, min(round(1.0 / (_SWING_RATE_HZ * dt)), size))
    edges = np.arange(0, size, block)
    counts = np.diff(np.append(edges, size))[:, None]
    coarse, instants = np.add.reduceat(hanging, edges) / counts, np.add.reduceat(time_s, edges) / counts[:, 0]
    step = block * dt
    omega = sqrt(gravity_m_s2 / length_m)
    if hung is None:
        recent = np.maximum(1.0 - omega * step * np.arange(len(coarse)) / np.pi, 0.0)
        hung = np.array([[time_s[0], *(recent @ coarse / recent.sum()), 0.0, 0.0, 0.0]])
    firsts = [0, *np.searchsorted(instants, hung[1:, 0]).tolist(), len(coarse)]
    parts = [
        _swung(coarse[a:b].tobytes(), tuple(state[1:].tolist()), step, length_m, 2 * damping_ratio * omega)
        for a, b, state in zip(firsts[:-1], firsts[1:], hung, strict=True)
        if b > a
    ]
    states = np.concatenate(parts)
    if len(instants) < len(time_s):
        states = np.stack([np.interp(time_s, instants, column) for column in states.T], axis=1)
    states[:, :3] /= np.maximum(np.linalg.norm(states[:, :3], axis=1, keepdims=True), 1e-12)
    return states


def moved(state: np.ndarray, move: np.ndarray, rate: float) -> np.ndarray:
    """A state (direction, its rate) turned by two angles, and two rates in units of `rate` (1/s) added to its own.

    `state` is (6,), `move` (4,).
    """
    x, y, z = along = state[:3] / sqrt(state[:3] @ state[:3])
    # Across it, from the axis that it is farther from: along × x, or along × y.
    first = np.array([0.0, z, -y]) if abs(x) < 0.7 else np.array([-z, 0.0, x])
    first /= sqrt(first @ first)
    a, b, c = first
    second = np.array([y * c - z * b, z * a - x * c, x * b - y * a])
    direction = along + move[0] * first + move[1] * second
    direction /= sqrt(direction @ direction)
    turning = state[3:] + rate * (move[2] * first + move[3] * second)
    return np.concatenate([direction, turning - (turning @ direction) * direction])


@lru_cache(maxsize=256)
def _swung(hanging, state, dt, length_m, damping):
    """As `_leapfrog`, remembered: each column that a payload has asks for the same swing."""
    return _leapfrog(np.frombuffer(hanging).reshape(-1, 3).copy(), np.array(state), dt, length_m, damping)


@compiled()
def _leapfrog(hanging, start, dt, length_m, damping):
    """Direction, squared rate and rate of a pendulum at even instants, (n, 7), from direction and rate `start` (6,)."""
    kept = exp(-damping * dt)
    pull = sqrt(kept) * dt / length_m
    x, y, z = 0.0, 0.0, 1.0
    length = sqrt(start[0] ** 2 + start[1] ** 2 + start[2] ** 2)
    if length > 0.0:
        x, y, z = start[0] / length, start[1] / length, start[2] / length
    # Rates live half a step behind.
    along = hanging[0, 0] * x + hanging[0, 1] * y + hanging[0, 2] * z
    u = start[3] - 0.5 * pull * (hanging[0, 0] - along * x)
    v = start[4] - 0.5 * pull * (hanging[0, 1] - along * y)
    w = start[5] - 0.5 * pull * (hanging[0, 2] - along * z)
    before = u * u + v * v + w * w
    states = np.empty((len(hanging), 7))
    for i in range(len(hanging)):
        e_x, e_y, e_z = hanging[i, 0], hanging[i, 1], hanging[i, 2]
        along = e_x * x + e_y * y + e_z * z
        u_0, v_0, w_0 = u, v, w
        u = kept * u + pull * (e_x - along * x)
        v = kept * v + pull * (e_y - along * y)
        w = kept * w + pull * (e_z - along * z)
        after = u * u + v * v + w * w
        states[i] = x, y, z, 0.5 * (before + after), 0.5 * (u_0 + u), 0.5 * (v_0 + v), 0.5 * (w_0 + w)
        before = after
        x, y, z = x + dt * u, y + dt * v, z + dt * w
        longer = sqrt(x * x + y * y + z * z)
        x, y, z = x / longer, y / longer, z / longer
        # The rate is transported along the sphere: it turns with the direction and keeps its size.
        u, v, w = u * longer - dt * after * x, v * longer - dt * after * y, w * longer - dt * after * z
    return states


@dataclass(frozen=True)
class _Piece:
    """A piece of a stretch at SCAN_RATE_HZ, in world axes."""

    stretch: int
    first: int
    """Block of the stretch that it begins with."""
    since_s: np.ndarray
    """Time from its first instant, (n,)."""
    lean: np.ndarray
    """Slope of what hangs the payload, (n, 2)."""
    others: np.ndarray
    """What is left to others, north and east, (2, n, 3): a constant, the slope itself, the velocity."""
    pulls: np.ndarray
    """Residuals that the swing may be seen in, in units of their own size, (ways, n, 2)."""


def _pieces_of(parts, gravity_m_s2):
    """Stretches (time_s (n,), hanging (n, 3), velocity (n, 2), pulls (n, 2) each) as pieces of PIECE_S."""
    out = []
    for stretch, (time_s, *columns, pulls) in enumerate(parts):
        if len(time_s) < 2:
            continue
        step, columns, pulls = _in_blocks(time_s, [*columns, *pulls], len(columns))
        hanging, velocity = columns
        slope = hanging[:, :2] / np.maximum(hanging[:, 2:], _LEAST_HANG * gravity_m_s2)
        size = max(1, round(_PIECE_S / step))
        for first in range(0, max(len(hanging) - size, 0) + 1, size):
            cut = slice(first, first + size)
            count = len(hanging[cut])
            if count < _SHORTEST_SCAN:
                continue
            own = np.stack([p[cut] - p[cut].mean(axis=0) for p in pulls])
            own /= np.maximum(np.sqrt((own**2).sum(axis=(1, 2), keepdims=True)), 1e-300)
            others = np.stack([np.column_stack([np.ones(count), slope[cut, a], velocity[cut, a]]) for a in (0, 1)])
            out.append(_Piece(stretch, first, np.arange(count) * step, slope[cut], others, own))
    return out


def _in_blocks(time_s, columns, keep):
    """Step in s of blocks at SCAN_RATE_HZ, and means over them: the first `keep` columns (n, k), and the rest."""
    step = float(np.median(np.diff(time_s)))
    block = max(1, round(1.0 / (_SCAN_RATE_HZ * step)))
    count = len(time_s) // block
    means = [x[: count * block].reshape(count, block, -1).mean(axis=1) for x in columns]
    return block * step, means[:keep], means[keep:]


def explained(piece, swings, others):
    """Share of a piece's pulls that columns (n, 2), each by itself given `others` (k, axis), explain: (columns,)."""
    own, shared = np.zeros(len(swings)), np.zeros((len(piece.pulls), len(swings)))
    for axis in (0, 1):
        for k, swing in enumerate(swings):
            base = np.linalg.qr(others(k, axis))[0]
            column = swing[:, axis] - base @ (base.T @ swing[:, axis])
            own[k] += column @ column
            shared[:, k] += piece.pulls[:, :, axis] @ column
    return (shared**2).sum(axis=0) / np.maximum(own, 1e-300)


def likely_lengths(parts, bounds_m, damping_ratio, gravity_m_s2):
    """Lengths of a cable, m, at which a pendulum explains most of what is left, each with a damping ratio.

    `parts` are (time_s (n,), hanging (n, 3), velocity (n, 2), pulls) of stretches in world axes; `pulls` are residuals
    (n, 2) that the swing may be seen in (a force; a moment turned to the force that it is of), each counted by its own
    size in pieces of PIECE_S. What follows the hanging itself and the velocity is left to others, and the swing from
    before the first instant of a piece to the cable's own free motion. The best peaks of a scan with small swings that
    explain something are looked at once more as they swing through the whole stretch, and come in that order.
    """
    lengths = np.geomspace(*bounds_m, _LENGTHS_TRIED)
    pieces = _pieces_of(parts, gravity_m_s2)
    if not pieces:
        return ()
    gain = np.zeros(_LENGTHS_TRIED)
    for piece in pieces:
        count, step = len(piece.since_s), piece.since_s[1]
        spectrum = np.fft.rfft(piece.lean - piece.lean.mean(axis=0), 2 * count, axis=0)
        omega = 2 * np.pi * np.fft.rfftfreq(2 * count, step)
        ring = np.sqrt(gravity_m_s2 / lengths)[:, None]
        answer = ring**2 / (ring**2 - omega**2 + 2j * damping_ratio * ring * omega)
        swings = np.fft.irfft(spectrum * answer[:, :, None], 2 * count, axis=1)[:, :count]
        fading = np.exp(-damping_ratio * ring * piece.since_s)
        free = np.stack([fading * np.cos(ring * piece.since_s), fading * np.sin(ring * piece.since_s)], axis=2)
        gain += explained(piece, swings, lambda k, a, p=piece, f=free: np.hstack([p.others[a], f[k]]))
    gain /= len(pieces)
    inner = np.flatnonzero((gain[1:-1] > gain[:-2]) & (gain[1:-1] >= gain[2:])) + 1
    best = inner[np.argsort(-gain[inner])][:_MOST_LIKELY]
    near = [_nearest_swing(parts, pieces, lengths[k], gravity_m_s2) for k in best if gain[k] > _LEAST_EXPLAINED]
    far = [(float(lengths[k]), damping_ratio) for k in best if gain[k] <= _LEAST_EXPLAINED]
    return (*((length, ratio) for _, length, ratio in sorted(near, reverse=True)), *far)


def _nearest_swing(parts, pieces, length_m, gravity_m_s2):
    """What the swing through whole stretches explains at most for a length near `length_m`; that length, m, and the
    damping ratio."""
    found = []
    for length in length_m * np.geomspace(1 / _NEAR, _NEAR, _LENGTHS_NEAR):
        for ratio in _RATIOS_TRIED:
            pulls = []
            for time_s, hanging, *_ in parts:
                pull = cable_pull(hanging, time_s, length, ratio, gravity_m_s2)
                pulls.append(_in_blocks(time_s, [pull[:, :2]], 1)[1][0])
            gain = 0.0
            for piece in pieces:
                own = pulls[piece.stretch][piece.first : piece.first + len(piece.since_s)]
                gain += float(explained(piece, own[None], lambda k, a, p=piece: p.others[a])[0])
            found.append((gain, float(length), ratio))
    return max(found)
