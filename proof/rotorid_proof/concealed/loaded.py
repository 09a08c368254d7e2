"""Sessions that a plan asks for, recorded by the simulator of the bench or stand that made the set; and sets in which
pairs look alike.

A session is a table of the project's columns with a `run`: loads of a bench, or speeds, commands or throttles of a
stand, and the tilt of its mount. Nothing here imports `rotorid`; whoever plans never sees the answer, which holds how
large what is hidden is.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from .cases import Case
from .drawn import seed_of
from .ground import (
    AXES,
    FINE,
    REFERENCES,
    TOP,
    Cause,
    bench_run,
    channels_of,
    make,
    noise_of,
    parameters,
    resolution,
    stand_columns,
    stand_run,
    written,
)
from .ground_cases import SAME, draw, dressed
from .write import Recording, write_set

LOOK_ALIKE = (
    # kind, truth, form, what it is taken for, runs in which the two look alike, further settings
    ("bench", "creep", "", "hysteresis", ("updown",), {"axes": "z"}),
    ("bench", "hysteresis", "", "creep", ("updown",), {"axes": "z"}),
    ("bench", "load_nonlinearity", "", "hysteresis", ("updown",), {"axes": "z"}),
    ("bench", "tare_offset", "", "zero_drift", ("updown",), {"axes": "z"}),
    ("bench", "crosstalk", "", "mount_tilt", ("updown",), {"axes": "z"}),
    ("bench", "mount_tilt", "", "crosstalk", ("updown", "ramps"), {"axes": "xy"}),
    ("bench", "compliance", "", "load_nonlinearity", ("updown",), {"axes": "z"}),
    ("bench", "amplifier_filter", "", "creep", ("updown",), {"axes": "z", "rate_hz": 50.0}),
    ("stand", "com_offset", "", "sensor_origin", ("trapezoid",), {}),
    ("stand", "sensor_origin", "", "unequal_rotors", ("trapezoid",), {}),
    ("stand", "unequal_rotors", "", "com_offset", ("trapezoid",), {}),
    ("stand", "thrust_tilt", "", "crosstalk", ("trapezoid",), {}),
    ("stand", "crosstalk", "z", "thrust_tilt", ("trapezoid",), {}),
    ("stand", "mount_tilt", "", "cable_stiffness", ("updown", "updown"), {}),
    ("stand", "cable_stiffness", "", "mount_tilt", ("updown", "updown", "updown"), {}),
    ("stand", "wall_interference", "", "creep", ("updown",), {}),
    ("stand", "creep", "", "wall_interference", ("trapezoid",), {}),
    ("stand", "hysteresis", "", "load_nonlinearity", ("trapezoid",), {}),
    ("stand", "load_nonlinearity", "", "thrust_curve", ("updown",), {}),
    ("stand", "tare_offset", "", "com_offset", ("trapezoid",), {}),
)
"""Pairs of the catalogue's confusers, loaded so that little distinguishes them."""
SIZE = 2.0
"""Of what is hidden, over the noise."""
FIXED = {"amplifier_filter": 1.5}
"""Amounts of what the noise does not set the size of."""


def look_alikes(release: str, number: int) -> list[Case]:
    """One case of every pair of LOOK_ALIKE, drawn for a release (the hash of a commit), repetition `number`."""
    out = []
    for kind, effect, form, other, runs, more in LOOK_ALIKE:
        listed = f"{kind}/look_alike/{effect}-{other}"
        name = f"{listed}/{release}/{number:03d}"
        fixed = FIXED.get(effect)
        cause = Cause(effect, size=None if fixed else SIZE, amount=fixed or 1.0, form=form)
        columns = {} if kind == "bench" else {"columns": ("speed",)}
        settings = {"runs": runs, "held_out": False, **columns, **more, "hidden": (cause,)}
        plan = dressed(kind, draw(name), equivalent=SAME.get((kind, effect), ()), **settings)
        out.append(Case(name, seed_of(release, listed, number), "ground", plan, (effect,)))
    return out


def record(case: Case, answer: dict, session: pd.DataFrame) -> Recording:
    """The runs of a session as the case's bench or stand, with what is hidden in it, would have recorded them.

    `session` holds `run`, `time_s` and the columns asked for. A drift of the zero is as large in each run as in the
    set's, however long it is.
    """
    plan = case.settings
    factors = [e["amount"] for e in answer["effects"]]
    amounts = [(c, parameters(c, f, plan)) for c, f in zip(plan.hidden, factors, strict=True)]
    step, runs = resolution(plan, factors), {}
    for number, (name, table) in enumerate(session.groupby("run", sort=False)):
        rng = np.random.default_rng([case.seed, 78, number])
        own = replace(plan, seconds=float(table["time_s"].iloc[-1]) + 1.0 / plan.rate_hz)
        if plan.kind == "bench":
            t, load, reading = bench_run(own, course(table, REFERENCES), "", amounts, rng)
            loaded = {n: load[:, k] for k, n in enumerate(REFERENCES) if "xyz"[k] in plan.axes or plan.axes == "z"}
            known = {"time_s": t} | loaded
        else:
            tilt = [float(table[n].iloc[0]) if n in table else 0.0 for n in ("roll_rad", "pitch_rad")]
            t, *made, reading = stand_run(own, throttle(table, plan.rotors), tilt, amounts, rng)
            known = {"time_s": t} | stand_columns(plan, tilt, *made)
        known, reading = {k: v[::FINE] for k, v in known.items()}, reading[::FINE]
        noisy = np.round((reading + noise_of(plan, len(reading), rng)) / step) * step
        runs[name] = written(plan, known, noisy, rng)
    return Recording(make(plan, case.seed)[0].vehicle, runs, (), plan.form)


def course(table: pd.DataFrame, names, scale: float = 1.0):
    """Columns of a table (0 where it lacks one), times `scale`, as a function of the time that gives (n, k)."""

    def at(t):
        own = [np.interp(t, table["time_s"], table[n]) if n in table else np.zeros(len(t)) for n in names]
        return scale * np.stack(own, axis=1)

    return at


def throttle(table: pd.DataFrame, rotors: int):
    """Throttles that a session asks for, from the column that it states them in."""
    for stem, scale in (("throttle_{}", 1.0), ("rotor_command_{}_rad_s", 1 / TOP), ("rotor_speed_{}_rad_s", 1 / TOP)):
        names = [stem.format(i + 1) for i in range(rotors)]
        if names[0] in table:
            return course(table, names, scale)
    raise ValueError("the session asks for no throttle")


__all__ = ["AXES", "channels_of", "look_alikes", "make", "record", "write_set"]
