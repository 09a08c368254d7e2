"""What every peer is given: the residual, the candidate columns and the runs to fit, and how it answers.

The columns are those that our own search chooses from: believed values, every form of every effect of the catalogue,
and the change of the wrench with the rotors' time, read as a delay where rotor speed is measured and as motor lag
where it is commanded. Gusts and mistakes in the set have no such column; a peer cannot name
them. Rows are scaled by each channel's own rms, so that newtons and newton metres weigh alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.values import believed_value
from rotorid.mismatch.evidence.motion import regime_variables
from rotorid.mismatch.evidence.rows import CHANNELS, PARAMETER_NAMES
from rotorid.mismatch.evidence.split import training_rule
from rotorid.mismatch.flight.prepare import assemble_rows, prepare
from rotorid.recordings import RecordingSet

WRENCH = 6
"""Channels that peers explain: three forces, three moments."""
UNITS = {"force": "N", "moment": "N m"}
Z95 = 1.959963984540054


@dataclass(frozen=True)
class Problem:
    """A set as a regression: rows are instants and channels, columns are terms."""

    keys: tuple[str, ...]
    """Term of each column."""
    effects: Mapping[str, str]
    """Term to effect id; believed values are not in it."""
    values: tuple[str, ...]
    """Terms that are believed values."""
    believed: Mapping[str, float]
    x: np.ndarray
    """Scaled columns, (samples, channels, columns)."""
    y: np.ndarray
    """Scaled residual of the believed vehicle, (samples, channels)."""
    scale: np.ndarray
    """What a scaled channel is to be multiplied by, N and N m."""
    channels: tuple[str, ...]
    training: np.ndarray
    held_out: np.ndarray
    block: np.ndarray
    """Number of the second that a sample lies in, all runs counted on."""
    regime: Mapping[str, np.ndarray]
    """Regime variables, one value a sample."""
    runs: Mapping[str, tuple[str, ...]]
    rest: Mapping[str, object] = field(default_factory=dict)

    def columns(self, terms: Sequence[str]) -> np.ndarray:
        """Indices of the columns of some terms."""
        wanted = set(terms)
        return np.array([k for k, key in enumerate(self.keys) if key in wanted], int)

    def stacked(self, samples: np.ndarray, columns: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Columns (n · channels, k) and residual (n · channels,) of some samples."""
        x = self.x[samples] if columns is None else self.x[samples][:, :, columns]
        y = self.y[samples].reshape(-1)
        return x.reshape(len(y), x.shape[2]), y

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms of effects, in order."""
        return tuple(dict.fromkeys(key for key in self.keys if key in self.effects))


@dataclass(frozen=True)
class Answer:
    """What a peer says of a set."""

    found: Mapping[str, float]
    """Effect id to how sure, smaller is surer (a p-value where the method has one)."""
    values: Mapping[str, tuple[float, float]]
    """Believed value (term) to relative change and its one-sigma."""
    refitted: np.ndarray
    """Scaled residual with values refitted, (samples, channels)."""
    after: np.ndarray
    """Scaled residual with all that the peer found."""


def problem_of(recordings: RecordingSet) -> Problem:
    """A set as every peer sees it."""
    prepared = prepare(recordings)
    measured = all(s.measured_speed for s in prepared.segments)
    late = "delay" if measured else "motor_lag"
    effects = {t.key: t.effect for t in prepared.terms if t.effect in catalogue()}
    effects |= {t.key: late for t in prepared.terms if t.key.startswith("offset:rotors")}
    terms = [t for t in prepared.terms if t.kind == "value" or t.key in effects]
    rows = assemble_rows(prepared, terms)
    kept = [c for c in range(WRENCH) if np.isfinite(np.concatenate([r.y[:, c] for r in rows])).all()]
    y = np.concatenate([r.y[:, kept] for r in rows])
    x = np.concatenate([r.x[:, kept] for r in rows])
    rule = training_rule(prepared.split, prepared.segments)
    sides = [rule(r.run, t) for r in rows for t in r.time_s]
    regimes = [regime_variables(s, prepared) for s in prepared.segments]
    names = set.intersection(*(set(r) for r in regimes)) - {"time_s"}
    seconds, last = [], 0
    for r in rows:
        own = (r.time_s - r.time_s[0]).astype(int)
        seconds.append(last + own)
        last += int(own[-1]) + 1
    scale = np.sqrt(np.mean(y**2, axis=0)) + 1e-12
    return Problem(
        keys=tuple(t.key for t in terms for _ in range(t.size)),
        effects=effects,
        values=tuple(t.key for t in terms if t.kind == "value"),
        believed={t.key: believed_value(prepared.vehicle, t.key) for t in terms if t.kind == "value"},
        x=x / scale[:, None],
        y=y / scale,
        scale=scale,
        channels=tuple(CHANNELS[c] for c in kept),
        training=np.array([side is not None and bool(side) for side in sides]),
        held_out=np.array([side is not None and not side for side in sides]),
        block=np.concatenate(seconds),
        regime={name: np.concatenate([r[name] for r in regimes]) for name in sorted(names)},
        runs={"training": prepared.split.training, "held_out": prepared.split.held_out},
        rest={"prior": {t.key: float(t.prior_sd[0]) for t in terms if t.kind == "value"}},
    )


def least_squares(x: np.ndarray, y: np.ndarray, penalty: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and their covariance, white residual assumed; `penalty` is added to the normal matrix's diagonal."""
    if x.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0))
    size = np.sqrt((x**2).sum(axis=0))
    size[size == 0] = 1.0
    normal = (x / size).T @ (x / size) + np.diag(np.broadcast_to(penalty, len(size)) / size**2 + 1e-10)
    inverse = np.linalg.inv(normal)
    beta = inverse @ ((x / size).T @ y)
    left = y - (x / size) @ beta
    spread = float(left @ left) / max(len(y) - len(beta), 1)
    return beta / size, spread * inverse / np.outer(size, size)


def believed_precision(problem: Problem, terms: Sequence[str]) -> np.ndarray:
    """Penalty of each column of some terms: belief in a value is worth that much, effects are free.

    In units of the scaled residual's own noise, taken as one tenth: loose, so that data decide.
    """
    prior = problem.rest["prior"]
    keys = [problem.keys[k] for k in problem.columns(terms)]
    return np.array([(0.1 / prior[key]) ** 2 if key in prior else 0.0 for key in keys])


def fit(problem: Problem, terms: Sequence[str], samples: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns, coefficients and covariance of a fit of values and terms to some samples."""
    columns = problem.columns([*problem.values, *terms])
    x, y = problem.stacked(samples, columns)
    beta, covariance = least_squares(x, y, believed_precision(problem, [*problem.values, *terms]))
    return columns, beta, covariance


def answer_of(problem: Problem, found: Mapping[str, float], terms: Sequence[str], sure: float = 3.0) -> Answer:
    """Refit values, then values and terms, on the training samples; values are claimed beyond `sure` sigma."""
    plain, plain_beta, _ = fit(problem, [], problem.training)
    columns, beta, covariance = fit(problem, terms, problem.training)
    values = {}
    for position, column in enumerate(columns):
        key = problem.keys[column]
        sd = float(np.sqrt(covariance[position, position]))
        if key in problem.values and abs(beta[position]) > sure * sd:
            values[key] = (float(beta[position]), sd)
    return Answer(
        found=found,
        values=values,
        refitted=problem.y - problem.x[:, :, plain] @ plain_beta,
        after=problem.y - problem.x[:, :, columns] @ beta,
    )


def as_verdict(name: str, problem: Problem, answer: Answer) -> dict[str, object]:
    """An answer in the words of `verdict.json`, as far as the scoring reads it."""
    channels = {}
    for c, channel in enumerate(problem.channels):
        errors = {}
        for side, samples in (("training", problem.training), ("held_out", problem.held_out)):
            errors[side] = {
                stage: float(np.sqrt(np.mean(left[samples, c] ** 2)) * problem.scale[c]) if samples.any() else None
                for stage, left in (("before", problem.y), ("refitted", answer.refitted), ("after", answer.after))
            }
        channels[channel] = {"unit": UNITS[channel.split("_")[0]], "rmse": errors}
    parameters = {}
    for key, (change, sd) in answer.values.items():
        believed = problem.believed[key]
        low, high = (believed * (1 + change + sign * Z95 * sd) for sign in (-1, 1))
        parameters[PARAMETER_NAMES[key]] = {
            "believed": believed,
            "refitted": believed * (1 + change),
            "interval_95": [low, high],
        }
    return {
        "set": name,
        "runs": {side: list(runs) for side, runs in problem.runs.items()},
        "verdict": "explained" if answer.found or parameters else "no_mismatch",
        "effects": [
            {"id": i, "status": "established", "alternatives": [], "p_value": min(1.0, max(p, 0.0)), "parameters": []}
            for i, p in answer.found.items()
        ],
        "parameters": parameters,
        "locations": [],
        "channels": channels,
    }
