"""The runs held out, opened once: what a model that was chosen without them makes of them.

Nothing here can change the model. Effects, values and their numbers come from the runs that were fitted. What belongs
to a run and not to the vehicle (the wind of a gust, when a payload is on board, a thrust per mass that differs from run
to run) is read from the run itself: it says how the run was flown, not what the vehicle is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import Fit
from rotorid.mismatch.evidence.rows import RUN_SCALE, Contributions, Rows, Term
from rotorid.mismatch.flight.fitted import Fitted
from rotorid.mismatch.flight.gusts import with_gusts_of_new_runs
from rotorid.mismatch.flight.prepare import assemble_rows
from rotorid.mismatch.flight.swinging import hung, like, payload_windows_of, swinging_term, with_payload_on_board
from rotorid.mismatch.flight.wrench import WrenchModel, in_wind, path_segments
from rotorid.recordings import RecordingSet, Split

_COMPARED = (
    "rotor_speed", "specific_force", "accelerometer", "angular_velocity", "gyroscope", "rotation", "velocity", "height",
    "voltage",
)  # fmt: skip
"""Quantities of a stretch that a model may need."""


def on_every_run(
    found: Fitted, recordings: RecordingSet, split: Split, unseen: tuple[list[Segment], list[Segment]]
) -> WrenchModel:
    """The model with the rows of every run: those fitted as they were, those held out by the same equations.

    Parameters
    ----------
    found
        What was chosen and fitted without the runs held out.
    recordings, split
        The whole set and how it is split.
    unseen
        Stretches of the runs held out, and the same with noise added once more (`prepare_like`).
    """
    model = found.model
    prepared = model.prepared
    own, noisy = unseen
    # Columns that the fitted runs' sensors do not have are not in the model; a run without theirs cannot be compared.
    pairs = [(s, n) for s, n in zip(own, noisy or own, strict=True) if comparable(s, model.segments[0])]
    own = as_flown([s for s, _ in pairs], found)
    noisy = as_flown([n for _, n in pairs], found) if noisy else []
    if model.segments and model.segments[0].motion.on_board is not None:
        own, noisy = _carrying(model, own, noisy)
    if model.segments and model.segments[0].motion.hung is not None:
        own = hung(model, own, rows_of(model, own), swinging_term(model)) or own
        noisy = like(own, noisy)
    gusts = ()
    if model.gusts:
        own, noisy, gusts = with_gusts_of_new_runs(model, own, noisy, rows_of(model, own))
    known_noise = bool(model.noisy_segments) and bool(noisy or not own)
    both = [*model.rows, *rows_of(model, own)]
    again = None
    if known_noise and model.contributions.noisy is not None:
        again = [*model.contributions.noisy, *rows_of(model, noisy)]
    whole = replace(
        prepared,
        recordings=recordings,
        split=split,
        segments=[*prepared.segments, *[s for s, _ in pairs]],
        noisy_segments=[*model.noisy_segments, *noisy] if known_noise else [],
    )
    return replace(
        model,
        prepared=whole,
        rows=both,
        segments=[*model.segments, *own],
        noisy_segments=whole.noisy_segments,
        contributions=Contributions(both, again, prepared.thinner.rate_hz),
        gusts=(*model.gusts, *gusts),
    )


def comparable(segment: Segment, fitted: Segment) -> bool:
    """Whether a stretch has every quantity that one of those fitted has: the model's rows are made of them."""
    return not lacking(segment, fitted)


def lacking(segment: Segment, fitted: Segment) -> tuple[str, ...]:
    """Quantities, in words, that one of the fitted stretches has and this one has not."""
    own = {
        "command": "commands",
        "kinematic_specific_force": "position or velocity next to the accelerometer",
        "kinematic_angular_velocity": "attitude next to the gyroscope",
    }
    pairs = [(segment, fitted, n) for n in own] + [(segment.motion, fitted.motion, n) for n in _COMPARED]
    words = own | {n: n.replace("_", " ") for n in _COMPARED} | {"rotation": "attitude"}
    return tuple(words[n] for new, known, n in pairs if getattr(known, n) is not None and getattr(new, n) is None)


def as_flown(segments: list[Segment], found: Fitted) -> list[Segment]:
    """Stretches with the rotors turning as the chain makes of their commands, in the wind that was found."""
    model = found.model
    if found.commanded:
        segments = path_segments(segments, found.chain, model.prepared.thinner.cutoff_hz)
    return segments if model.wind is None else in_wind(segments, model.wind)


def _carrying(model: WrenchModel, segments: list[Segment], noisy: list[Segment]):
    """Stretches that say when a payload is on board, found in their own loads."""
    every = [*model.segments, *segments]
    rows = rows_of(model, with_payload_on_board(every, [((-np.inf, np.inf),)] * len(every)))
    windows = payload_windows_of(replace(model, rows=rows))[len(model.segments) :]
    windows = windows or [()] * len(segments)
    return with_payload_on_board(segments, windows), with_payload_on_board(noisy, windows) if noisy else noisy


def rows_of(model: WrenchModel, segments: list[Segment]) -> list[Rows]:
    """Rows of other stretches: the columns of what is in the model, at the places they have in the fitted rows.

    Columns that say nothing in a channel of the fitted rows (they are noise alone there) say nothing here either.
    """
    if not segments:
        return []
    active = set(model.selection.active)
    kept = [t for t in model.regression.terms if t.kind != "effect" or t.key in active]
    kept = [t for t in kept if not t.run or t.run in {s.run for s in segments}]
    cols = model.regression.columns([t.key for t in kept])
    seen = np.any([np.any(r.x[:, :, cols] != 0.0, axis=0) for r in model.rows], axis=0)
    own_run = np.isin(cols, model.regression.columns([t.key for t in kept if t.run]))
    width = model.rows[0].x.shape[2]
    out = []
    for part in assemble_rows(model.prepared, kept, segments, model.effects):
        x = np.zeros((*part.y.shape, width))
        x[:, :, cols] = part.x * (seen | own_run)
        out.append(replace(part, x=x))
    return out


def scaled_by_run(model: WrenchModel, fit: Fit) -> Fit:
    """A fit with the thrust scale of every run held out read from that run; as it is where no run has its own."""
    start, terms = model.regression.start, [t for t in model.regression.terms if t.key.startswith(RUN_SCALE)]
    if not any(start[t.key] in fit.columns and t.run in model.regression.names for t in terms):
        return fit
    for term in terms:
        rows = [r for r in model.rows if r.run == term.run]
        if term.run in model.regression.names or not rows:
            continue
        others = fit.columns != start[term.key]
        fit = replace(
            fit,
            columns=np.append(fit.columns[others], start[term.key]),
            beta=np.append(fit.beta[others], _own_scale(model, rows, fit, start[term.key], term)),
        )
    return fit


def _own_scale(model: WrenchModel, rows: list[Rows], fit: Fit, column: int, term: Term) -> float:
    """The scale that leaves least of a run's force and moment, channels weighed by their noise."""
    known = np.isfinite(model.noise)
    others = np.where(fit.columns == column, 0.0, fit.beta)
    top, bottom = 0.0, 1.0 / term.prior_sd[0] ** 2
    for r in rows:
        left = (r.y - r.x[:, :, fit.columns] @ others)[:, known] / model.noise[known]
        own = r.x[:, known, column] / model.noise[known]
        top, bottom = top + float((own * left).sum()), bottom + float((own**2).sum())
    return top / bottom
