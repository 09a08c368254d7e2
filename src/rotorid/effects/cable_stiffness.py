"""A cable to the vehicle that pulls as the mount is tilted."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.hysteresis import play
from rotorid.effects.loading import AXES, NO_ROTORS, UNITS

_LOOSE = 0.02
"""Half width of the play by which friction turns over, as a share of the largest tilt: a cable that rubs does so
within a little way, whatever the speed."""
_FRICTION = ((0, 1), (1, 0), (3, 0), (4, 1))
"""Channels and the tilt (0 roll, 1 pitch) whose friction they feel."""
FORCE, MOMENT = "force per sine of the tilt", "moment per sine of the tilt"


def _reading(loading, k):
    """Columns: k (8,) = force x by pitch, force y by roll, moment x by roll, moment y by pitch, then the crossed."""
    roll, pitch = (np.sin(a) for a in loading.attitude)
    out = np.zeros((loading.size, 6))
    out[:, 0] = k[0] * pitch + k[4] * roll
    out[:, 1] = k[1] * roll + k[5] * pitch
    out[:, 3] = k[2] * roll + k[6] * pitch
    out[:, 4] = k[3] * pitch + k[7] * roll
    return Contribution(reading=out)


def _alike(loading, vehicle, values):
    """F = k_F (sin θ, −sin φ), M = k_M (sin φ, sin θ)."""
    f, m = values
    return _reading(loading, (f, -f, m, m, 0, 0, 0, 0))


def own(loading, vehicle, values):
    """Force and moment of its own by roll and by pitch."""
    return _reading(loading, values)


def _vertical(loading, vehicle, values):
    roll, pitch = (np.sin(a) for a in loading.attitude)
    out = np.zeros((loading.size, 6))
    out[:, 2] = values[0] * roll + values[1] * pitch
    return Contribution(reading=out)


def _full(pairs, rubbing=()):
    """Contribution of every pair (channel, tilt), then of the friction of every `rubbing` pair, a value each."""

    def contribution(loading, vehicle, values):
        tilts = [np.sin(a) for a in loading.attitude]
        out = np.zeros((loading.size, 6))
        for (channel, tilt), k in zip(pairs, values, strict=False):
            out[:, channel] += k * tilts[tilt]
        for (channel, tilt), f in zip(rubbing, values[len(pairs) :], strict=True):
            out[:, channel] += f * friction(loading.attitude[tilt])
        return Contribution(reading=out)

    return contribution


def friction(tilt_rad):
    """−1 to 1 by whether a tilt (n,) came from above or from below, turning over within a play; 0 without tilt."""
    width = _LOOSE * float(np.abs(tilt_rad).max())
    return (tilt_rad - play(tilt_rad, width)) / width if width > 0 else np.zeros(len(tilt_rad))


def reading_forms(instrument):
    if instrument.bench or not instrument.tilts or instrument.vehicle.tared:
        return ()
    names = ("k_x,pitch", "k_y,roll", "m_x,roll", "m_y,pitch", "k_x,roll", "k_y,pitch", "m_x,pitch", "m_y,roll")
    units = ("N/rad", "N/rad", "N m/rad", "N m/rad") * 2
    pairs = tuple((c, t) for c in instrument.channels for t in (0, 1))
    rubbing = tuple((c, t) for c, t in _FRICTION if c in instrument.channels)
    matrix = tuple(
        Parameter(f"K_{AXES[c]},{n}", f"{UNITS[c]}/rad", meaning=MOMENT if c > 2 else FORCE)
        for c in instrument.channels
        for n in ("roll", "pitch")
    )
    rubs = tuple(
        Parameter(f"f_{AXES[c]},{('roll', 'pitch')[t]}", UNITS[c], meaning="half the height of the loop of friction")
        for c, t in rubbing
    )
    return (
        Form(
            "alike about both axes",
            "F = k_F (sin θ, −sin φ), M = k_M (sin φ, sin θ)",
            (Parameter("k_F", "N/rad", meaning=FORCE), Parameter("k_M", "N m/rad", meaning=MOMENT)),
            _alike,
            must_show=(0,),
        ),
        Form(
            "own about each axis",
            "F = K_F (sin φ, sin θ), M = K_M (sin φ, sin θ)",
            tuple(Parameter(n, u, meaning=MOMENT if "m" in u else FORCE) for n, u in zip(names, units, strict=True)),
            own,
        ),
        Form("full matrix", "(F, M) = K (sin φ, sin θ)", matrix, _full(pairs)),
        Form(
            "full matrix and friction",
            "(F, M) = K (sin φ, sin θ) + f (branch of φ, θ: 1 rising, −1 falling)",
            (*matrix, *rubs),
            _full(pairs, rubbing),
        ),
        Form(
            "vertical",
            "F_z = k (sin φ, sin θ)",
            tuple(Parameter(f"k_z,{n}", "N/rad", meaning=FORCE) for n in ("roll", "pitch")),
            _vertical,
        ),
    )


EFFECT = Effect(
    id="cable_stiffness",
    name="the stiffness of a cable",
    sentence="a force that depends on the tilt of the mount, motors on or off",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    of_the_rig=True,
    source="catalogue B7",
    sign=(
        "positive k_F pulls towards +x as the mount pitches up and towards −y as it rolls right; positive k_M "
        "turns the reading about +x with roll and about +y with pitch"
    ),
    validity=(
        "an elastic cable, its pull proportional to the sine of each tilt; friction, a cable that goes slack "
        "and a tare in each attitude (which hides it) are left out"
    ),
    excited_by=("tilt",),
    confusers=("mount_tilt", "com_offset", "tare_offset"),
    separating_manoeuvre="lay the cable differently and repeat the tilts",
    kind="physics",
    lack_on=lambda instrument: (
        NO_ROTORS
        if instrument.bench
        else "zeroed in each attitude"
        if instrument.vehicle.tared
        else "the mount is never tilted"
    ),
    cases=("stand/single/cable_stiffness/weak/0", "stand/single/sensor_origin/strong/0"),
)
