"""A sensor's clock that runs at another rate, so that its lateness grows.

On a flight it is recognised before the physics (rotorid.mismatch.mistakes): it is no wrench. On a stand or bench the
reading lies on another clock than what loads it.
"""

from operator import attrgetter

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, late_sensors
from rotorid.effects.loading import between_samples


def set_forms(vehicle):
    parameters = (
        Parameter("e", "1", -0.05, 0.05, meaning="lateness gained per second"),
        Parameter("T", "s", -1.0, 1.0, meaning="lateness at the start of the run"),
    )

    def late_s(since_s, values):
        return values[1] + values[0] * since_s

    return late_sensors(vehicle, "written at t: the value of t − T − e t", parameters, (0.004, 0.0), late_s)


def at_other_times(loading, late_s):
    """The load `late_s` (n,) earlier less the load now, (n, 6)."""
    steps = np.arange(loading.size) - late_s / loading.dt_s
    return Contribution(reading=between_samples(loading.load, steps) - loading.load)


def _other_rate(since_s):
    """y(t) = F(t − e t), t = `since_s(loading)`."""

    def contribution(loading, vehicle, values):
        return at_other_times(loading, values[0] * since_s(loading))

    return contribution


def _other_rate_and_start(since_s):
    """y(t) = F(t − T − e t), t = `since_s(loading)`."""

    def contribution(loading, vehicle, values):
        return at_other_times(loading, values[1] + values[0] * since_s(loading))

    return contribution


def _forms(instrument, name, span_s, since_s, t):
    """The two forms of a clock that counts from a start `span_s` before its last sample."""
    dt = 1.0 / instrument.rate_hz
    rate = 1.0 / max(instrument.rate_hz * span_s, 10.0)
    starts = tuple(s * k * rate for k in (3.0, 15.0, 60.0) if k * rate < 0.1 for s in (-1, 1))
    skew = Parameter("e", "1", -0.1, 0.1, True, starts, "seconds lost per second", negligible=rate)
    at_start = tuple(k * dt for k in (-4.0, 4.0))
    late = Parameter("T", "s", -30 * dt, 60 * dt, True, at_start, "lateness at the start", negligible=2 * dt)
    alone, both = _other_rate(since_s), _other_rate_and_start(since_s)
    return (
        Form(f"other rate{name}", f"y(t) = F(t − e {t})", (skew,), alone, excited_by=("load_change",)),
        Form(
            f"other rate and start{name}", f"y(t) = F(t − T − e {t})", (skew, late), both, excited_by=("load_change",)
        ),
    )


def reading_forms(instrument):
    """A clock that each run starts anew, and one that runs on through the session, as `time_s` then does."""
    forms = _forms(instrument, "", instrument.duration_s, attrgetter("run_time_s"), "t")
    if instrument.session_clock:
        since_s = attrgetter("session_time_s")
        forms += _forms(instrument, " over the session", instrument.session_s, since_s, "t_s")
    return forms


EFFECT = Effect(
    id="clock_skew",
    name="a clock that runs at another rate",
    sentence="a sensor's lateness against the others grows through each run",
    forms=lambda vehicle: (),
    set_forms=set_forms,
    sign="positive e: the sensor falls further behind as the run goes on",
    validity="a rate that is constant over a run; jumps of a clock are left out",
    source="clock arithmetic; catalogue B11",
    reading_forms=reading_forms,
    confusers=("delay",),
    separating_manoeuvre="tap the frame sharply at the start and at the end of a long run",
    kind="sensor",
    exact=True,
    shows="after a change of load",
    cases=("bench/single/clock_skew/strong/0", "bench/single/compliance/strong/0"),
)
