"""The 48 dynamics experiments of the thesis's table A.1, by number."""

from __future__ import annotations

from dataclasses import dataclass

# number: signal, maxima of motors 1–4 as fractions, frequency in Hz, mount roll and pitch in degrees, name
_HOVER, _LOW_HIGH = (0.1, 0.15, 0.2), (0.05, 0.1, 0.15)
_PATTERNS = (  # which motors take the small value, in table A.1's order; the others take 0.2
    ("Roll +", (1, 4)),
    ("Roll -", (2, 3)),
    ("Pitch +", (3, 4)),
    ("Pitch -", (1, 2)),
    ("Yaw +", (2, 4)),
    ("Yaw -", (1, 3)),
)
_BOUNCE_HZ = (0.25, 0.4, 0.5)
_MOUNTS = (  # name, roll, pitch
    ("15° Right", 15, 0),
    ("-15° Left", -15, 0),
    ("15° Backward", 0, 15),
    ("-15° Forward", 0, -15),
    ("30° Right", 30, 0),
    ("-30° Left", -30, 0),
    ("30° Backward", 0, 30),
    ("-30° Forward", 0, -30),
)


@dataclass(frozen=True)
class Experiment:
    """One row of table A.1. Throttles are fractions 0–1; `frequency_hz` is None for a trapezoid."""

    number: int
    signal: str  # trapezoidal | sine
    maxima: tuple[float, float, float, float]
    frequency_hz: float | None
    roll_deg: float
    pitch_deg: float
    dynamics: str


def _rows() -> list[tuple]:
    rows = [("trapezoidal", (value,) * 4, None, 0, 0, "Hover") for value in _HOVER]
    for name, small in _PATTERNS:
        for value in _LOW_HIGH:
            maxima = tuple(value if motor in small else 0.2 for motor in (1, 2, 3, 4))
            rows.append(("trapezoidal", maxima, None, 0, 0, name))
    rows += [("sine", (0.2,) * 4, frequency, 0, 0, "Bounce") for frequency in _BOUNCE_HZ]
    for name, roll, pitch in _MOUNTS:
        rows += [("trapezoidal", (value,) * 4, None, roll, pitch, name) for value in _HOVER]
    return rows


EXPERIMENTS: dict[int, Experiment] = {number: Experiment(number, *row) for number, row in enumerate(_rows(), start=1)}
