"""A gust: wind that comes and goes. Its forms are built for windows that the residual itself shows."""

import re

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench

_MOST_N = 1000.0
"""Bound of a knot's force: the form is built without a vehicle, so it is one for any size."""
_AT_REST_RAD_S = 1e-9
"""Sum of the rotor speeds below which no rotor turns."""
_NAME = re.compile(r"(-?\d+\.\d\d) s to (-?\d+\.\d\d) s, (\d+) knots")


def window_form(start_s: float, stop_s: float, knots: int) -> Form:
    """F = Rᵀ f(t) inside [start, stop], to a hundredth of a second: a force in world axes, linear between knots.

    `knots` are the inner ones; the force is zero outside.
    """
    start_s, stop_s = round(start_s, 2), round(stop_s, 2)
    parameters = tuple(
        Parameter(f"f_{axis}_{k + 1}", "N", -_MOST_N, _MOST_N, meaning=f"force to the {axis} at knot {k + 1}")
        for axis in ("north", "east")
        for k in range(knots)
    )
    name = f"{start_s:.2f} s to {stop_s:.2f} s, {knots} knots"
    wrench = Wrench(_pushed, lambda values: (start_s, stop_s, knots, *values))
    return Form(name, "F = Rᵀ f(t)", parameters, wrench, ("rotation", "rotor_speed"))


def _pushed(m, v, p, w):
    """F = Rᵀ f(t); `p` is start and stop, the number of inner knots, then their forces north and east.

    The rotors catch the wind in proportion to their speeds: the force acts at the hubs.
    """
    knots = int(p[2])
    place = (m.time_s - p[0]) / (p[1] - p[0]) * (knots + 1)
    north = east = 0.0
    for k in range(knots):
        # One at its knot, none at the next ones.
        near = np.maximum(1.0 - np.abs(place - (k + 1)), 0.0)
        north += near * p[3 + k]
        east += near * p[3 + knots + k]
    for i in range(v.rotors):
        caught = m.rotor_speed[i] / np.maximum(m.rotor_speed_sum, _AT_REST_RAD_S)
        for j in range(3):
            w.hub_force[i, j] += caught * (m.rotation[0, j] * north + m.rotation[1, j] * east)


def form_named(name: str) -> Form | None:
    """The form of a window, from the name that `window_form` gave it."""
    found = _NAME.fullmatch(name)
    return window_form(float(found[1]), float(found[2]), int(found[3])) if found else None


EFFECT = Effect(
    id="gust",
    name="a gust",
    sentence="for a while the air itself moves",
    forms=lambda vehicle: (),
    form_named=form_named,
    source="a free force in world axes; catalogue F19",
    sign="positive pushes the vehicle to the north or east",
    validity="one stretch of one run, from half a second to half of the run; horizontal; slower than a knot's 0.6 s",
    excited_by=("rotor_speed",),
    confusers=("payload", "steady_wind"),
    separating_manoeuvre="repeat the flight in still air",
    air_moves="in windows",
    cases=("single/gust/strong/0", "single/steady_wind/strong/0"),
)
