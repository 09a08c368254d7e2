"""A gust: wind that comes and goes. Its forms are built for windows that the residual itself shows."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, at_hubs


def window_form(start_s: float, stop_s: float, knots: int) -> Form:
    """F = Rᵀ f(t) inside [start, stop]: a force in world axes, linear between knots.

    `knots` are the inner ones; the force is zero outside.
    """
    edges = np.linspace(start_s, stop_s, knots + 2)

    def contribution(motion, vehicle, values):
        f = np.zeros((motion.size, 3))
        for axis in range(2):
            inner = np.concatenate([[0.0], values[axis * knots : (axis + 1) * knots], [0.0]])
            f[:, axis] = np.interp(motion.time_s, edges, inner, left=0.0, right=0.0)
        # The rotors catch the wind in proportion to their speeds: the force acts at the hubs.
        body = np.einsum("nji,nj->ni", motion.rotation, f)
        share = motion.rotor_speed / motion.rotor_speed.sum(axis=1, keepdims=True)
        return at_hubs(share[:, :, None] * body[:, None, :], vehicle.rotor_positions_m())

    parameters = tuple(Parameter(f"f_{axis}_{k + 1}", "N") for axis in ("north", "east") for k in range(knots))
    return Form(f"{start_s:.2f} s to {stop_s:.2f} s", "F = Rᵀ f(t)", parameters, contribution, ("rotation",))


EFFECT = Effect(
    id="gust",
    name="a gust",
    sentence="a force in world axes comes and goes",
    forms=lambda vehicle: (),
    source="physics.md F19",
    confusers=("payload", "steady_wind"),
    separating_manoeuvre="repeat the flight in still air",
)
