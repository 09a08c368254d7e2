"""Rotors that turn the other way than vehicle.yaml says.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

from dataclasses import replace

from rotorid.effects.contract import Effect, Parameter, SetForm
from rotorid.recordings import columns as c

_OTHER = {"ccw": "cw", "cw": "ccw"}


def set_forms(vehicle):
    def apply(recordings, values):
        rotors = tuple(
            rotor.model_copy(update={"spin": _OTHER[rotor.spin]}) if value < 0 else rotor
            for rotor, value in zip(recordings.vehicle.rotors, values, strict=True)
        )
        return replace(recordings, vehicle=recordings.vehicle.model_copy(update={"rotors": rotors}))

    count = vehicle.rotor_count
    parameters = tuple(
        Parameter(f"s_{i + 1}", "1", -1.0, 1.0, meaning=f"−1 where rotor {i + 1} is stated the wrong way")
        for i in range(count)
    )
    right, wrong = (1.0,) * count, (-1.0,) * count
    shown = c.rotor_columns("rotor_speed", count) + c.ANGULAR_VELOCITY
    return (SetForm("stated spins", "spin_i stated = s_i spin_i", parameters, apply, right, wrong, shown),)


EFFECT = Effect(
    id="spin_direction",
    name="a wrong turning sense of the rotors",
    sentence="the yaw moment answers the rotors with the opposite sign",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="−1: vehicle.yaml states the other spin than the rotor has",
    validity="the same in all runs; needs yaw moments (rates or attitude, rotor speeds)",
    source="reaction torque of the rotors; recording contract (mistakes)",
    confusers=("rotor_order", "axis_sign", "rotor_acceleration_torque"),
    separating_manoeuvre="look at the propellers, or yaw to both sides with sharp inputs",
    kind="mistake",
    fitted=False,
    cases=("mistake/spin_direction/all/2", "mistake/rotor_order/all/1"),
)
