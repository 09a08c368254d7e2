"""How late a loop that answers the gyroscope's noise makes its rotors look.

A controller turns the noise n of the gyroscope into commands, M = H n, and the recorded angular acceleration holds
dn/dt: the two go together although no rotor did anything. Fitted as a lateness d of the commanded moment, I dn/dt =
−d dM/dt, this is Σ −I Re(H) ω² S_n / Σ ω² S_M over the frequencies that are compared: the bias of the direct method in
a closed loop (Ljung, System Identification, 2nd ed., ch. 13.4). A hover that does nothing else shows 10 ms of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import csd, welch

from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.rows import baseline_wrench
from rotorid.recordings import Vehicle

WINDOW_S = 2.0
LOWEST_HZ = 0.5


def closed_loop_bias_s(segments: list[Segment], noisy: list[Segment], vehicle: Vehicle, cutoff_hz: float) -> float:
    """Seconds by which roll or pitch, whichever is worse, seem to follow their commands late through noise alone.

    `noisy` are the same segments with the sensors' noise added once more. Zero without commands or body rates.
    """
    inertia = np.diag(vehicle.inertia_kg_m2.matrix())
    late = [0.0]
    for axis in (0, 1):
        echoed = commanded = 0.0
        for plain, again in zip(segments, noisy, strict=True):
            rate = plain.motion.angular_velocity
            if plain.command is None or rate is None or again.motion.angular_velocity is None:
                continue
            moment = baseline_wrench(replace(plain.motion, rotor_speed=plain.command), vehicle)[1][:, axis]
            noise = again.motion.angular_velocity[:, axis] - rate[:, axis]
            how = {"fs": plain.rate_hz, "nperseg": min(len(moment), int(WINDOW_S * plain.rate_hz))}
            f_hz, s_rate = welch(rate[:, axis], **how)
            answer = csd(rate[:, axis], moment, **how)[1] / np.maximum(s_rate, 1e-300)
            weight = np.where((f_hz > LOWEST_HZ) & (f_hz < cutoff_hz), f_hz**2, 0.0) * len(moment)
            echoed -= float(weight @ (answer.real * welch(noise, **how)[1])) * inertia[axis]
            commanded += float(weight @ welch(moment, **how)[1])
        if commanded > 0.0:
            late.append(echoed / commanded)
    return max(late)
