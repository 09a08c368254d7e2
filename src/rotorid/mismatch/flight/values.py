"""Believed values of a flight whose thrust has a curve, or is known by commands alone: there what the believed vehicle
leaves, and values refitted where its rotors turn as they are commanded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import ids_of
from rotorid.effects.thrust_curve import SQUARE
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.values import believed_value, changed_vehicle
from rotorid.mismatch.evidence.rows import CHANNELS, Rows, residual
from rotorid.mismatch.evidence.speedpath import CommandChain
from rotorid.mismatch.flight.prepare import Prepared
from rotorid.mismatch.flight.wrench import WrenchModel, caused
from rotorid.recordings import RecordingSet, Vehicle, columns


def only_throttle(recordings: RecordingSet) -> bool:
    """Whether rotor speeds are known from the throttle and a believed full speed alone."""
    count = recordings.vehicle.rotor_count
    return all(
        run.has(*columns.rotor_columns("throttle", count))
        and not run.has(*columns.rotor_columns("rotor_command", count))
        and not run.has(*columns.rotor_columns("rotor_speed", count))
        for run in recordings.runs
    )


def with_thrust_per_command(vehicle: Vehicle, scale: float, full_rad_s: float | None) -> Vehicle:
    """The vehicle whose rotors turn `scale` times as fast at every command, with the believed C_F.

    Of a throttle (`full_rad_s`, the speed that a full one was taken for) that is another full speed; where speeds are
    commanded, another C_F and C_Q.
    """
    if full_rad_s is not None:
        low = (vehicle.rotor_speed_limits_rad_s or (0.0, 0.0))[0]
        return vehicle.model_copy(update={"rotor_speed_limits_rad_s": (low, full_rad_s * scale)})
    return changed_vehicle(vehicle, dict.fromkeys(("thrust", "torque"), scale**2 - 1.0))


def with_square_term(findings: list[Finding], values: dict, model: WrenchModel) -> tuple[list[Finding], dict]:
    """Given a thrust curve the coefficient of its square is the curve's own parameter c_2, and no wrong value.

    C_F and what the curve adds to it trade off against each other; their sum is what the recording knows.
    """
    curves = ids_of("curves_thrust")
    curve = next((f for f in findings if f.id in curves and f.status in CLAIMED), None)
    key = next((k for k in model.selection.active if model.search.terms[k].effect in curves), None)
    if curve is None or key is None or "thrust" not in model.regression.start:
        return findings, values
    fit, coefficient = model.selection.fit, believed_value(model.prepared.vehicle, "thrust")
    share = np.zeros(len(fit.columns))
    share[fit.columns == model.regression.start["thrust"]] = coefficient
    symbols = [curve.form.parameters[i].symbol for i in curve.form.linear]
    if SQUARE in symbols:
        share[fit.columns == model.regression.start[key] + symbols.index(SQUARE)] = 1.0
    elif "thrust" not in values:
        return findings, values
    value, sd = coefficient + share @ fit.beta, np.sqrt(share @ fit.covariance @ share)
    square = Estimate("c_2", float(value), "N s2/rad2", float(value - 1.96 * sd), float(value + 1.96 * sd))
    with_square = replace(curve, parameters=(*(p for p in curve.parameters if p.symbol != SQUARE), square))
    return [with_square if f is curve else f for f in findings], {k: v for k, v in values.items() if k != "thrust"}


GAINS_OF_COMMANDS = (0.5, 2.0)
"""Factors of thrust and moments, from commands alone, within which they are values: commands that follow gusts feign a
vehicle that does not answer, of which half a second ahead seems well predicted."""


def believed_residuals(
    prepared: Prepared, rows: list[Rows], chain: CommandChain | None, times: float = 1.0
) -> list[np.ndarray]:
    """What the believed vehicle leaves of every stretch of a flight, (n, 12); where a `chain` is known by commands
    alone, rotors turn `times` as fast as commanded, as far as commands are no answers."""
    if chain is None:
        return [r.y for r in rows]
    out = []
    for r, segment in zip(rows, prepared.segments, strict=True):
        turning = replace(segment.motion, rotor_speed=times * caused(segment.command, segment.dt_s, chain))
        left, groups = np.full_like(r.y, np.nan), residual(replace(segment, motion=turning), prepared.vehicle)
        for index, group in enumerate(("force", "moment")):
            if group in groups:
                left[:, 3 * index : 3 * index + 3] = prepared.thinner(groups[group])
        out.append(left)
    return out


def values_without_path(
    believed: list[np.ndarray], faster: list[np.ndarray], fitted: int
) -> tuple[Values, list[np.ndarray]]:
    """Values refitted where rotors turn as commanded, and what they leave of every stretch, (n, 12).

    By least squares on the first `fitted` stretches: one factor of the thrust, and one of each moment, which goes into
    the inertia about its axis; what is beyond GAINS_OF_COMMANDS stays as believed. Given is what the `believed` vehicle
    leaves, and what it leaves where its rotors turn √2 times as `faster`: thrust and moments go with the square.
    """
    made = [a - b for a, b in zip(believed, faster, strict=True)]
    own, left = (np.concatenate(parts[:fitted])[:, 2:6] for parts in (made, believed))
    known = np.isfinite(own) & np.isfinite(left)
    own, left = np.where(known, own, 0.0), np.where(known, left, 0.0)
    gain = 1.0 + (own * left).sum(axis=0) / np.maximum((own**2).sum(axis=0), 1e-300)
    least, most = GAINS_OF_COMMANDS
    gain = np.where((gain < least) | (gain > most), 1.0, gain)
    lift, *moments = (float(g) for g in gain)
    inertias = {f"inertia_{a}{a}": (lift / g - 1.0, 0.0) for a, g in zip("xyz", moments, strict=True)}
    values = {"thrust": (lift - 1.0, 0.0), "torque": (lift - 1.0, 0.0), **inertias}
    by_channel = np.ones(len(CHANNELS))
    by_channel[:6] = [lift, lift, *gain]
    return values, [a + (1.0 - by_channel) * m for a, m in zip(believed, made, strict=True)]
