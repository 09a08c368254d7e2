"""A sensor whose origin is not where the moments are taken about."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import turned


def _displaced(loading, vehicle, values):
    """M = M_0 + d × F, sensor axes."""
    moment = np.cross(np.asarray(values, float)[None, :], loading.load[:, :3])
    return Contribution(reading=np.concatenate([np.zeros((loading.size, 3)), moment], axis=1))


def _in_plane(loading, vehicle, values):
    """The same without an offset in height."""
    return _displaced(loading, vehicle, (*values, 0.0))


def _with_the_body(loading, vehicle, values):
    """The same, the offset in body axes: it turns with the vehicle where the sensor stays level."""
    offset = np.zeros(3)
    offset[: len(values)] = values
    arm = turned(loading.motion.rotation, offset)
    moment = np.cross(arm, loading.load[:, :3])
    return Contribution(reading=np.concatenate([np.zeros((loading.size, 3)), moment], axis=1))


def reading_forms(instrument):
    if instrument.bench or not any(c >= 3 for c in instrument.channels):
        return ()
    d = tuple(Parameter(f"d_{a}", "m", -0.3, 0.3, meaning=f"stated less true origin along {a}") for a in "xyz")
    text = "M = M_0 + d × F"
    forms = [Form("in the plane", text, d[:2], _in_plane)]
    if any(c in instrument.loaded for c in (0, 1)):
        forms.append(Form("in space", text, d, _displaced))
    if instrument.tilts and instrument.vehicle.sensor_mount == "level":
        forms.append(Form("in the plane, with the body", "M = M_0 + R d × F", d[:2], _with_the_body))
        forms.append(Form("in space, with the body", "M = M_0 + R d × F", d, _with_the_body))
    return tuple(forms)


EFFECT = Effect(
    id="sensor_origin",
    name="an origin of the sensor elsewhere than stated",
    sentence="the moments are off in proportion to the force",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    remedy="calibrate",
    source="catalogue B14",
    sign=(
        "d points from where the sensor really takes moments to where it is stated to; positive d_x with a "
        "force along −z reads as a moment about +y"
    ),
    validity="a stiff and constant offset; forces read truly",
    excited_by=("load",),
    confusers=("com_offset", "unequal_rotors", "crosstalk"),
    separating_manoeuvre="hang known weights at known offsets from the sensor",
    kind="sensor",
    exact=True,
    lack_on=lambda instrument: "no moment is read",
    cases=("stand/single/sensor_origin/strong/0", "stand/single/cable_stiffness/weak/0"),
)
