"""A reading in steps that are coarse compared with its noise.

Recognised from the readings themselves (rotorid.mismatch.instrument.sampling); it has no form to fit.
"""

from rotorid.effects.contract import Effect

EFFECT = Effect(
    id="quantisation",
    name="the coarse steps of the reading",
    sentence="the reading moves in steps that are coarse compared with its noise",
    forms=lambda vehicle: (),
    reading_forms=lambda instrument: (),
    source="catalogue B10",
    sign="no sign: the step is a size, found from the readings",
    validity=(
        "steps of one size, coarse compared with the noise; where the noise is wider than a step nothing is left of it"
    ),
    excited_by=("always",),
    confusers=("hysteresis",),
    separating_manoeuvre="read with a finer range, or add a small known dither",
    kind="sensor",
    fitted=False,
    cases=("bench/single/quantisation/strong/0", "bench/single/hysteresis/strong/0"),
)
