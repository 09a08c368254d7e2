"""Air that a wall or fixture throws back into the rotor."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.creep import followed
from rotorid.effects.loading import NO_ROTORS, TOO_SHORT, at_sensor
from rotorid.effects.scale import rotor_radius_m

_STOPPED_RAD_S = 1.0
"""Below this speed a rotor counts as at rest."""


def _thrust_part(gain, loading, vehicle):
    """Reading of the believed thrust times a gain (n, k)."""
    thrust = vehicle.thrust_coefficients_n_s2() * loading.motion.rotor_speed**2 * gain
    hubs = vehicle.rotor_positions_m()
    force, moment = np.zeros((loading.size, 3)), np.zeros((loading.size, 3))
    force[:, 2] = -thrust.sum(axis=1)
    moment[:, 0], moment[:, 1] = -thrust @ hubs[:, 1], thrust @ hubs[:, 0]
    return at_sensor(force, moment, loading.motion, vehicle)


def _recirculation(loading, vehicle, values):
    """T_i = C_F ω_i (ω_i − c LP_τ ω_i): air thrown out goes as the speed, and comes round as inflow after τ.

    Inflow w takes k ω w from the thrust of a turning rotor, and nothing from one at rest.
    """
    speed = loading.motion.rotor_speed
    late = followed(speed, values[1], loading.dt_s)
    gain = np.where(speed > _STOPPED_RAD_S, -values[0] * late / np.maximum(speed, _STOPPED_RAD_S), 0.0)
    return Contribution(reading=_thrust_part(gain, loading, vehicle))


def _of_all_rotors(largest_n):
    """Contribution T_i = C_F ω_i² (1 − c LP_τ(Σ T)/T_max), T_max the largest total thrust, N.

    All rotors stir the same air: what it takes from each is a share that goes as the momentum all have thrown out.
    """

    def contribution(loading, vehicle, values):
        total = (vehicle.thrust_coefficients_n_s2() * loading.motion.rotor_speed**2).sum(axis=1, keepdims=True)
        late = followed(total, values[1], loading.dt_s) / largest_n
        return Contribution(
            reading=_thrust_part(np.broadcast_to(-values[0] * late, (loading.size, 1)), loading, vehicle)
        )

    return contribution


def _by_power(largest_n):
    """Contribution T_i = C_F ω_i² (1 − c LP_τ((ΣT/T_max)^(n/2))), T_max the largest total thrust, N.

    Air driven round a room goes as the speed that the rotors give it (n = 1) or as its momentum (n = 2): between the
    two lie rooms of any size.
    """

    def contribution(loading, vehicle, values):
        share, tau_s, power = values
        total = (vehicle.thrust_coefficients_n_s2() * loading.motion.rotor_speed**2).sum(axis=1, keepdims=True)
        late = followed((total / largest_n) ** (power / 2.0), tau_s, loading.dt_s)
        return Contribution(reading=_thrust_part(np.broadcast_to(-share * late, (loading.size, 1)), loading, vehicle))

    return contribution


def _by_distance(loading, vehicle, values):
    """T_i = (1 + c (R/d)²) C_F ω_i², d the distance to the wall."""
    ratio = (rotor_radius_m(vehicle) / np.maximum(loading.distance, 1e-3)) ** 2
    return Contribution(reading=_thrust_part(values[0] * ratio[:, None], loading, vehicle))


def reading_forms(instrument):
    if instrument.bench:
        return ()
    forms = []
    span, shortest = instrument.duration_s, max(0.5, 10.0 / instrument.rate_hz)
    if span > 4 * shortest:
        starts = tuple(t for t in (2.0, 6.0, 15.0, 40.0) if shortest <= t <= span) or (0.5 * span,)
        tau = Parameter("tau", "s", shortest, 3 * span, nonlinear=True, starts=starts, meaning="time to come round")
        share = Parameter("c", "1", 0.0, 0.5, meaning="share of the thrust")
        text = "T = C_F ω² − c C_F ω (ω after a lag of τ)"
        forms.append(Form("recirculation", text, (share, tau), _recirculation, ("rotor_speed",)))
        largest = Parameter("c_T", "1", 0.0, 0.5, meaning="share of the thrust when all have turned at their most")
        text = "T = C_F ω² (1 − c_T (ΣT after a lag of τ)/T_max)"
        together = _of_all_rotors(max(instrument.largest[2], 1e-6))
        forms.append(Form("recirculation of all rotors' air", text, (largest, tau), together, ("rotor_speed",)))
        power = Parameter("n", "1", 0.3, 3.0, nonlinear=True, starts=(1.0,), meaning="power of the rotors' speed")
        text = "T = C_F ω² (1 − c_T ((ΣT/T_max)^(n/2) after a lag of τ))"
        by = _by_power(max(instrument.largest[2], 1e-6))
        forms.append(Form("recirculation by a power of the speed", text, (largest, tau, power), by, ("rotor_speed",)))
    if instrument.distance:
        forms.append(
            Form(
                "by distance",
                "T = C_F ω² (1 + c (R/d)²)",
                (Parameter("c", "1", -20.0, 20.0, meaning="gain of thrust at d = R"),),
                _by_distance,
            )
        )
    return tuple(forms)


EFFECT = Effect(
    id="wall_interference",
    name="air thrown back by a wall",
    sentence="thrust falls off within seconds of spinning up, or changes with the distance of a wall",
    forms=lambda vehicle: (),
    reading_forms=reading_forms,
    of_the_rig=True,
    source="catalogue B12",
    sign="positive c of the recirculation takes thrust away; positive c by distance adds thrust near the wall",
    validity=(
        "R/d well below 1 for the form by distance; one time constant of the recirculating air, each rotor's own or "
        "that of all together; the torque is taken as unchanged"
    ),
    excited_by=("rotor_speed",),
    confusers=("battery_sag", "creep", "ground_effect"),
    separating_manoeuvre="turn the propeller round (puller, pusher), or move the wall and repeat",
    lack_on=lambda instrument: NO_ROTORS if instrument.bench else TOO_SHORT,
    cases=("stand/single/wall_interference/strong/0", "stand/single/cable_stiffness/weak/0"),
)
