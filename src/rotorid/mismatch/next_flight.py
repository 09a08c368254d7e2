"""What to fly next: the manoeuvre that tells two candidates apart, and by how much it would.

The prediction is computed, not looked up: on a flight that excites everything at once, what the finding adds is
fitted by the other candidate's best form (believed values free within their trust); what is left, in units of this
set's own noise, is the separation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion, not_testable_reason
from rotorid.mismatch.findings import Finding
from rotorid.mismatch.motion import Segment
from rotorid.mismatch.prepare import Prepared
from rotorid.mismatch.rows import form_columns, project, value_columns

FLIGHT_S, RATE_HZ = 30.0, 40.0
GROUPS = ("force", "moment", "accelerometer", "gyroscope")
SPEED_M_S, TILT_RAD, SPIN_UP = 4.0, 0.35, 0.08
"""Amplitudes of the imagined flight: airspeed, tilt, and the rotors' share of their hover speed."""


@dataclass(frozen=True)
class NextFlight:
    """The manoeuvre, the ids it separates, and the smallest predicted separation in standard deviations."""

    manoeuvre: str = ""
    separates: tuple[str, ...] = ()
    sigma: float = 0.0


def next_flight(findings: list[Finding], prepared: Prepared, noise: np.ndarray) -> NextFlight:
    """For the first class that the data leave open; nothing to fly where none is.

    `noise` (12,) is the one-sigma of each channel in the band of the rows.
    """
    for finding in findings:
        if finding.status != "ambiguous":
            continue
        others = [i for i in finding.alternatives if i != finding.id]
        manoeuvre = catalogue()[finding.id].separating_manoeuvre
        found = [s for s in (separation(finding, i, prepared, noise) for i in others) if s is not None]
        return NextFlight(manoeuvre, tuple(finding.alternatives), round(min(found), 1) if found else 0.0)
    return NextFlight()


def separation(finding: Finding, other: str, prepared: Prepared, noise: np.ndarray) -> float | None:
    """Standard deviations between a finding and the best of another id's forms; None where no wrench tells."""
    vehicle = prepared.vehicle
    if finding.form is None or not finding.values:
        return None
    segment = imagined(vehicle, prepared)
    groups = prepared.groups
    if not_testable_reason(finding.form, segment.motion, vehicle):
        return None
    target = stacked(
        project(finding.form.contribution(segment.motion, vehicle, np.array(finding.values)), segment, vehicle, groups),
        segment,
    )
    seen = np.isfinite(noise) & (noise > 0)
    weight = np.where(seen, 1.0 / np.where(seen, noise, 1.0), 0.0)
    believed, trust = [], []
    for term in prepared.terms:
        if term.kind == "value":
            model = {"force": target[:, :3], "moment": target[:, 3:6]}
            believed.append(stacked(value_columns(term.key, segment, vehicle, groups, model), segment))
            trust.append(1.0 / term.prior_sd[0])
    best = None
    for form in catalogue()[other].forms(vehicle):
        if not form.linear or not_testable_reason(form, segment.motion, vehicle):
            continue
        start = np.array([p.starts[0] if p.nonlinear and p.starts else 0.0 for p in form.parameters])
        own = [stacked(c, segment) for c in form_columns(form, start, segment, vehicle, groups)]
        x = np.stack([(c * weight).ravel() for c in believed + own], axis=1)
        y = (target * weight).ravel()
        unit = np.sqrt((x**2).sum(axis=0)) + 1e-30
        held = np.diag(np.array([*trust, *[0.0] * len(own)]) / unit)
        rows, wanted = np.concatenate([x / unit, held]), np.concatenate([y, np.zeros(len(unit))])
        left = wanted - rows @ np.linalg.lstsq(rows, wanted, rcond=1e-10)[0]
        sigma = float(np.sqrt(left @ left))
        best = sigma if best is None else min(best, sigma)
    return best


def stacked(parts: dict[str, np.ndarray], segment: Segment) -> np.ndarray:
    """Channel groups side by side, (n, 12), zero where a group is not there."""
    out = np.zeros((segment.motion.size, 12))
    for k, group in enumerate(GROUPS):
        if parts.get(group) is not None:
            out[:, 3 * k : 3 * k + 3] = parts[group]
    return out


def imagined(vehicle, prepared: Prepared) -> Segment:
    """A flight that excites everything: speeds along both axes, turns, tilts, climbs, rotors one by one."""
    t = np.arange(0.0, FLIGHT_S, 1.0 / RATE_HZ)
    known = prepared.segments[0].motion

    def wave(hz, phase=0.0):
        return np.sin(2 * np.pi * hz * t + phase)

    roll, pitch = TILT_RAD * wave(0.7), TILT_RAD * wave(0.9, 1.0)
    yaw = 2 * np.pi * t / FLIGHT_S + 0.4 * wave(0.5)
    angles = np.stack([roll, pitch, yaw], axis=1)
    rate = np.gradient(angles, t, axis=0)
    rotation = rotations(angles)
    velocity = SPEED_M_S * np.stack([wave(0.13), wave(0.17, 2.0), 0.3 * wave(0.11)], axis=1)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    hover = np.sqrt(weight / vehicle.thrust_coefficients_n_s2().sum())
    share = np.stack([wave(0.6 + 0.23 * i, i) for i in range(vehicle.rotor_count)], axis=1)
    speed = hover * (1.0 + SPIN_UP * share)
    force = np.zeros((len(t), 3))
    force[:, 2] = -(vehicle.thrust_coefficients_n_s2() * speed**2).sum(axis=1) / vehicle.mass_kg

    def where(field, values):
        return None if getattr(known, field) is None else values

    motion = Motion(
        time_s=t,
        rotor_speed=speed,
        rotor_acceleration=np.gradient(speed, t, axis=0),
        angular_velocity=rate,
        angular_acceleration=np.gradient(rate, t, axis=0),
        specific_force=force,
        accelerometer=where("accelerometer", force),
        gyroscope=where("gyroscope", rate),
        rotation=where("rotation", rotation),
        velocity=where("velocity", velocity),
        position=where("position", np.cumsum(velocity, axis=0) / RATE_HZ),
        height=where("height", 1.0 + 0.8 * wave(0.05)),
        voltage=where("voltage", np.full(len(t), float(np.mean(known.voltage)) if known.voltage is not None else 0.0)),
    )
    return Segment("imagined", RATE_HZ, motion, "accelerometer")


def rotations(angles: np.ndarray) -> np.ndarray:
    """Rotations of body vectors into the world (n, 3, 3) from roll, pitch and yaw (n, 3), rad."""
    (a, b, c), (d, e, f) = np.cos(angles.T), np.sin(angles.T)
    return np.stack(
        [
            np.stack([b * c, d * e * c - a * f, a * e * c + d * f], axis=1),
            np.stack([b * f, d * e * f + a * c, a * e * f - d * c], axis=1),
            np.stack([-e, d * b, a * b], axis=1),
        ],
        axis=1,
    )
