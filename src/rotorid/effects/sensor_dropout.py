"""A sensor that gave nothing for a while: missing, held or zero readings.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="sensor_dropout",
    name="a sensor that dropped out",
    sentence="a column stands still, reads zero or is empty while the vehicle flies on",
    forms=forms,
    source="contract; methods.md, lesson 12",
    confusers=(),
    separating_manoeuvre="check the sensor's plug and repeat the flight",
    kind="sensor",
)
