"""Causes outside the catalogue, described by what they depend on alone.

Plain empirical terms compete with the catalogue in the search, so that a force that follows the place in the room
is not sold as the nearest known effect. One that wins is never given a name: it is reported as unexplained,
with what it depends on and how much of the mismatch it carries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.signal import cont2discrete, lfilter

from rotorid.effects.contract import Contribution, Effect, Form, Motion, Parameter
from rotorid.effects.loading import AXES, on_channels


def _to_body(motion, world):
    return np.einsum("nji,nj->ni", motion.rotation, world)


def _place(motion, vehicle, values, middle=0.0):
    """F = Rᵀ (k_h (x, y), k_z z), position in the world from `middle` (3,), m: a spring or a cable to a fixed point."""
    k_h, k_z, north, east = values
    world = (motion.position - middle) * [k_h, k_h, k_z] + [north, east, 0.0]
    return Contribution(force=_to_body(motion, world))


def _height_only(motion, vehicle, values, middle=0.0):
    """F = Rᵀ (0, 0, k_z z), position in the world from `middle` (3,), m."""
    world = (motion.position - middle) * [0.0, 0.0, values[0]]
    return Contribution(force=_to_body(motion, world))


def _fixed_moment(motion, vehicle, values):
    """M = Rᵀ (m_N, m_E, 0): a moment that keeps its direction in the world."""
    world = np.zeros((motion.size, 3))
    world[:, 0], world[:, 1] = values
    return Contribution(moment=_to_body(motion, world))


def _dipole(motion, vehicle, values):
    """M = m × Rᵀ e_N + m' × Rᵀ e_D: a body that aligns with a direction of the world, as a magnet does."""
    north, down = motion.rotation[:, 0, :], motion.rotation[:, 2, :]
    return Contribution(moment=np.cross(np.asarray(values[:3]), north) + np.cross(np.asarray(values[3:]), down))


def _swinging(motion, vehicle, values):
    """q'' + 2 ζ ω q' + ω² q = -a in the rotor plane; F = k_f ω² q, M = k_m (q × e_D): a mass that swings inside."""
    k_f, k_m, omega = values
    dt = float(np.median(np.diff(motion.time_s))) if motion.size > 1 else 0.01
    swing_damping = 0.05
    system = ([-1.0], [1.0, 2 * swing_damping * omega, omega**2])
    numerator, denominator, _ = cont2discrete(system, dt, method="bilinear")
    q = np.zeros((motion.size, 3))
    q[:, :2] = lfilter(numerator.ravel(), denominator, motion.specific_force[:, :2], axis=0)
    turned = np.stack([q[:, 1], -q[:, 0], np.zeros(motion.size)], axis=1)
    return Contribution(force=k_f * omega**2 * q, moment=k_m * omega**2 * turned)


def _place_forms(vehicle):
    spring = (Parameter("k_h", "N/m"), Parameter("k_z", "N/m"), Parameter("f_N", "N"), Parameter("f_E", "N"))
    return (
        Form("height", "F = Rᵀ (0, 0, k_z z)", (Parameter("k_z", "N/m"),), _height_only, ("position", "rotation")),
        Form("place", "F = Rᵀ (f + K p)", spring, _place, ("position", "rotation")),
    )


def _heading_forms(vehicle):
    fixed = (Parameter("m_N", "N m"), Parameter("m_E", "N m"))
    body = tuple(Parameter(f"m_{a}", "N m") for a in "xyz") + tuple(Parameter(f"m'_{a}", "N m") for a in "xyz")
    return (
        Form("fixed", "M = Rᵀ (m_N, m_E, 0)", fixed, _fixed_moment, ("rotation",)),
        Form("dipole", "M = m × Rᵀ e_N + m' × Rᵀ e_D", body, _dipole, ("rotation",)),
    )


def _swing_forms(vehicle):
    swing_starts_rad_s = (4.0, 8.0, 16.0)
    rate = Parameter("ω", "rad/s", 1.5, 40.0, nonlinear=True, starts=swing_starts_rad_s)
    return (
        Form(
            "swing",
            "q'' + 2ζωq' + ω²q = −a, F = k_f ω² q, M = k_m ω² q × e_D",
            (Parameter("k_f", "kg"), Parameter("k_m", "kg m"), rate),
            _swinging,
            ("specific_force",),
            memory=True,
        ),
    )


def _gain_forms(instrument):
    """y = F + g x F on each loaded channel of a bench, x the temperature, the time, or one after the other each run.

    On a stand what turns the rotors changes with time and temperature, too.
    """
    if not instrument.bench:
        return ()
    loaded = tuple(c for c in instrument.channels if c in instrument.loaded)
    forms = [_gain("with the time in a run", "1/min", loaded, lambda x: x.run_time_s / 60.0)]
    if instrument.session_s > 0:
        forms.append(_gain("with the session's time", "1/min", loaded, lambda x: x.session_time_s / 60.0))
    low, high = instrument.temperatures_c
    if high > low:
        forms.append(_gain("with temperature", "1/K", loaded, lambda x: x.temperature_c - low))
    runs = instrument.runs
    if len(runs) > 1:
        forms.append(_mixture_of_each(runs, loaded, instrument.channels))
    for run in runs if len(runs) > 1 else ():
        forms.append(_gain(f"in {run}", "1", loaded, lambda x, run=run: np.full(x.size, float(x.run == run))))
    return tuple(forms)


def _mixture_of_each(runs, loaded, channels):
    """y_i = F_i + M_ij(run) F_j, the mean of M over the runs nothing: that would be crosstalk or a gain.

    A clamp that was moved, a cell that was calibrated anew.
    """
    entries = [(run, i, j) for run in runs[:-1] for i in channels for j in loaded]

    def contribution(loading, vehicle, values):
        reading = np.zeros((loading.size, 6))
        for at in np.flatnonzero(values):
            run, i, j = entries[at]
            if loading.run in (run, runs[-1]):
                reading[:, i] += (values[at] if loading.run == run else -values[at]) * loading.load[:, j]
        return Contribution(reading=reading)

    parameters = tuple(Parameter(f"M_{AXES[i]},{AXES[j]}({run})", "1") for run, i, j in entries)
    return Form("loads mixed anew in each run", "y_i = F_i + M_ij(run) F_j", parameters, contribution)


def _gain(name, unit, channels, factor):
    def signal(loading):
        return loading.load * factor(loading)[:, None]

    return on_channels(name, "y = F + g x F", "g", unit, channels, signal)


_PLACE = Effect(
    id="unknown_place",
    name="a force that depends on the place in the room",
    sentence="a force in world axes follows the position, as of a cable to a fixed point",
    forms=_place_forms,
    source="empirical",
)
_HEADING = Effect(
    id="unknown_heading",
    name="a moment that depends on the heading",
    sentence="a moment keeps its direction in the world while the vehicle turns",
    forms=_heading_forms,
    source="empirical",
)
_SWING = Effect(
    id="unknown_swing",
    name="a mass that swings inside",
    sentence="a force and a moment ring on after every acceleration",
    forms=_swing_forms,
    source="empirical",
)
_GAIN = Effect(
    id="unknown_gain",
    name="a gain that changes",
    sentence="what the reading makes of its load changes with time or temperature or from run to run",
    forms=lambda vehicle: (),
    reading_forms=_gain_forms,
    source="empirical",
)
UNKNOWNS = {e.id: e for e in (_PLACE, _HEADING, _SWING, _GAIN)}
DEPENDS_ON = {
    "unknown_place": ("position",),
    "unknown_heading": ("heading",),
    "unknown_swing": ("specific_force", "time_s"),
    "unknown_gain": ("load", "time_s"),
}
"""Regime variables that each depends on, for the verdict."""


def empirical_effects(motions: Sequence[Motion]) -> list[Effect]:
    """The empirical effects that these flights could distinguish from named ones.

    Places are counted from the mean place where the height hardly varies relative to its mean: a force that follows
    such a height is a second weight.
    """
    kept = [e for e in UNKNOWNS.values() if can_show(e.id, [m.rotation for m in motions])]
    if any(m.position is None for m in motions):
        return kept
    places = np.concatenate([m.position for m in motions])
    middle = np.nanmean(places, axis=0)
    # Spread of the height (one sigma) relative to its mean from which a force that follows it differs from a weight:
    # six percent of its energy are its own.
    least_climb = 0.25
    if np.nanstd(places[:, 2]) > least_climb * abs(middle[2]):
        return kept

    def about_middle(vehicle):
        forms = _place_forms(vehicle)
        return tuple(replace(form, contribution=partial(form.contribution, middle=middle)) for form in forms)

    return [replace(e, forms=about_middle) if e is _PLACE else e for e in kept]


def can_show(effect_id: str, rotations: list[np.ndarray | None]) -> bool:
    """Whether flights with these attitudes, (n, 3, 3) each, could distinguish an empirical effect from a named one.

    On a vehicle that keeps its heading a moment fixed in the world is one fixed in the body: it would take the place
    of a centre of mass or a rotor that is off.
    """
    if effect_id != _HEADING.id or any(r is None for r in rotations):
        return True
    noses = np.concatenate([r[:, 0, 0] + 1j * r[:, 1, 0] for r in rotations])
    noses = noses / np.maximum(np.abs(noses), 1e-12)
    # Spread of the heading (one sigma) from which a moment that keeps its direction in the world differs from one that
    # turns with the vehicle: 14 degrees move a quarter of it elsewhere.
    least_turn_rad = 0.25
    # Of a normally spread heading the mean nose is exp(-sigma² / 2) long.
    return bool(np.abs(noses.mean()) < np.exp(-0.5 * least_turn_rad**2))
