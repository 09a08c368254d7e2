"""A sensor that gave nothing for a while: missing, held or zero readings.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench.
"""

import numpy as np

from rotorid.effects.contract import Effect, Parameter, SetForm, sensors, with_columns
from rotorid.recordings import columns as c

_WINDOW = (
    Parameter("start", "s", 0.0, 1e5, meaning="begin, seconds from the run's start"),
    Parameter("stop", "s", 0.0, 1e5, meaning="end, seconds from the run's start"),
)


def _held(columns, inside):
    first = int(np.argmax(inside))
    columns[inside] = columns[max(first - 1, 0)]


def _zero(columns, inside):
    columns[inside] = 0.0


def _missing(columns, inside):
    columns[inside] = np.nan


def _lost(name, names, equation, spoil):
    def apply(recordings, values):
        def change(run, columns):
            since = run.time_s - run.time_s[0]
            inside = (since >= values[0]) & (since < values[1])
            if inside.any():
                spoil(columns, inside)
            return columns

        return with_columns(recordings, names, change)

    return SetForm(name, equation, _WINDOW, apply, (0.0, 0.0), (8.0, 10.5), names)


def set_forms(vehicle):
    kinds = {
        "held": ("column = its last value, start ≤ t < stop", _held),
        "zero": ("column = 0, start ≤ t < stop", _zero),
        "missing": ("no value, start ≤ t < stop", _missing),
    }
    groups = {s: names for s, names in sensors(vehicle).items() if s != "rotor speeds"}
    groups |= {f"rotor {i + 1}": (n,) for i, n in enumerate(c.rotor_columns("rotor_speed", vehicle.rotor_count))}
    return tuple(_lost(f"{s}, {kind}", names, *how) for s, names in groups.items() for kind, how in kinds.items())


EFFECT = Effect(
    id="sensor_dropout",
    name="a sensor that dropped out",
    sentence="a column stands still, reads zero or is empty while the vehicle flies on",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="start and stop are the window's ends, counted from the start of each run",
    validity="the sensor is sound outside the window; readings that are held as a rule are a slower rate, not a loss",
    source="recording contract (faults of the public recordings)",
    confusers=(),
    separating_manoeuvre="check the sensor's plug and repeat the flight",
    kind="sensor",
    fitted=False,
    contradiction=True,
    cases=("single/sensor_dropout/moderate/0", "multibody/ground/f0e7b8f8/001"),
)
