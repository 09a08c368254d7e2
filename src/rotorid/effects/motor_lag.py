"""Motors that need time to reach the commanded speed."""

import numpy as np

from rotorid.effects.contract import LAG, Effect, Parameter, SpeedForm, compiled

_SLOWEST_S = 0.3
"""Longest time constant: rotors of half a metre reach 0.1 s; no attitude loop holds with motors three times slower."""


@compiled()
def _lag(command, up, down):
    """First-order lag with its own step (1 - exp(-dt/τ), weight of the command's change) up and down."""
    out = np.empty_like(command)
    for j in range(command.shape[1]):
        state = command[0, j]
        out[0, j] = state
        for i in range(1, command.shape[0]):
            old, change = command[i - 1, j], command[i, j] - command[i - 1, j]
            share, weight = up if old - state + 0.5 * change * (up[1] > 0) > 0 else down
            state += share * (old - state) + weight * change
            out[i, j] = state
    return out


def lagged(command, tau_up_s, tau_down_s, dt_s, holds=True):
    """dω/dt = (ω_c - ω)/τ, shape (n, k); exact for a command that holds over a sample, or that is linear over it.

    No lag at all for time constants of zero. Linear: ω_k = ω_(k-1) + (1 − e^-r)(c_(k-1) − ω_(k-1)) +
    (1 − (1 − e^-r)/r)(c_k − c_(k-1)) with r = dt/τ.
    """
    if tau_up_s <= 0.0 and tau_down_s <= 0.0:
        return command
    return _lag(np.ascontiguousarray(command), _step(tau_up_s, dt_s, holds), _step(tau_down_s, dt_s, holds))


def _step(tau_s, dt_s, holds):
    ratio = dt_s / max(tau_s, 1e-5)
    share = 1.0 - np.exp(-ratio)
    return share, 0.0 if holds else 1.0 - share / ratio


def _one_constant(path, values):
    return lagged(path.speed, values[0], values[0], path.dt_s, path.holds)


def _up_and_down(path, values):
    return lagged(path.speed, values[0], values[1], path.dt_s, path.holds)


def _on_thrust(path, values):
    """The thrust, not the speed, follows as a first-order lag."""
    return np.sqrt(np.maximum(lagged(path.speed**2, values[0], values[0], path.dt_s, path.holds), 0.0))


def _tau(symbol):
    return Parameter(symbol, "s", 0.0, _SLOWEST_S, nonlinear=True, starts=(0.015, 0.05, 0.15), meaning="time constant")


EFFECT = Effect(
    id="motor_lag",
    name="the lag of the motors",
    sentence="rotor speed follows its command late and smoothed",
    forms=lambda vehicle: (),
    speed_forms=(
        SpeedForm(
            "one constant", "dω/dt = (ω_c − ω)/τ", (_tau("tau"),), LAG, _one_constant, (0.0,), excited_by="change"
        ),
        SpeedForm(
            "up and down",
            "dω/dt = (ω_c − ω)/τ_up or τ_down",
            (_tau("tau_up"), _tau("tau_down")),
            LAG,
            _up_and_down,
            (0.0, 0.0),
            excited_by="change",
        ),
        SpeedForm("on thrust", "dT/dt = (T_c − T)/τ", (_tau("tau"),), LAG, _on_thrust, (0.0,), excited_by="change"),
    ),
    shows_in=("follows",),
    source="Quan, Introduction to Multicopter Design and Control, ch. 6; catalogue F1",
    sign="positive τ follows later; τ_up for speeds that grow, τ_down for speeds that fall",
    validity=(
        "first order, the same for all rotors, amplitudes below the speed controllers' rate limits; "
        "below about 2 Hz it equals a delay"
    ),
    confusers=("delay", "throttle_curve"),
    separating_manoeuvre="excite collective and attitude up to 8 Hz",
    separating_columns=("rotor_speed",),
    like_of_reading=("amplifier_filter",),
    cases=("single/motor_lag/moderate/0", "single/delay/strong/0"),
)
