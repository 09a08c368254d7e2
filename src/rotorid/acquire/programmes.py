"""Commands of the quadrotor for an experiment of table A.1."""

from rotorid.io.experiments import Experiment
from rotorid.io.wire.quadrotor import SINE, TRAPEZOID, Programme

RAMP_S = 3.0
HOLD_S = 8.0
PERIODS = 5
LETTERS = {"Hover": "h", "Bounce": "b", "Roll": "r", "Pitch": "p", "Yaw": "y"}


def programme_of(experiment: Experiment) -> tuple[str, Programme]:
    """Command character and programme."""
    letter = LETTERS.get(experiment.dynamics.split()[0], "t")
    if experiment.signal == "sine":
        duration_s = PERIODS / experiment.frequency_hz
        return letter, Programme(SINE, experiment.maxima, 0.0, duration_s, experiment.frequency_hz)
    return letter, Programme(TRAPEZOID, experiment.maxima, RAMP_S, HOLD_S, 0.0)
