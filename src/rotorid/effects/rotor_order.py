"""Rotor columns in another order than vehicle.yaml lists the rotors.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

from rotorid.effects.contract import Effect, Parameter, SetForm, with_columns
from rotorid.recordings import columns as c


def set_forms(vehicle):
    count = vehicle.rotor_count
    kinds = [c.rotor_columns(kind, count) for kind in ("rotor_speed", "rotor_command", "throttle")]

    def apply(recordings, values):
        order = [int(round(v)) - 1 for v in values]
        for names in kinds:
            recordings = with_columns(recordings, names, lambda run, columns: columns[:, order])
        return recordings

    parameters = tuple(
        Parameter(f"rotor_{i + 1}", "1", 1.0, count, meaning=f"rotor that column {i + 1} holds") for i in range(count)
    )
    neutral = tuple(float(i + 1) for i in range(count))
    swapped = (*neutral[:-2], *neutral[:-3:-1])
    return (SetForm("columns", "column_i = ω of rotor_i", parameters, apply, neutral, swapped, kinds[0]),)


EFFECT = Effect(
    id="rotor_order",
    name="rotor columns in the wrong order",
    sentence="the moments answer the rotors of other columns than vehicle.yaml says",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="column i holds the rotor of the number rotor_i",
    validity="the same order in all runs; needs moments that differ between rotors (attitude or rates, and excitation)",
    source="kinematics and the rotors' places; recording contract (mistakes)",
    confusers=("spin_direction", "axis_sign", "unequal_rotors"),
    separating_manoeuvre="raise one motor at a time with the propellers off and watch which column moves",
    kind="mistake",
    fitted=False,
    cases=("mistake/rotor_order/all/1", "mistake/spin_direction/all/2"),
)
