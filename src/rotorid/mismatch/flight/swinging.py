"""A slung payload: how it hung in each run, read from the run itself, and when it is picked up or dropped in flight.

A load that swings far soon swings otherwise than a pendulum that was started once: after some seconds nothing is left
of its phase. What is left of the sideways force shows where it hung, a few seconds at a time. As the wind of a gust
this belongs to a run and not to the vehicle; the mass, the cable and the damping are the same in all runs.

Added mass is seen in every half second by itself: by it the thrust exceeds what the accelerometer accounts for, and
off the centre it turns the vehicle. Where these loads are two plateaus with a sudden change between them in the
midst of a run, the higher one is a payload on board for so long. What drifts is none (a battery, ice), and what
differs between whole runs alone may be anything (other propellers, denser air). As for a gust, the instants are found
in held-out runs too; what is on board is learnt from the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import least_squares, minimize_scalar

from rotorid.effects.contract import Form
from rotorid.effects.payload import hanging_acceleration
from rotorid.effects.pendulum import cable_pull, moved, swing_states
from rotorid.mismatch.decide.select import COST_PER_EFFECT, COST_PER_PARAMETER
from rotorid.mismatch.evidence.motion import Segment, stretches
from rotorid.mismatch.evidence.rows import UNKNOWNS_OF_A_STATE, Rows, Term
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.flight.wrench import WrenchModel
from rotorid.steps import step

_SEEN_IN = ((2, 0), (4, 1), (3, 2))
"""Channel and parameter of a load: its mass in the vertical force, its places in the moments of pitch and roll."""
_BLOCK_S = 0.5
_SMOOTHED_BLOCKS = 9
Windows = tuple[tuple[float, float], ...]
"""(start_s, stop_s) of what is on board in a stretch, without end where it is on board from or to its end."""
_PIECE_S, _PERIODS, _SHORTEST_PIECE_S = 5.0, 2.0, 1.2
"""A state is read for so long, and for so many swings at least; where it fails for less, but not for less than this."""
_RATE_HZ = 10.0
"""Rate at which the sideways force is looked at: a swing has less than 2 Hz."""
_LEAST_SHARE = 0.3
"""Share of the sideways force's squares that a swing must explain: four numbers of five seconds make 0.1 of noise."""
_QUARTER, _MOST_LEAN = np.pi / 2, 0.9
"""Phase of a swing from which its first state is seen, rad, and the largest sideways part of a direction."""
_LOOKED_FOR = (("length_m", 4, 0.02), ("damping_ratio", 1, 1.0), ("length_m", 1, 0.01))
"""What of a cable is looked for in turn: steps to each side of where it is, and the logarithm of one."""


@dataclass(frozen=True)
class Cable:
    """What a payload hangs by."""

    length_m: float
    damping_ratio: float
    gravity_m_s2: float

    @property
    def rate(self) -> float:
        """Of small swings, rad/s."""
        return float(np.sqrt(self.gravity_m_s2 / self.length_m))

    @property
    def piece_s(self) -> float:
        """How long a state of it is read, s."""
        return max(_PIECE_S, _PERIODS * 2 * np.pi / self.rate)


@dataclass(frozen=True)
class HangingStretch:
    """What a payload hung by, and the sideways force that other effects leave."""

    hanging: np.ndarray
    """(n, 3), m/s2, world axes."""
    time_s: np.ndarray
    at_s: np.ndarray
    """Instants of the force, (m,), s."""
    force: np.ndarray
    """To the north and east, (m, 2), N."""

    @property
    def squares(self) -> float:
        return float((self.force**2).sum())

    def part(self, start_s: float, stop_s: float) -> HangingStretch:
        """What lies from `start_s` to before `stop_s`."""
        inside, seen = ((t >= start_s) & (t < stop_s) for t in (self.time_s, self.at_s))
        return HangingStretch(self.hanging[inside], self.time_s[inside], self.at_s[seen], self.force[seen])

    def pull(self, cable: Cable, state: np.ndarray) -> np.ndarray:
        """Sideways pull of a kilogram that sets out from a state (6,) on this cable, (m, 2), N."""
        hung = np.array([[self.time_s[0], *state]])
        own = cable_pull(self.hanging, self.time_s, cable.length_m, cable.damping_ratio, cable.gravity_m_s2, hung)
        return np.stack([np.interp(self.at_s, self.time_s, column) for column in own[:, :2].T], axis=1)

    def end(self, cable: Cable, state: np.ndarray) -> np.ndarray:
        """The state (6,) in which what sets out from `state` ends."""
        hung = np.array([[self.time_s[0], *state]])
        found = swing_states(self.hanging, self.time_s, cable.length_m, cable.damping_ratio, cable.gravity_m_s2, hung)
        return found[-1, [0, 1, 2, 4, 5, 6]]


@dataclass(frozen=True)
class _Swing:
    """How a payload hung in a stretch."""

    states: np.ndarray
    """As `Motion.hung`."""
    masses_kg: np.ndarray
    """What each piece suggests."""
    left_n2: float
    """Squares of the force that are left."""


def swinging_term(model: WrenchModel) -> Term | None:
    """The term of what swings that is in a model, else its likeliest; None where there is none."""
    swings = [t for t in model.search.terms.values() if t.form and t.form.swings]
    active = [t for t in swings if t.key in model.selection.active]
    return next(iter([*active, *swings]), None)


def hung(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows], term: Term) -> list[Segment] | None:
    """Stretches that say how a payload with a term's length and damping hung; None where hardly any force does."""
    found = hung_by(cable_of(model, term), segments, stretches_of(model, segments, rows))
    return None if found is None else found[0]


def hung_by(
    cable: Cable, segments: Sequence[Segment], stretches: Sequence[HangingStretch]
) -> tuple[list[Segment], float] | None:
    """Stretches that say how a payload on a cable hung, and its mass, kg; None where hardly any sideways force does."""
    mass_kg = _likely_mass_kg(cable, stretches)
    if mass_kg <= 0.0:
        return None
    found = [swing_in(s, cable, mass_kg) for s in stretches]
    if sum(f.left_n2 for f in found) > (1.0 - _LEAST_SHARE) * sum(s.squares for s in stretches):
        return None
    return [hanging(s, f.states) for s, f in zip(segments, found, strict=True)], mass_kg


def hanging(segment: Segment, states: np.ndarray) -> Segment:
    """A stretch with a payload that hung in the `states` of `Motion.hung`."""
    motion = segment.motion
    return replace(segment, motion=replace(motion, hung=states, hung_by=hanging_acceleration(motion)))


def as_effect(term: Term, cable: Cable, mass_kg: float) -> tuple[Form, np.ndarray]:
    """A form that swings with its values: the mass at its hook in the centre of mass, on a cable."""
    return term.form, np.array([mass_kg, *on_cable(term, cable).values[1:]])


def cable_of(model: WrenchModel, term: Term) -> Cable:
    """What a payload hangs by with a term's values."""
    return Cable(*(term.values[i] for i in term.form.nonlinear), model.prepared.vehicle.gravity_m_s2)


@step("a payload on a cable")
def with_likely_length(model: WrenchModel, term: Term) -> Term | None:
    """A term on the cable near its own that explains most, the states free; None where nothing seems to swing."""
    cable = likely_cable(cable_of(model, term), stretches_of(model, model.segments, model.rows))
    return None if cable is None else on_cable(term, cable)


def likely_cable(cable: Cable, stretches: Sequence[HangingStretch]) -> Cable | None:
    """The cable near another one that explains most, the states free; None where nothing seems to swing."""
    if not seems_to_swing(stretches, cable):
        return None
    for name, steps, apart in _LOOKED_FOR:

        def left(change: float, cable=cable, name=name) -> float:
            return sum(swing_in(s, scaled(cable, name, change), None).left_n2 for s in stretches)

        # What is left jumps where a piece is lost: first the best of some, then about it.
        start = min(apart * np.arange(-steps, steps + 1), key=left)
        about = start - apart, start + apart
        cable = scaled(cable, name, minimize_scalar(left, bounds=about, method="bounded", options={"maxiter": 8}).x)
    return cable


def _likely_mass_kg(cable: Cable, stretches: Sequence[HangingStretch]) -> float:
    """The mass that most pieces suggest, kg; 0 without any."""
    masses = np.concatenate([np.zeros(0), *(swing_in(s, cable, None).masses_kg for s in stretches)])
    return float(np.median(masses)) if len(masses) else 0.0


def scaled(cable: Cable, name: str, change: float) -> Cable:
    """A cable with another length or damping, by the `change` of its logarithm."""
    return replace(cable, **{name: getattr(cable, name) * float(np.exp(change))})


def on_cable(term: Term, cable: Cable) -> Term:
    """A term of what swings, on a cable."""
    values = list(term.values)
    for index, value in zip(term.form.nonlinear, (cable.length_m, cable.damping_ratio), strict=True):
        values[index] = value
    return replace(term, values=tuple(values))


def like(segments: Sequence[Segment], noisy: Sequence[Segment]) -> list[Segment]:
    """Noisy copies of stretches with a payload that hung as it did in these."""
    return [hanging(n, s.motion.hung) for s, n in zip(segments, noisy, strict=False)]


def price(segments: Sequence[Segment]) -> float:
    """What the states of a payload cost in addition to the model."""
    return COST_PER_EFFECT + COST_PER_PARAMETER * UNKNOWNS_OF_A_STATE * sum(len(s.motion.hung) for s in segments)


def stretches_of(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows]) -> list[HangingStretch]:
    """Every stretch with what effects that do not swing leave of its sideways force; empty where it is not known."""
    terms, fit = model.search.terms, model.selection.fit
    others = [k for k in model.selection.active if not terms[k].form.swings and not terms[k].run]
    cols = model.regression.columns(others)
    left = [r.y[:, :3] - r.x[:, :3][:, :, cols] @ fit.beta[fit.places(cols)] for r in rows]
    return hanging_stretches(segments, [r.time_s for r in rows], left, model.prepared.thinner.rate_hz)


def hanging_stretches(
    segments: Sequence[Segment], times_s: Sequence[np.ndarray], left: Sequence[np.ndarray], rate_hz: float
) -> list[HangingStretch]:
    """Every stretch with the sideways part of its force; empty where it is not known.

    `left` are the forces (m, 3) in body axes at `times_s` (m,), N, `rate_hz` their rate.
    """
    if any(s.motion.rotation is None for s in segments) or not all(np.isfinite(own).all() for own in left):
        return []
    out = []
    per = max(1, round(rate_hz / _RATE_HZ))
    for s, time_s, own in zip(segments, times_s, left, strict=True):
        index = np.searchsorted(s.motion.time_s, time_s).clip(0, s.motion.size - 1)
        world = np.einsum("nij,nj->ni", s.motion.rotation[index], own)[:, :2]
        count = len(world) // per
        at_s = time_s[: count * per].reshape(count, per).mean(axis=1)
        force = world[: count * per].reshape(count, per, 2).mean(axis=1)
        out.append(HangingStretch(hanging_acceleration(s.motion), s.motion.time_s, at_s, force))
    return out


def largest_pieces(stretches: Sequence[HangingStretch], cable: Cable) -> list[HangingStretch]:
    """The few pieces of stretches with the largest force."""
    pieces = [
        s.part(start, start + cable.piece_s)
        for s in stretches
        for start in np.arange(s.time_s[0], s.time_s[-1] - cable.piece_s, cable.piece_s)
    ]
    largest = 3  # Pieces that are looked at first: most flights have nothing that swings.
    return sorted(pieces, key=lambda p: -p.squares)[:largest]


def seems_to_swing(stretches: Sequence[HangingStretch], cable: Cable) -> bool:
    """Whether a swing explains anything of the largest pieces."""
    return share_left(stretches, cable) <= 1.0 - _LEAST_SHARE


def share_left(stretches: Sequence[HangingStretch], cable: Cable) -> float:
    """Share of the force's squares that a swing leaves in the largest pieces, each by itself; 1 without any."""
    pieces = largest_pieces(stretches, cable)
    squares = sum(p.squares for p in pieces)
    return sum(swing_in(p, cable, None).left_n2 for p in pieces) / squares if squares > 0.0 else 1.0


def swing_in(stretch: HangingStretch, cable: Cable, mass_kg: float | None) -> _Swing:
    """How a payload hung in a stretch; its mass is free in each piece where it is None.

    Each piece starts from where the one before ends and is moved to what explains most of its force. A piece of known
    mass of which no state explains enough is halved: what swings far soon forgets its state.
    """
    start, stop = stretch.time_s[0], stretch.time_s[-1]
    edges = np.linspace(start, stop + 1e-9, max(1, int((stop - start) / cable.piece_s)) + 1)
    spans = list(zip(edges[:-1], edges[1:], strict=True))
    state, states, masses, left = _at_rest(stretch.hanging[0]), [], [], 0.0
    # Share of a stretch's mean square that the state of a piece may leave; with more the piece is halved.
    halved_share = 0.1
    while spans:
        first, last = spans.pop(0)
        piece = stretch.part(first, last)
        if len(piece.at_s) > 2 * UNKNOWNS_OF_A_STATE and len(piece.time_s) > 2:
            own, mass, rest = fitted_piece(piece, cable, state, mass_kg)
            usual = halved_share * stretch.squares * len(piece.at_s) / len(stretch.at_s)
            if mass_kg is not None and rest > usual and last - first > 2 * _SHORTEST_PIECE_S:
                middle = 0.5 * (first + last)
                spans = [(first, middle), (middle, last), *spans]
                continue
            masses.append(mass)
            left += rest
            states.append([first, *own])
            state = piece.end(cable, own)
        else:
            states.append([first, *state])
    return _Swing(np.array(states), np.array(masses), left)


def fitted_piece(piece: HangingStretch, cable: Cable, state: np.ndarray, mass_kg: float | None):
    """The state whose swing explains most of a piece's force; its mass, kg, and the squares left, N2.

    It is looked for near `state` and near what the first quarter of a swing shows.
    """
    near = _fitted_near(piece, cable, state, mass_kg)
    if near[1] <= 0.0:
        return near
    seen = _fitted_near(piece, cable, _seen_at_first(piece, cable, near[1]), mass_kg)
    return min(near, seen, key=lambda found: found[2])


def _fitted_near(piece: HangingStretch, cable: Cable, state: np.ndarray, mass_kg: float | None):
    """As `fitted_piece`, near a state.

    One-sigma of the state is a radian, and a radian in 1/ω: what is not excited stays where it was.
    """
    size = max(float(np.sqrt(np.mean(piece.force**2))), 1e-9)

    def mass_of(pull: np.ndarray) -> float:
        if mass_kg is not None:
            return mass_kg
        return max(float((pull * piece.force).sum()) / max(float((pull**2).sum()), 1e-12), 0.0)

    def left(move: np.ndarray) -> np.ndarray:
        pull = piece.pull(cable, moved(state, move, cable.rate))
        return np.append(((piece.force - mass_of(pull) * pull) / size).ravel(), move)

    converged = 1e-4  # Relative change of squares and state at which a fit ends: far below what noise makes of either.
    most_steps = 40
    found = least_squares(
        left, np.zeros(UNKNOWNS_OF_A_STATE), method="lm", ftol=converged, xtol=converged, max_nfev=most_steps
    ).x
    own = moved(state, found, cable.rate)
    pull = piece.pull(cable, own)
    return own, mass_of(pull), float(((piece.force - mass_of(pull) * pull) ** 2).sum())


def _seen_at_first(piece: HangingStretch, cable: Cable, mass_kg: float) -> np.ndarray:
    """The state (6,) in which a piece begins as its first quarter of a swing shows it: force is mass times lean."""
    first = piece.at_s <= piece.at_s[0] + max(_QUARTER / cable.rate, 3.0 / _RATE_HZ)
    since_s = piece.at_s[first] - piece.time_s[0]
    weight = max(mass_kg * np.linalg.norm(piece.hanging, axis=1).mean(), 1e-9)
    # A piece may begin with one force, at its first instant: then nothing is known of the rate.
    design = np.stack([since_s, np.ones(len(since_s))], axis=1)
    (rate, lean), *_ = np.linalg.lstsq(design, piece.force[first] / weight, rcond=None)
    lean /= max(1.0, float(np.linalg.norm(lean)) / _MOST_LEAN)
    down = np.sqrt(1.0 - lean @ lean)
    return np.array([*lean, down, *rate, -(lean @ rate) / down])


def _at_rest(hanging: np.ndarray) -> np.ndarray:
    """The state (6,) of what hangs at rest along `hanging` (3,)."""
    return np.array([*hanging / max(np.linalg.norm(hanging), 1e-9), 0.0, 0.0, 0.0])


def payload_windows_of(model: WrenchModel) -> list[Windows]:
    """When a payload seems to be on board in every stretch; empty where none is picked up or dropped in one's midst."""
    if not loads(model) or not np.isfinite(model.rows[0].y[:, _SEEN_IN[0][0]]).all():
        return []
    left, columns = _unexplained_loads(model)
    per = max(2, int(_BLOCK_S * model.prepared.thinner.rate_hz))
    aboard = two_plateaus([_block_loads(y, x, per) for y, x in zip(left, columns, strict=True)])
    if aboard is None:
        return []
    out = []
    for r, y, x, states in zip(model.rows, left, columns, aboard, strict=True):
        edges = [-np.inf, *(float(r.time_s[i]) for i in change_rows(states, y[:, 0], x[:, 0], per)), np.inf]
        first = 0 if len(states) and states[0] else 1
        out.append(tuple(zip(edges[first:-1:2], edges[first + 1 :: 2], strict=True)))
    return out


def loads(model: WrenchModel) -> list[Term]:
    """Terms of what may be there for a part of a run alone: the one in the model first, then that of fewest parameters.

    Rows of runs held out have the columns of what is in the model alone.
    """
    found = (t for t in model.search.terms.values() if t.form and t.form.comes_and_goes)
    return sorted(found, key=lambda t: (t.key not in model.selection.active, t.size))


def _unexplained_loads(model: WrenchModel) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What the named effects but a payload leave in the channels of SEEN_IN that there are, and a payload's columns
    there, each (n, channels) of every stretch."""
    regression, fit = model.regression, model.selection.fit
    terms = model.search.terms
    aside = {loads(model)[0].effect, *UNKNOWNS}
    others = [k for k in model.selection.active if terms[k].effect not in aside and not terms[k].run]
    cols, own = regression.columns(others), regression.columns([loads(model)[0].key])
    beta = fit.beta[fit.places(cols)]
    present = [(c, p) for c, p in _SEEN_IN if np.isfinite(model.rows[0].y[:, c]).all()]
    left = [np.stack([r.y[:, c] - r.x[:, c][:, cols] @ beta for c, _ in present], axis=1) for r in model.rows]
    columns = [np.stack([r.x[:, c, own[p]] for c, p in present], axis=1) for r in model.rows]
    return left, columns


def _block_loads(left: np.ndarray, columns: np.ndarray, per: int) -> np.ndarray:
    """Mass, and mass times place, (blocks, channels) of `per` rows each, from residual and columns (n, channels)."""
    count = len(left) // per
    y, x = (part[: count * per].reshape(count, per, part.shape[1]) for part in (left, columns))
    return (x * y).sum(axis=1) / np.maximum((x**2).sum(axis=1), 1e-12)


def two_plateaus(loads: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """Whether a payload is on board by blocks of every stretch; None where loads (blocks, k) are not two plateaus."""
    steps = np.concatenate([np.diff(part, axis=0) for part in loads])
    least_blocks = 8  # Blocks of either state, of all runs together.
    if len(steps) < 4 * least_blocks:
        return None
    scatter = 1.4826 * np.median(np.abs(steps), axis=0) / np.sqrt(2)
    if not (scatter > 0).all():
        return None
    scaled = [part / scatter for part in loads]
    smooth = [median_filter(part, (_SMOOTHED_BLOCKS, 1), mode="nearest") for part in scaled]
    low, high = np.quantile(np.concatenate(smooth)[:, 0], (0.05, 0.95))
    states = [part[:, 0] > (low + high) / 2 for part in smooth]
    for _ in range(20):
        everything, inside = np.concatenate(scaled), np.concatenate(states)
        if min(inside.sum(), (~inside).sum()) < least_blocks:
            return None
        plateaus = np.stack([everything[~inside].mean(axis=0), everything[inside].mean(axis=0)])
        again = [_cheapest_states(part, plateaus) for part in scaled]
        same = all(np.array_equal(a, b) for a, b in zip(again, states, strict=True))
        states = again
        if same:
            break
    step = plateaus[1] - plateaus[0]
    least_step = 3.0  # Distance of the two plateaus in units of the scatter of a block.
    if not any(np.diff(s).any() for s in states) or step[0] < least_step:
        return None
    rest = [part - plateaus[s.astype(int)] for part, s in zip(scaled, states, strict=True)]
    most_drift = 0.2  # Share of the slow variation of the loads that the two plateaus may leave.
    return states if _slow_variance(rest) < most_drift * _slow_variance(scaled) else None


def _slow_variance(parts: Sequence[np.ndarray]) -> float:
    """Variance of what is slower than SMOOTHED_BLOCKS in stretches (blocks, k), all k together."""
    smooth = np.concatenate([uniform_filter1d(p, _SMOOTHED_BLOCKS, axis=0, mode="nearest") for p in parts if len(p)])
    return float(smooth.var(axis=0).sum())


def _cheapest_states(loads: np.ndarray, plateaus: np.ndarray) -> np.ndarray:
    """States (blocks,) of least squares from two plateaus (2, k), each change at a cost (Viterbi)."""
    costs = ((loads[:, None, :] - plateaus[None]) ** 2).sum(axis=2)
    total, came = np.zeros(2), np.zeros((len(costs), 2), int)
    switch_cost = 30.0  # Squares, in units of the blocks' own scatter, that taking up or dropping must explain.
    for i, cost in enumerate(costs):
        moved = total[::-1] + switch_cost
        came[i] = np.where(moved < total, [1, 0], [0, 1])
        total = np.minimum(total, moved) + cost
    state, out = int(np.argmin(total)), np.zeros(len(costs), bool)
    for i in range(len(costs) - 1, -1, -1):
        out[i] = bool(state)
        state = came[i, state]
    return out


def change_rows(states: np.ndarray, left: np.ndarray, column: np.ndarray, per: int) -> list[int]:
    """Rows at which the vertical force (n,) changes from one plateau to the other, near where the blocks do."""
    state_of = np.repeat(states, per)
    y, x = left[: len(state_of)], column[: len(state_of)]
    mass = [float((x * y)[state_of == s].sum() / max((x**2)[state_of == s].sum(), 1e-12)) for s in (False, True)]
    errors = np.stack([(y - m * x) ** 2 for m in mass])
    edges = []
    edge_s = 1.5  # Distance from the border of two blocks within which the instant is looked for.
    for block in np.flatnonzero(np.diff(states)) + 1:
        middle, reach = block * per, int(edge_s / _BLOCK_S * per)
        start, stop = max(0, middle - reach), min(len(y), middle + reach)
        before, after = int(states[block - 1]), int(states[block])
        gain = np.cumsum(errors[after, start:stop] - errors[before, start:stop])
        edges.append(start + int(np.argmax(gain)) + 1)
    return edges


def with_payload_on_board(segments: Sequence[Segment], windows: Sequence[Windows]) -> list[Segment]:
    """Segments that say when a payload is on board, from the windows of each."""
    out = []
    for s, own in zip(segments, windows, strict=True):
        aboard = np.zeros(s.motion.size)
        for start, stop in own:
            aboard[(s.motion.time_s >= start) & (s.motion.time_s < stop)] = 1.0
        out.append(replace(s, motion=replace(s.motion, on_board=aboard)))
    return out


def changes(segments: Sequence[Segment]) -> int:
    """How often a payload is picked up or dropped inside a segment."""
    return sum(int(np.abs(np.diff(s.motion.on_board)).sum()) for s in segments)


def on_board(segments: Sequence[Segment]) -> tuple[tuple[str, float, float], ...]:
    """(run, start_s, stop_s) of a payload as segments say it; empty where they say nothing (on board throughout)."""
    found = []
    for s in segments:
        if s.motion.on_board is not None:
            for start, stop in stretches(s.motion.on_board > 0.5):
                found.append((s.run, float(s.motion.time_s[start]), float(s.motion.time_s[stop - 1])))
    return tuple(found)
