"""Stamps of a sensor, or the actuation, late by a constant of more than one sample.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="delay",
    name="a delay between columns",
    sentence="a sensor shows the motion later than the others, equally at every frequency",
    forms=forms,
    source="physics.md F20",
    confusers=("motor_lag", "clock_skew"),
    separating_manoeuvre="excite roll and pitch quickly (3 to 15 Hz)",
    kind="sensor",
)
