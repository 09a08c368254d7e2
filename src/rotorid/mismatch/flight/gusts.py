"""Gusts as a slow wind, estimated together with the drag through which they are felt.

Where a drag is in the model, the wind north and east is a line from knot to knot inside each window that the
residual shows (or over a whole run, where it never rests). Its knots are columns of the same regression as the drag,
so the drag's interval knows of them. A run's wind is found in that run, held out or not: it is no property of the
vehicle, and nothing else is learnt from held-out runs.

Windows of a run in which a force in world axes comes and goes (a gust), found in the residual itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2

from rotorid.effects.catalogue import ids_of, moving_air
from rotorid.effects.gust import window_form
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import NOISE_BAND, Fit, Regression, band_power
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.evidence.split import training_rule
from rotorid.mismatch.flight.prepare import Prepared, assemble_rows
from rotorid.mismatch.flight.wrench import (
    WrenchModel,
    after_residual,
    chosen,
    whitened,
    with_linear,
    wrench_model,
)
from rotorid.steps import step

_KNOT_S, _RESTLESS_KNOT_S = 0.3, 1.0
"""Distance of knots in a window, where a gust may set in within a fraction of a second, and where the wind changes
all the time."""
_MOST_KNOTS = 150
"""Knots of all runs together: beyond, the recording is too long to ask for a wind everywhere, and of windows the
strongest are looked at."""
_RESTLESS_SHARE = 0.5
"""A wind that never rests must take away more than this share of the energy left in the horizontal force."""
_BESIDE_A_BURST = 1.0
"""Size, in units of the noise, of a gust that is believed where a stronger one blew: left out, it would be noise to the
others."""
_STEPS, _ROUNDS = 4, 2
"""Gauss-Newton steps for the wind alone, and searches repeated in it."""
_LARGEST_STEP_M_S = 4.0


@dataclass(frozen=True)
class Gust:
    """The wind in one window of one run: at its knots, north and east, m/s."""

    run: str
    knots_s: np.ndarray
    wind_m_s: np.ndarray
    """(knots, 2)."""
    covariance: np.ndarray
    """Of the wind, north then east, (2 knots, 2 knots)."""
    p_value: float

    @property
    def window(self) -> tuple[str, float, float]:
        return self.run, float(self.knots_s[0]), float(self.knots_s[-1])

    def height(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean wind from the first to the last knot with half of its strength, and its one-sigma, (2,).

        A gust flutters: how far its mean over so few knots determines its height is in the one-sigma too.
        """
        strength = np.linalg.norm(self.wind_m_s, axis=1)
        strong = np.flatnonzero(strength >= 0.5 * strength.max())
        inside = np.arange(strong[0], strong[-1] + 1)
        share = np.isin(np.arange(len(strength)), inside) / len(inside)
        count = len(share)
        fitted = [share @ self.covariance[a : a + count, a : a + count] @ share for a in (0, count)]
        flutter = self.wind_m_s[inside].var(axis=0) / len(inside)
        return share @ self.wind_m_s, np.sqrt(np.array(fitted) + flutter)

    def unrest(self) -> tuple[np.ndarray, np.ndarray]:
        """Root mean square of the wind at the knots, and its one-sigma, (2,)."""
        rms = np.sqrt(np.mean(self.wind_m_s**2, axis=0))
        slopes = self.wind_m_s / np.maximum(rms, 1e-12) / len(self.wind_m_s)
        count = len(slopes)
        sd = [
            np.sqrt(slopes[:, i] @ self.covariance[a : a + count, a : a + count] @ slopes[:, i])
            for i, a in enumerate((0, count))
        ]
        return rms, np.array(sd)


def knots_of(start_s: float, stop_s: float, spacing_s: float) -> np.ndarray:
    """Instants of the knots of a window, its ends among them."""
    return np.linspace(start_s, stop_s, max(3, int(round((stop_s - start_s) / spacing_s)) + 1))


def _wind_term(run: str, knots_s: np.ndarray) -> Term:
    """Columns of one metre a second more wind at each knot, north then east."""
    size = 2 * len(knots_s)
    window = (run, float(knots_s[0]), float(knots_s[-1]))
    gust = moving_air("in windows").id
    key = f"{gust}/{run}/{knots_s[0]:.2f}"
    return Term(key, "wind", gust, None, tuple(knots_s), size, (np.inf,) * size, run=run, window=window)


def _in_gusts(segments: list[Segment], gusts: dict[str, tuple[Term, np.ndarray]]) -> list[Segment]:
    """Segments with the wind of each term (its values (2 knots,), m/s) on top of what blows there already."""
    out = []
    for s in segments:
        wind = np.zeros((s.motion.size, 3))
        if s.motion.wind is not None:
            wind += s.motion.wind
        for term, values in gusts.values():
            if term.run == s.run:
                wind[:, :2] += blowing(np.array(term.values), values.reshape(2, -1).T, s.motion.time_s)
        out.append(replace(s, motion=replace(s.motion, wind=wind)))
    return out


def blowing(knots_s: np.ndarray, wind_m_s: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Wind (n, 2) at `time_s`, a line between knots (k, 2), nothing outside."""
    return np.stack([np.interp(time_s, knots_s, w, left=0.0, right=0.0) for w in wind_m_s.T], axis=1)


@step("gusts")
def with_gusts(prepared: Prepared, model: WrenchModel, terms: list[Term]) -> WrenchModel:
    """The model with the gusts that its residual shows; the same model where there are none.

    Without a drag nothing shows how much wind a force means: a gust is then a force in world axes.
    """
    segments = model.segments
    if "force" not in prepared.groups or any(s.motion.rotation is None for s in segments):
        return model
    found = [
        (s.run, windows(left[:, :3], _rotation_at(s, rows), rows.time_s))
        for s, rows, left in zip(segments, model.rows, after_residual(model), strict=True)
    ]
    found = [(run, [w for w in own if not _beyond_fitted(model, run, *w[:2])]) for run, own in found]
    found = strongest(found)
    asked = [_wind_term(run, knots_of(a, b, _KNOT_S)) for run, own in found for a, b, _ in own]
    if _feels_wind(model):
        # A force that no wind makes through the drag is no gust: it stays unexplained.
        known = asked or _restless(model)
        return (_in_moving_air(prepared, model, terms, known) if known else None) or model
    forces = [t for run, own in found for t in gust_terms(run, own)]
    if not forces:
        return model
    again = wrench_model(
        prepared, terms + forces, chosen(model), model.selection.active, segments, model.noisy_segments, model
    )
    again = replace(again, wind=model.wind, wind_sd=model.wind_sd)
    if _feels_wind(again):
        # A strong gust hides the drag through which it is felt; with the gust known as a force it shows.
        return _in_moving_air(prepared, again, terms, asked) or again
    return again


def strongest(found: list[tuple[str, list]], most_knots: int = _MOST_KNOTS) -> list[tuple[str, list]]:
    """The strongest windows (start_s, stop_s, strength) of all runs, as many as have `most_knots` in all.

    Every knot is two columns of the regression: their number must not grow with the recording.
    """
    kept, left = set(), most_knots
    for run, window in sorted(((r, w) for r, own in found for w in own), key=lambda rw: -rw[1][2]):
        left -= len(knots_of(*window[:2], _KNOT_S))
        if left < 0:
            break
        kept.add((run, window))
    return [(run, [w for w in own if (run, w) in kept]) for run, own in found]


def with_gusts_of_new_runs(model: WrenchModel, segments: list[Segment], noisy: list[Segment], rows: list[Rows]):
    """Other stretches of the vehicle, and their noisy copies, in the wind of their own gusts; and those gusts.

    `rows` are those stretches' rows by the model. The vehicle's numbers stay as they are.
    """
    if not _feels_wind(model) or any(s.motion.rotation is None or s.motion.velocity is None for s in segments):
        return segments, noisy, ()
    full = model.full_fit()
    left = [r.y - r.x[:, :, full.columns] @ full.beta for r in rows]
    parts = zip(segments, rows, left, strict=True)
    if any(g.window[2] - g.window[1] > 0.9 * _length_of(model, g.run) for g in model.gusts):
        # The wind never rests in the fitted runs: it is looked for everywhere.
        times = [s.motion.time_s for s in segments]
        asked = [
            _wind_term(s.run, knots_of(t[0], t[-1], _RESTLESS_KNOT_S)) for s, t in zip(segments, times, strict=True)
        ]
    else:
        found = [(s.run, windows(part[:, :3], _rotation_at(s, r), r.time_s)) for s, r, part in parts]
        asked = [_wind_term(run, knots_of(a, b, _KNOT_S)) for run, own in strongest(found) for a, b, _ in own]
    winds, gusts = {}, []
    for term in asked:
        wind = _wind_in(model, [s for s in segments if s.run == term.run], term)
        gust = Gust(term.run, np.array(term.values), wind.reshape(2, -1).T, np.eye(len(wind)), 1.0)
        if size_of(gust, model, segments) > _BESIDE_A_BURST:
            winds[term.key] = (term, wind)
            gusts.append(gust)
    return _in_gusts(segments, winds), _in_gusts(noisy, winds) if noisy else noisy, tuple(gusts)


def _wind_in(model: WrenchModel, segments: list[Segment], term: Term) -> np.ndarray:
    """Wind at a term's knots (2 knots,), m/s, by Gauss-Newton with everything else as it is in the model."""
    full, felt, wind = model.full_fit(), _felt_by(model), np.zeros(term.size)
    active = [model.search.terms[k] for k in _lasting(model)]
    always = [t for t in model.terms if t.kind != "effect" and not t.run]
    kept = [*always, *active]
    cols = model.regression.columns([t.key for t in kept])
    beta = np.array([full.beta[full.columns == c][0] if c in full.columns else 0.0 for c in cols])
    for _ in range(_STEPS):
        moved = _in_gusts(segments, {term.key: (term, wind)})
        rows = assemble_rows(model.prepared, [*kept, term], moved, felt)
        normal, right = 1e-9 * np.eye(term.size), np.zeros(term.size)
        for r in rows:
            left = (r.y - r.x[:, :, : len(cols)] @ beta)[:, :2] / model.noise[:2]
            own = r.x[:, :2, len(cols) :] / model.noise[:2, None]
            normal, right = normal + np.einsum("nci,ncj->ij", own, own), right + np.einsum("nci,nc->i", own, left)
        ridge = 1e-6 * np.trace(normal) / term.size * np.eye(term.size)
        wind = wind + np.clip(np.linalg.solve(normal + ridge, right), -_LARGEST_STEP_M_S, _LARGEST_STEP_M_S)
    return wind


def _beyond_fitted(model: WrenchModel, run: str, start_s: float, stop_s: float) -> bool:
    """Whether a window of a run that is not fitted flies faster than all that is: drag extrapolated is no gust."""
    fitted, inside = [0.0], [0.0]
    rule = training_rule(model.prepared.split, model.segments)
    for s in model.segments:
        if s.motion.velocity is None:
            continue
        time_s, speed = s.motion.time_s, np.linalg.norm(s.motion.velocity, axis=1)
        known = np.array([rule(s.run, t) is True for t in time_s[::20]]).repeat(20)[: len(time_s)]
        if known.any():
            fitted.append(float(np.quantile(speed[known], 0.999)))
        window = (time_s >= start_s) & (time_s <= stop_s) & ~known
        if s.run == run and window.any():
            inside.append(float(speed[window].max()))
    # Speed in a window, relative to the fastest that is fitted, up to which the drag is known.
    most_extrapolation = 1.05
    return max(inside) > most_extrapolation * max(fitted)


def _feels_wind(model: WrenchModel) -> bool:
    """Whether a wind is identifiable: a drag is in the model, and the velocity over ground is known."""
    drag = any(model.search.terms[k].effect in ids_of("drag") for k in model.selection.active)
    return drag and all(s.motion.velocity is not None for s in model.segments)


def _lasting(model: WrenchModel) -> list[str]:
    """What is in the model of effects that no wind of a window or of the whole flight takes the place of."""
    winds = moving_air("all the time").id, moving_air("in windows").id
    return [k for k in model.selection.active if model.search.terms[k].effect not in winds]


def _rotation_at(segment: Segment, rows: Rows) -> np.ndarray:
    """Attitude at the instants of the rows, (n, 3, 3)."""
    index = np.searchsorted(segment.motion.time_s, rows.time_s).clip(0, segment.motion.size - 1)
    return segment.motion.rotation[index]


def _restless(model: WrenchModel) -> list[Term]:
    """A wind over the whole of every stretch; nothing where it could not matter, or for very long recordings."""
    thinner = model.prepared.thinner
    band = tuple(share * thinner.cutoff_hz for share in NOISE_BAND)
    left = [part[:, :2] for part in after_residual(model)]
    white = sum(band_power([part[:, axis] for part in left], thinner.rate_hz, band) for axis in range(2)) / 2
    if _horizontal_energy(model) * (1 - _RESTLESS_SHARE) < white * thinner.cutoff_hz:
        return []
    terms = []
    for s in model.segments:
        start, stop = float(s.motion.time_s[0]), float(s.motion.time_s[-1])
        terms.append(_wind_term(s.run, knots_of(start, stop, _RESTLESS_KNOT_S)))
    return terms if sum(len(t.values) for t in terms) <= _MOST_KNOTS else []


def _in_moving_air(prepared: Prepared, model: WrenchModel, terms: list[Term], asked: list[Term]) -> WrenchModel | None:
    """The search repeated with the wind of the windows asked for, as far as it is there; None where it is not."""
    still = {t.key: (t, np.zeros(t.size)) for t in asked}
    winds, covariances = estimated(prepared, model, still, _STEPS)
    if not believed([_gust_of(term, wind, covariances[key]) for key, (term, wind) in winds.items()], model):
        return None
    kept = [t for t in terms if t.effect != moving_air("all the time").id]
    again = model
    for _ in range(_ROUNDS):
        active = _lasting(again)
        moved = _in_gusts(model.segments, winds)
        noisy = _in_gusts(model.noisy_segments, winds) if model.noisy_segments else model.noisy_segments
        again = wrench_model(prepared, [*kept, *asked], chosen(again), active, moved, noisy, again)
        if not any(again.search.terms[k].effect in ids_of("drag") for k in again.selection.active):
            return None
        steps, covariances = estimated(prepared, again, still, 1)
        winds = {k: (t, values + steps[k][1]) for k, (t, values) in winds.items()}
        gusts = believed([_gust_of(term, wind, covariances[key]) for key, (term, wind) in winds.items()], again)
        if not gusts:
            return None
    everywhere = any(t.window[2] - t.window[1] > 0.9 * _length_of(model, t.run) for t in asked)
    if everywhere and _follows_velocity(gusts, model):
        return None
    if everywhere and _horizontal_energy(again) > (1 - _RESTLESS_SHARE) * _horizontal_energy(model):
        return None
    if len(gusts) < len(asked):
        present = {g.window for g in gusts}
        return _in_moving_air(prepared, model, terms, [t for t in asked if t.window in present])
    return replace(again, wind=model.wind, wind_sd=model.wind_sd, gusts=tuple(gusts))


def _gust_of(term: Term, wind: np.ndarray, covariance: np.ndarray) -> Gust:
    """The gust of a term's knots with its wind, north then east (2 knots,), m/s."""
    return Gust(term.run, np.array(term.values), wind.reshape(2, -1).T, covariance, _chance(wind, covariance))


def believed(gusts: list[Gust], model: WrenchModel) -> list[Gust]:
    """Those beyond chance that are strong, and with them the weaker ones; nothing where none is strong.

    A wind that is a small share of the airspeed is what the drag's form is wrong by.
    """
    share = rules.OVERSHADOWED["share_of_burst"]
    gust_p = 1e-6
    known = [g for g in gusts if g.p_value < gust_p]
    sizes = [(g, size_of(g, model)) for g in known if not rules.OVERSHADOWED(share_of_airspeed(g, model) < share)]
    if max((size for _, size in sizes), default=0.0) <= rules.OVERSHADOWED["times_for_burst"]:
        return []
    return [g for g, size in sizes if size > _BESIDE_A_BURST]


def _follows_velocity(gusts: Sequence[Gust], model: WrenchModel) -> bool:
    """Whether most of a wind is a share of the velocity over ground, below one: a drag that is stated wrongly.

    What a wind blows along is slower than the wind.
    """
    winds, flown = [], []
    for gust in gusts:
        for motion in (s.motion for s in model.segments if s.run == gust.run):
            inside = (motion.time_s >= gust.knots_s[0]) & (motion.time_s <= gust.knots_s[-1])
            winds.append(blowing(gust.knots_s, gust.wind_m_s, motion.time_s[inside]))
            world = np.einsum("nij,nj->ni", motion.rotation[inside], motion.velocity[inside])
            flown.append(world[:, :2])
    wind, velocity = np.concatenate(winds), np.concatenate(flown)
    share = float((wind * velocity).sum() / max(float((velocity**2).sum()), 1e-12))
    left = float(((wind - share * velocity) ** 2).sum())
    follows = 0.5  # Share of the squares of a wind that the vehicle's own velocity may explain.
    return abs(share) < 1.0 and left < (1.0 - follows) * float((wind**2).sum())


def share_of_airspeed(gust: Gust, model: WrenchModel) -> float:
    """Root mean square of a gust's wind over that of the velocity over ground in its window."""
    first, last, wind, flown = gust.knots_s[0], gust.knots_s[-1], 0.0, 0.0
    for motion in (s.motion for s in model.segments if s.run == gust.run):
        inside = (motion.time_s >= first) & (motion.time_s <= last)
        wind += float((blowing(gust.knots_s, gust.wind_m_s, motion.time_s[inside]) ** 2).sum())
        flown += float((motion.velocity[inside] ** 2).sum())
    return float(np.sqrt(wind / max(flown, 1e-12)))


def _chance(wind: np.ndarray, covariance: np.ndarray) -> float:
    """Probability of as much wind at the knots where there is none."""
    return float(chi2.sf(wind @ np.linalg.solve(covariance, wind), len(wind)))


def _length_of(model: WrenchModel, run: str) -> float:
    """Seconds of a run's stretches together."""
    return sum(s.motion.size / s.rate_hz for s in model.segments if s.run == run)


def _horizontal_energy(model: WrenchModel) -> float:
    """Mean square of what is left in the force across the rotors' axis, N2."""
    left = np.concatenate([part[:, :2] for part in after_residual(model)])
    return float(np.mean(left**2))


def size_of(gust: Gust, model: WrenchModel, segments: list[Segment] | None = None) -> float:
    """Root mean square of a gust's force in its window, in units of the noise of the force; of the model's segments
    or of others."""
    knots, wind = gust.knots_s, gust.wind_m_s.T.ravel()
    own = _wind_term(gust.run, knots)
    segments = [s for s in (model.segments if segments is None else segments) if s.run == gust.run]
    felt = _felt_by(model)
    total, count = 0.0, 0
    for rows in assemble_rows(model.prepared, [own], segments, felt):
        inside = (rows.time_s >= knots[0]) & (rows.time_s <= knots[-1])
        force = rows.x[inside, :2] @ wind
        total, count = total + float(((force / model.noise[:2]) ** 2).sum()), count + int(inside.sum())
    return float(np.sqrt(total / max(count, 1)))


def _felt_by(model: WrenchModel):
    """Forms in the model that feel the air, with their values."""
    pairs = zip(model.selection.active, chosen(model), strict=True)
    return [found for k, found in pairs if model.search.terms[k].effect in ids_of("feels_air")]


def estimated(prepared: Prepared, model: WrenchModel, winds: dict[str, tuple[Term, np.ndarray]], steps: int):
    """Winds by Gauss-Newton on top of what blows in the model's segments: values and covariances by the terms' keys."""
    winds = dict(winds)
    asked = [term for term, _ in winds.values()]
    always = [t for t in model.terms if t.kind != "effect" and t.effect != moving_air("in windows").id]
    active = [model.search.terms[k] for k in _lasting(model)]
    values = dict(zip(model.selection.active, chosen(model), strict=True))
    effects = [values[t.key] for t in active]
    own = [*always, *active, *asked]
    covariances = {}
    for _ in range(steps):
        moved = _in_gusts(model.segments, winds)
        rows = assemble_rows(prepared, own, moved, effects)
        regression = whitened(prepared, rows, own, model.regression.filters, moved)
        fit = regression.fit([t.key for t in own])
        effects = [with_linear(e, regression, fit, t) for t, e in zip(active, effects, strict=True)]
        for term in asked:
            step, covariances[term.key] = _step_of(regression, fit, term)
            winds[term.key] = (term, winds[term.key][1] + np.clip(step, -_LARGEST_STEP_M_S, _LARGEST_STEP_M_S))
    return winds, covariances


def _step_of(regression: Regression, fit: Fit, term: Term) -> tuple[np.ndarray, np.ndarray]:
    """Change of a term's wind and its covariance; of a run that is not fitted from the run itself, all else fixed."""
    cols = regression.columns([term.key])
    where = np.flatnonzero(np.isin(fit.columns, cols))
    if regression.gram[regression.training][:, cols, cols].sum() > 0:
        return fit.beta[where], fit.covariance[np.ix_(where, where)]
    own = regression.run == regression.names[term.run]
    gram = regression.gram[own].sum(axis=0)[np.ix_(cols, fit.columns)]
    beta = fit.beta.copy()
    beta[where] = 0.0
    normal = gram[:, where] + 1e-9 * np.trace(gram[:, where]) / len(cols) * np.eye(len(cols))
    inverse = np.linalg.inv(normal)
    return inverse @ (regression.cross[own][:, cols].sum(axis=0) - gram @ beta), inverse


def gust_finding(gusts: tuple[Gust, ...]) -> Finding:
    """All gusts of a set as one finding, the surest one's wind as its parameters."""
    first = min(gusts, key=lambda g: g.p_value)
    lasting_s = 12.0  # A wind that changes for longer has no one height: its root mean square is stated.
    lasting = first.knots_s[-1] - first.knots_s[0] > lasting_s
    height, sd = first.unrest() if lasting else first.height()
    symbol = "w_{}_rms" if lasting else "w_{}"
    effect = moving_air("in windows")
    return Finding(
        id=effect.id,
        status="established",
        equation="v_air = v − Rᵀ w(t)",
        sentence=effect.sentence,
        parameters=tuple(
            Estimate(symbol.format(axis), float(w), "m/s", float(w - 1.96 * s), float(w + 1.96 * s))
            for axis, w, s in zip(("north", "east"), height, sd, strict=True)
        ),
        p_value=first.p_value,
        channels=("force_x", "force_y"),
        windows=tuple(g.window for g in gusts),
    )


def windows(residual_body: np.ndarray, rotation: np.ndarray, time_s: np.ndarray):
    """Windows (start_s, stop_s, strength) of one stretch, strongest first.

    `residual_body` (n, 3) N; `rotation` (n, 3, 3). The scale is the median absolute deviation of the smoothed
    force over the stretch itself, so a lasting force does not count: that is a steady wind.
    """
    world = np.einsum("nij,nj->ni", rotation, residual_body)[:, :2]
    dt = float(np.median(np.diff(time_s)))
    smoothing_s = 0.6
    smooth = uniform_filter1d(world - np.median(world, axis=0), max(3, int(smoothing_s / dt)), axis=0)
    scale = max(1.4826 * np.median(np.abs(smooth - np.median(smooth, axis=0)), axis=0).max(), 1e-12)
    strength = np.linalg.norm(smooth, axis=1) / scale
    found = []
    left = strength.copy()
    alarm = 6.0  # Robust standard deviations of the smoothed world force that open a window.
    edge = 2.5  # A window reaches to where the smoothed force falls below this many.
    # A window is never shorter than the smoothing itself; one of a blip is as short.
    shortest_s, longest_share = 1.0, 0.5
    most_windows = 3
    while len(found) < most_windows:
        top = int(np.argmax(left))
        if left[top] < alarm:
            break
        low, high = top, top
        while low > 0 and strength[low - 1] > edge:
            low -= 1
        while high < len(strength) - 1 and strength[high + 1] > edge:
            high += 1
        left[low : high + 1] = 0.0
        length = (high - low) * dt
        if shortest_s <= length <= longest_share * len(strength) * dt:
            found.append((float(time_s[low]), float(time_s[high]), float(strength[top])))
    return found


def gust_terms(run: str, found) -> list[Term]:
    """Terms for the windows of one run."""
    terms, gust = [], moving_air("in windows").id
    burst_knot_s = 0.6
    for start, stop, _ in found:
        knots = int(np.clip(round((stop - start) / burst_knot_s), 2, 12))
        form = window_form(start - 0.15, stop + 0.15, knots)
        size = len(form.parameters)
        terms.append(
            Term(
                f"{gust}/{run}/{start:.2f}",
                "effect",
                gust,
                form,
                (0.0,) * size,
                size,
                (np.inf,) * size,
                run=run,
                window=(run, start, stop),
            )
        )
    return terms
