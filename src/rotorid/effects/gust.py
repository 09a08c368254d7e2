"""A gust: wind that comes and goes. Its forms are built for windows that the residual itself shows."""

import re

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, at_hubs

_MOST_N = 1000.0
"""Bound of a knot's force: the form is built without a vehicle, so it is one for any size."""
_NAME = re.compile(r"(-?\d+\.\d\d) s to (-?\d+\.\d\d) s, (\d+) knots")


def window_form(start_s: float, stop_s: float, knots: int) -> Form:
    """F = Rᵀ f(t) inside [start, stop], to a hundredth of a second: a force in world axes, linear between knots.

    `knots` are the inner ones; the force is zero outside.
    """
    start_s, stop_s = round(start_s, 2), round(stop_s, 2)
    edges = np.linspace(start_s, stop_s, knots + 2)

    def contribution(motion, vehicle, values):
        f = np.zeros((motion.size, 3))
        for axis in range(2):
            inner = np.concatenate([[0.0], values[axis * knots : (axis + 1) * knots], [0.0]])
            f[:, axis] = np.interp(motion.time_s, edges, inner, left=0.0, right=0.0)
        # The rotors catch the wind in proportion to their speeds: the force acts at the hubs.
        body = np.einsum("nji,nj->ni", motion.rotation, f)
        total = motion.rotor_speed.sum(axis=1, keepdims=True)
        share = motion.rotor_speed / np.where(total > 0, total, 1.0)
        return at_hubs(share[:, :, None] * body[:, None, :], vehicle.rotor_positions_m())

    parameters = tuple(
        Parameter(f"f_{axis}_{k + 1}", "N", -_MOST_N, _MOST_N, meaning=f"force to the {axis} at knot {k + 1}")
        for axis in ("north", "east")
        for k in range(knots)
    )
    name = f"{start_s:.2f} s to {stop_s:.2f} s, {knots} knots"
    return Form(
        name,
        "F = Rᵀ f(t)",
        parameters,
        contribution,
        ("rotation", "rotor_speed"),
        kernel=kernel,
        kernel_values=lambda values: (start_s, stop_s, knots, *values),
    )


def kernel(m, v, p, w):
    """F = Rᵀ f(t); `p` is start and stop, the number of inner knots, then their forces north and east."""
    knots = int(p[2])
    place = (m.time_s - p[0]) / (p[1] - p[0]) * (knots + 1)
    if place <= 0.0 or place >= knots + 1 or m.rotor_speed_sum <= 0.0:
        return
    before = int(place)
    share = place - before
    north = east = 0.0
    if before > 0:
        north += (1.0 - share) * p[2 + before]
        east += (1.0 - share) * p[2 + knots + before]
    if before < knots:
        north += share * p[3 + before]
        east += share * p[3 + knots + before]
    for i in range(v.rotors):
        caught = m.rotor_speed[i] / m.rotor_speed_sum
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
)
