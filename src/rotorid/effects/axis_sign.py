"""Axes of a sensor flipped or exchanged, or an attitude in another convention.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

import numpy as np

from rotorid.effects.contract import VECTORS, Effect, Parameter, SetForm, with_columns
from rotorid.recordings import columns as c


def _axes(sensor, names):
    def apply(recordings, values):
        signed = np.round(values).astype(int)
        order, sign = np.abs(signed) - 1, np.sign(signed)
        return with_columns(recordings, names, lambda run, columns: columns[:, order] * sign)

    parameters = tuple(Parameter(f"a_{a}", "1", -3.0, 3.0, meaning=f"axis that column {a} holds") for a in "xyz")
    equation = "column_i = sign(a_i) · component |a_i| (1, 2, 3 for x, y, z)"
    return SetForm(f"of the {sensor}", equation, parameters, apply, (1.0, 2.0, 3.0), (1.0, 2.0, -3.0), names)


def _conjugated(recordings, values):
    sign = np.array([1.0, *[np.sign(values[0])] * 3])
    return with_columns(recordings, c.QUATERNION, lambda run, columns: columns * sign)


def set_forms(vehicle):
    sense = Parameter("s", "1", -1.0, 1.0, meaning="−1 for a quaternion that rotates world vectors into the body")
    return (
        *[_axes(sensor, names) for sensor, names in VECTORS.items()],
        SetForm("attitude conjugated", "q = (w, s x, s y, s z)", (sense,), _conjugated, (1.0,), (-1.0,), c.QUATERNION),
    )


EFFECT = Effect(
    id="axis_sign",
    name="flipped or exchanged axes of a sensor",
    sentence="a sensor sees the motion mirrored or in other axes than the others do",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="a negative a_i is a flipped axis, another number than its own an exchanged one",
    validity="right angles only (a small turn is accelerometer_error or gyro_error); the same in all runs",
    source="kinematics between sensors; recording contract (mistakes)",
    confusers=("rotor_order", "spin_direction"),
    separating_manoeuvre="turn the vehicle by hand about each axis in turn while recording",
    kind="mistake",
    fitted=False,
    contradiction=True,
    cases=("mistake/axis_sign/velocity_y_m_s/7", "mistake/rotor_order/all/1"),
)
