"""What a pilot flies in one run, by purpose. Speeds fit the vehicle; every run starts and ends at rest."""

import numpy as np

from .manoeuvres import Segment
from .vehicles import Airframe


def programme(
    purpose: str, duration_s: float, airframe: Airframe, rng: np.random.Generator, slow: bool
) -> tuple[list[Segment], float]:
    """Segments that fill `duration_s`, and the starting altitude in m; `slow` flies gently, for low rates."""
    f = 0.6 if slow else 1.0
    heading = rng.uniform(0, 2 * np.pi)
    u = rng.uniform
    d = duration_s

    def eight(share, low=3.0, high=7.0):
        v = u(low, high) * f
        return Segment("eight", share * d, v, max(2.0, v * u(0.6, 0.9)), u(0, 2 * np.pi))

    def sweep(share, low=6.0, high=10.0):
        v = u(low, high) * f
        return Segment("sweep", share * d, v, max(4.0, v * v / u(5.0, 7.0)), heading)

    def vertical(share, low=1.5, high=3.0):
        v = u(low, high) * f
        return Segment("vertical", share * d, v, max(0.8, v * u(0.5, 0.8)))

    multisine = Segment("multisine", 0.2 * d, u(0.12, 0.2) * f)
    if purpose == "rich":
        parts = [
            eight(0.3),
            vertical(0.2),
            multisine,
            Segment("yaw", 0.15 * d, u(1.2, 2.5) * f),
            Segment("doublets", 0.15 * d, 0.3 * f),
        ]
        order = rng.permutation(len(parts))
        return [parts[i] for i in order], 10.0
    if purpose == "fast":
        return [sweep(0.4, 9.0, 12.0), eight(0.3, 5.0, 9.0), Segment("multisine", 0.3 * d, 0.15 * f)], 10.0
    if purpose == "turning":
        # long yaw turns while translating, so that body and world axes part
        return [
            Segment("yaw", 0.3 * d, u(1.5, 2.5) * f),
            eight(0.35),
            Segment("multisine", 0.2 * d, 0.12 * f),
            Segment("yaw", 0.15 * d, -2.0 * f),
        ], 10.0
    if purpose == "excite":
        return [
            Segment("multisine", 0.3 * d, u(0.2, 0.3) * f),
            Segment("pulses", 0.2 * d, 0.06),
            Segment("rotor_multisine", 0.25 * d, 0.03),
            Segment("doublets", 0.25 * d, 0.4 * f),
        ], 10.0
    if purpose == "climbs":
        return [
            vertical(0.4, 2.0, 4.0),
            eight(0.25),
            vertical(0.2, 1.0, 2.0),
            Segment("multisine", 0.15 * d, 0.15 * f),
        ], 20.0
    if purpose == "steps":
        return [
            Segment("pulses", 0.4 * d, 0.13),
            Segment("hover", 0.1 * d),
            eight(0.3, 2, 4),
            Segment("doublets", 0.2 * d, 0.3),
        ], 10.0
    if purpose == "low":
        r = airframe.rotor_radius_m
        top = max(1.5, 14 * r)
        ladder = [
            Segment("climb_to", 0.08 * d, size=u(6, 8) * r),
            Segment("hover", 0.07 * d),
            Segment("climb_to", 0.08 * d, size=u(3, 4) * r),
            Segment("hover", 0.07 * d),
            Segment("climb_to", 0.15 * d, size=top),
            Segment("eight", 0.25 * d, u(1.5, 3.0) * f, 1.5, heading),
            Segment("climb_to", 0.15 * d, size=u(1.1, 1.6) * r),
            Segment("hover", 0.15 * d),
        ]
        return ladder, 1.4 * r
    if purpose == "landing":
        r = airframe.rotor_radius_m
        return [
            eight(0.4),
            Segment("multisine", 0.2 * d, 0.1 * f),
            Segment("climb_to", 0.25 * d, size=1.3 * r),
            Segment("hover", 0.15 * d),
        ], 4.0
    if purpose == "descents":
        v = 1.1 * airframe.hover_inflow_m_s
        return [Segment("vertical", 0.75 * d, v, v * v / 5.0), Segment("multisine", 0.25 * d, 0.12)], 40.0
    if purpose == "calm":
        return [
            Segment("hover", 0.4 * d),
            Segment("circle", 0.3 * d, 0.4, 1.0),
            Segment("hover", 0.3 * d),
        ], 5.0
    if purpose == "gentle":
        return [
            Segment("circle", 0.5 * d, 1.0, 2.5),
            Segment("vertical", 0.3 * d, 0.5, 0.8),
            Segment("yaw", 0.2 * d, 0.6),
        ], 5.0
    if purpose == "heave":
        # one slow frequency, enough force to show a lag or a delay but not which
        return [Segment("vertical", 0.8 * d, 1.2, 0.9), Segment("hover", 0.2 * d)], 5.0
    if purpose == "one_way":
        # forwards only, always about the same speed
        return [Segment("one_way", d, speed=6.0 * f, heading_rad=0.0)], 10.0
    raise ValueError(f"unknown purpose {purpose!r}")
