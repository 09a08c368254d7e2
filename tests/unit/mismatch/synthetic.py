"""An analysis made by hand: a straight flight with known drag, residuals of coloured noise."""

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.recordings import RecordingSet, Run, Split
from tests.unit.vehicle.thesis import thesis_vehicle

CHANNELS = {f"{g}_{a}": u for g, u in (("force", "N"), ("moment", "N m")) for a in "xyz"}
NOISE = {"force": 0.05, "moment": 0.001}
HOVER = float(np.sqrt(0.652 * 9.81 / (4 * 1.3877e-6)))
K_D = 6e-5
DASH_S = (12.0, 18.0)
SPEED_M_S = 5.0
LENGTH_S = 40.0


def coloured(size: int, sigma: float, rng, pole: float = 0.6) -> np.ndarray:
    """Stationary AR(1) noise of a given size."""
    drive = rng.normal(0, 1, size + 200)
    return sigma * np.sqrt(1 - pole**2) * lfilter([1.0], [1.0, -pole], drive)[200:]


def run(name: str, dash: bool = True) -> Run:
    """A level flight along x at 100 Hz: at rest but for a dash of 5 m/s, exactly consistent with drag K_D."""
    time = np.arange(int(LENGTH_S * 100)) / 100
    ramp = np.clip((time - DASH_S[0]) / 0.3, 0, 1) * np.clip((DASH_S[1] - time) / 0.3, 0, 1)
    # The ripple keeps the reader from taking a constant reading for a held one.
    speed = SPEED_M_S * ramp * dash + 1e-6 * np.sin(17 * time)
    zero = np.zeros(len(time))
    acceleration = np.gradient(speed, time)
    columns = {"time_s": time}
    columns |= {f"rotor_speed_{i}_rad_s": np.full(len(time), HOVER) for i in range(1, 5)}
    columns |= {"quaternion_w": np.ones(len(time)), "quaternion_x": zero, "quaternion_y": zero, "quaternion_z": zero}
    columns |= {f"angular_velocity_{a}_rad_s": zero for a in "xyz"}
    columns |= {"velocity_x_m_s": speed, "velocity_y_m_s": zero, "velocity_z_m_s": zero}
    columns |= {"position_x_m": np.cumsum(speed) / 100, "position_y_m": zero, "position_z_m": zero}
    columns |= {
        "specific_force_x_m_s2": acceleration,
        "specific_force_y_m_s2": zero,
        "specific_force_z_m_s2": np.full(len(time), -9.81),
    }
    return Run(name, pd.DataFrame(columns))


def drag_finding(**changes) -> Finding:
    """Rotor drag at the centre of mass, established."""
    form = {f.name: f for f in catalogue()["rotor_drag"].forms(thesis_vehicle())}["at the centre of mass"]
    values = dict(
        id="rotor_drag", status="established", form=form, values=(K_D,), equation=form.equation,
        sentence="the sideways force grows with airspeed times rotor speed",
        parameters=(Estimate("k_d", K_D, "N s2/(rad m)", 5.8e-5, 6.2e-5),), p_value=1e-9, channels=("force_x",),
        gain=(0.3, 0.25, 0.36),
    )  # fmt: skip
    return Finding(**(values | changes))


def analysis(seed: int = 0, findings=(), bursts=(), dash: bool = True, pole: float = 0.6, **changes) -> Analysis:
    """An analysis of three runs, b held out.

    `bursts` are (run, channel, start_s, stop_s, size): a slow movement that nothing explains.
    """
    rng = np.random.default_rng(seed)
    runs = tuple(run(n, dash) for n in "abc")
    time = np.arange(0.5, LENGTH_S - 0.5, 0.025)
    traces, regimes = [], {}
    for r in runs:
        speed = np.interp(time, r.time_s, r.column("velocity_x_m_s"))
        regimes[r.name] = {"time_s": time, "airspeed_m_s": speed + 0.01 * np.sin(time)}
        for channel, unit in CHANNELS.items():
            sigma = NOISE[channel.split("_")[0]]
            after = coloured(len(time), sigma, rng, pole)
            for name, where, start, stop, size in bursts:
                inside = (time >= start) & (time <= stop)
                if (name, where) == (r.name, channel):
                    after[inside] += coloured(inside.sum(), size * sigma, rng, 0.95)
            taken = np.zeros(len(time))
            if any(f.id == "rotor_drag" for f in findings) and channel == "force_x":
                taken = -K_D * 4 * HOVER * speed
            traces.append(ChannelTrace(r.name, channel, unit, time, after + taken, after + taken, after, after))
    vehicle = thesis_vehicle()
    values = dict(
        recordings=RecordingSet("made", vehicle, runs, ("b",)), split=Split(("a", "c"), ("b",)), believed=vehicle,
        refitted=vehicle, improved=vehicle, named=vehicle, findings=tuple(findings), values={},
        not_testable={"ground_effect": "no height above ground"}, traces=tuple(traces),
        noise_floor={c: NOISE[c.split("_")[0]] for c in CHANNELS},
        p_values={c: (1e-9 if findings and c == "force_x" else 0.4, 0.5) for c in CHANNELS}, regimes=regimes,
    )  # fmt: skip
    return Analysis(**(values | changes))
