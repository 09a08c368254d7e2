"""A pure delay: of the command on its way to the rotors, or of a sensor's stamps."""

import numpy as np

from rotorid.effects.clock_skew import at_other_times
from rotorid.effects.contract import Effect, Form, Parameter, SpeedForm
from rotorid.effects.loading import weights_of_four
from rotorid.effects.recorded import late_sensors


def shifted(path, values):
    """ω(t) = ω_c(t - T), cubic between samples; the ends are held.

    The mean of two neighbours, for a command that is held, would take 8 % of a fifth of the sampling rate away.
    """
    count = len(path.speed)
    steps = float(np.clip(values[0] / path.dt_s, -count, count))
    whole = int(np.floor(steps))
    weights = weights_of_four(2.0 - (steps - whole))
    ends = abs(whole) + 2
    held = np.pad(path.speed, ((ends, ends), (0, 0)), "edge")
    first = ends - whole - 2
    return sum(w * held[first + i : first + i + count] for i, w in enumerate(weights) if w)


def set_forms(vehicle):
    parameters = (Parameter("T", "s", -0.5, 0.5, meaning="time behind", negligible=0.001),)
    return late_sensors(vehicle, "written at t: the value of t − T", parameters, (0.03,), lambda t, values: values[0])


def late_reading(loading, vehicle, values):
    """y(t) = F(t − T)."""
    return at_other_times(loading, values[0])


def reading_forms(instrument):
    """A reading late by more than two samples; what is less is a nuisance or cannot be told from a filter."""
    dt = 1.0 / instrument.rate_hz
    starts = (1.5 * dt, 4 * dt, 12 * dt, -1.5 * dt, -4 * dt)
    late = Parameter(
        "T", "s", -30 * dt, 60 * dt, nonlinear=True, starts=starts, meaning="time behind", negligible=2 * dt
    )
    return (Form("of the reading", "y(t) = F(t − T)", (late,), late_reading, excited_by=("load_change",)),)


EFFECT = Effect(
    id="delay",
    name="a delay",
    sentence="one recording follows another late, without being smoothed",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    reading_forms=reading_forms,
    speed_forms=(
        SpeedForm(
            "of the command",
            "ω(t) = ω_c(t − T)",
            (
                Parameter(
                    "T",
                    "s",
                    -0.05,
                    0.3,
                    nonlinear=True,
                    starts=(0.01, 0.03, 0.1),
                    meaning="time behind",
                    negligible=0.001,
                ),
            ),
            3,
            shifted,
            (0.0,),
            excited_by="change",
        ),
    ),
    source="signal theory (phase linear in frequency, gain one); catalogue F20",
    sign="positive T is late: what is written at t happened at t − T",
    validity="a constant delay; the part below one sample is a nuisance and never reported",
    confusers=("motor_lag", "clock_skew"),
    separating_manoeuvre="excite collective and attitude up to 8 Hz",
    kind="sensor",
    exact=True,
)
