"""A pure delay: of the command on its way to the rotors, or of a sensor's stamps."""

import numpy as np

from rotorid.effects.clock_skew import at_other_times
from rotorid.effects.contract import DELAY, Effect, Form, Parameter, SpeedForm, late_sensors
from rotorid.effects.loading import between_samples


def _later(speed, steps):
    """Speeds (n, k) by whole steps later (earlier if negative); the ends are held."""
    steps = int(np.clip(steps, -len(speed), len(speed)))
    out = np.empty_like(speed)
    if steps >= 0:
        out[:steps], out[steps:] = speed[0], speed[: len(speed) - steps]
    else:
        out[steps:], out[:steps] = speed[-1], speed[-steps:]
    return out


def shifted(path, values):
    """ω(t) = ω_c(t - T): of a command that holds the mean over a sample, of a smooth one a cubic between samples."""
    steps = values[0] / path.dt_s
    if not path.holds:
        return between_samples(path.speed, np.arange(len(path.speed)) - steps)
    whole = np.floor(steps)
    part = steps - whole
    out = _later(path.speed, whole)
    if part > 0.0:
        out *= 1.0 - part
        out += part * _later(path.speed, whole + 1)
    return out


def set_forms(vehicle):
    parameters = (Parameter("T", "s", -0.5, 0.5, meaning="time behind", negligible=0.001),)
    return late_sensors(vehicle, "written at t: the value of t − T", parameters, (0.03,), lambda t, values: values[0])


def _late_reading(loading, vehicle, values):
    """y(t) = F(t − T)."""
    return at_other_times(loading, values[0])


def reading_forms(instrument):
    """A reading late by more than two samples; what is less is a nuisance or cannot be distinguished from a filter."""
    dt = 1.0 / instrument.rate_hz
    starts = (1.5 * dt, 4 * dt, 12 * dt, -1.5 * dt, -4 * dt)
    late = Parameter(
        "T", "s", -30 * dt, 60 * dt, nonlinear=True, starts=starts, meaning="time behind", negligible=2 * dt
    )
    return (Form("of the reading", "y(t) = F(t − T)", (late,), _late_reading, excited_by=("load_change",)),)


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
            DELAY,
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
    separating_columns=("rotor_speed",),
    kind="sensor",
    exact=True,
    shows="after a change of load",
    like_of_reading=("amplifier_filter", "delay"),
    cases=("single/delay/strong/0", "single/motor_lag/moderate/0"),
)
