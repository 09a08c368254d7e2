"""A sensor's clock that runs at another rate, so that its lateness grows.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="clock_skew",
    name="a clock that runs at another rate",
    sentence="a sensor's lateness against the others grows through each run",
    forms=forms,
    source="physics.md B11",
    confusers=("delay",),
    separating_manoeuvre="tap the frame sharply at the start and at the end of a long run",
    kind="sensor",
)
