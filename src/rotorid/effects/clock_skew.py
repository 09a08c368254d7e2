"""A sensor's clock that runs at another rate, so that its lateness grows.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

from rotorid.effects.contract import Effect, Parameter
from rotorid.effects.recorded import late_sensors


def set_forms(vehicle):
    parameters = (
        Parameter("e", "1", -0.05, 0.05, meaning="lateness gained per second"),
        Parameter("T", "s", -1.0, 1.0, meaning="lateness at the start of the run"),
    )

    def late_s(since_s, values):
        return values[1] + values[0] * since_s

    return late_sensors(vehicle, "written at t: the value of t − T − e t", parameters, (0.004, 0.0), late_s)


EFFECT = Effect(
    id="clock_skew",
    name="a clock that runs at another rate",
    sentence="a sensor's lateness against the others grows through each run",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="positive e: the sensor falls further behind as the run goes on",
    validity="a rate that is constant over a run; jumps of a clock are left out",
    source="clock arithmetic; catalogue B11",
    confusers=("delay",),
    separating_manoeuvre="tap the frame sharply at the start and at the end of a long run",
    kind="sensor",
)
