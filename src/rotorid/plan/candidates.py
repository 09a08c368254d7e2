"""What a flight or session may ask, as its user states it, and manoeuvres to choose from.

A manoeuvre's pieces start and end at rest in one place, so that they join in any order. A piece is a reference for
position (north-east-down, from the middle of the volume) and yaw, as large as the limits allow or a stated share of it.
Oscillations of several axes at once have harmonics of their own each, so that they are orthogonal over the piece.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from rotorid.errors import InputError
from rotorid.io.models import KnownKeys
from rotorid.io.text.files import read_yaml, with_exponents
from rotorid.io.text.wording import hint

_Range = tuple[float, float]
_Kind = TypeVar("_Kind", bound=KnownKeys)
_GRAVITY_M_S2 = 9.81
_RAMP_S = 2.0
_SLOW_RAMP_S = 4.0
"""Of motions over ground: in RAMP_S a fast pass would tilt more to start than to turn round."""
STANDARD = {"eight": 0.3, "climb at 1": 0.2, "shake all to 8 Hz": 0.2, "turn": 0.15, "doublets": 0.15}
"""Parts of the standard flight, in their order, and the share of its time that each takes."""
_ROOM = 0.85
"""Share of the tilt allowed that a reference asks for: drag and the controller take some."""
_PIECE_S = 10.0
_HEAVE_RAD_S = 3.0
"""Rate of the waves: thrust then changes by a good part while the speed over ground stays."""


@dataclass(frozen=True)
class Reference:
    """Where to be when: position (n, 3), m, north-east-down from the middle of the volume, and yaw (n,), rad."""

    time_s: np.ndarray
    position_m: np.ndarray
    yaw_rad: np.ndarray

    @property
    def duration_s(self) -> float:
        """Length, s."""
        return float(self.time_s[-1])


@dataclass(frozen=True)
class ManoeuvrePiece:
    """A manoeuvre: its name, what to do in words, and the reference at even instants (n,), s, from 0."""

    name: str
    words: str
    make: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    duration_s: float = _PIECE_S

    def reference(self, step_s: float) -> Reference:
        """The reference at steps of `step_s`."""
        t = step_s * np.arange(int(round(self.duration_s / step_s)) + 1)
        position, yaw = self.make(t)
        return Reference(t, position, yaw)


def _motion(t: np.ndarray, yaw=0.0, **along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position (n, 3) of what moves `along` x, y or z, each (n,), and yaw (n,); at rest in all else."""
    position, turned = np.zeros((len(t), 3)), np.zeros(len(t))
    turned[:] = yaw
    for axis, values in along.items():
        position[:, "xyz".index(axis)] = values
    return position, turned


def _smooth(s: np.ndarray) -> np.ndarray:
    """From 0 to 1, twice differentiable, while s goes from 0 to 1."""
    s = np.clip(s, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _envelope(t: np.ndarray, ramp_s: float = _RAMP_S) -> np.ndarray:
    """From 0 smoothly to 1 and back to 0, twice differentiable; `ramp_s` each way."""
    return _smooth(np.minimum(t, t[-1] - t) / ramp_s)


def _most_level_m_s2(limits: Limits) -> float:
    """Level acceleration that a reference asks for at most."""
    return _ROOM * _GRAVITY_M_S2 * np.tan(np.radians(limits.tilt_deg))


def _phase(t: np.ndarray, rate_rad_s: float, unit_rad: float = np.pi, ramp_s: float = _RAMP_S) -> np.ndarray:
    """Phase that speeds up from rest and slows down to it, a whole number of units in all, (n,), rad."""
    speed = _envelope(t, ramp_s)
    raw = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
    units = max(1.0, np.floor(rate_rad_s * raw[-1] / unit_rad + 0.02))
    return unit_rad * units * raw / raw[-1]


def _swing(
    t: np.ndarray, amplitude: float, rate_rad_s: float, ramp_s: float = _SLOW_RAMP_S
) -> tuple[float, np.ndarray]:
    """Amplitude and phase (n,), rad, of a swing there and back; smaller where the time asks for a faster phase."""
    angle = _phase(t, rate_rad_s, ramp_s=ramp_s)
    fastest = float(np.gradient(angle, t).max())
    return amplitude * min(1.0, (1.05 * rate_rad_s / fastest) ** 2), angle


def _to_and_fro(t: np.ndarray, amplitude: float, rate_rad_s: float) -> np.ndarray:
    """A swing over ground (n,) that always has its amplitude."""
    return amplitude * np.sin(_phase(t, rate_rad_s, ramp_s=_SLOW_RAMP_S))


def _whole(rate_rad_s: float, about_s: float, unit_rad: float = np.pi, ramp_s: float = _RAMP_S) -> float:
    """Duration near `about_s`, s, in which a phase of that rate goes through a whole number of units."""
    units = max(1, round(rate_rad_s * (about_s - ramp_s) / unit_rad))
    return ramp_s + units * unit_rad / rate_rad_s


def _multisine(t: np.ndarray, harmonics: np.ndarray, seed: int) -> np.ndarray:
    """Sum of cosines of the piece's harmonics with Schroeder's phases (a low crest), largest 1, (n,)."""
    k = np.arange(1, len(harmonics) + 1)
    angles = -np.pi * k * (k - 1) / len(harmonics) + seed
    wave = np.cos(2 * np.pi * harmonics[:, None] * t / t[-1] + angles[:, None]).sum(axis=0)
    return wave / np.abs(wave).max()


def _largest(limits: Limits, room_m: float, share: float) -> tuple[float, float]:
    """Amplitude (m) and rate (rad/s) of a swing along a line at a share of the speed, within room and tilt."""
    speed, most = share * limits.speed_m_s, _most_level_m_s2(limits)
    amplitude = min(room_m, max(0.5, speed**2 / most * 1.2))
    return amplitude, min(speed / amplitude, np.sqrt(most / amplitude))


def smaller(limits: Limits, share: float) -> Limits:
    """Limits with a share of the room (about its middle), the speeds and the tilt, for motions of that size."""
    middle, room = limits.middle_m, limits.room_m
    low, high = ([m + sign * share * r for m, r in zip(middle, room, strict=True)] for sign in (-1, 1))
    names = ("x_m", "y_m", "height_m")
    ranges = {n: (a, b) for n, a, b in zip(names, low, high, strict=True)}
    scaled = {n: share * getattr(limits, n) for n in ("speed_m_s", "climb_m_s", "tilt_deg", "yaw_rate_deg_s")}
    return limits.model_copy(update=ranges | scaled | {"wall_margin_m": 0.0})


def candidates(limits: Limits, yaw_acceleration_rad_s2: float) -> tuple[ManoeuvrePiece, ...]:
    """Every manoeuvre of the families, for these limits and what the rotors' torque can do about the yaw axis."""
    return (
        *_still(limits),
        *_passes(limits),
        *_turns(limits, yaw_acceleration_rad_s2),
        *_climbs(limits),
        *_oscillations(limits, yaw_acceleration_rad_s2),
        _doublets(limits, yaw_acceleration_rad_s2),
    )


def standard(parts: Mapping[str, ManoeuvrePiece], duration_s: float) -> ManoeuvrePiece:
    """What a pilot flies who has no plan, in `duration_s`: an eight, climbs, quick motions, turns and doublets.

    `parts` are candidates by their names, of these at least those of STANDARD.
    """

    def make(t):
        edges = np.round(np.cumsum([0.0, *STANDARD.values()]) * (len(t) - 1)).astype(int)
        position, yaw = _motion(t)
        for name, start, stop in zip(STANDARD, edges, edges[1:], strict=False):
            position[start : stop + 1], yaw[start : stop + 1] = parts[name].make(t[start : stop + 1] - t[start])
        return position, yaw

    words = "the standard flight: an eight, climbs, quick motions, turns to and fro, doublets"
    return ManoeuvrePiece("standard", words, make, duration_s)


def _still(limits: Limits) -> list[ManoeuvrePiece]:
    change_s = max(1.5, 2.0 * limits.room_m[2] / limits.climb_m_s)

    def ladder(t):
        # Down to the lowest height, up to the highest, in held steps.
        steps = np.array([0, -1, -0.5, 0, 0.5, 1, 0]) * limits.room_m[2]
        at = np.linspace(0, t[-1], len(steps) + 1)
        down = np.zeros(len(t))
        for before, after, when in zip(steps, steps[1:], at[1:], strict=False):
            down -= (after - before) * _smooth((t - when) / change_s + 0.5)
        return _motion(t, z=down)

    low, high = limits.height_m[0], limits.height_m[1] - limits.wall_margin_m
    words = f"hover at held heights from {low:.1f} to {high:.1f} m"
    return [
        ManoeuvrePiece("hover", "hover on the spot", _motion),
        ManoeuvrePiece("ladder", words, ladder, 7 * (change_s + 1.5)),
    ]


def _passes(limits: Limits) -> list[ManoeuvrePiece]:
    out = []
    for share in (0.4, 0.7, 1.0):
        for degrees in (0, 45, 90):
            angle = np.radians(degrees)
            ahead = np.cos(angle), np.sin(angle)
            room = min(r / abs(a) for r, a in zip(limits.room_m, ahead, strict=False) if abs(a) > 1e-9)
            amplitude, rate = _largest(limits, room, share)

            def make(t, amplitude=amplitude, rate=rate, ahead=ahead):
                way = _to_and_fro(t, amplitude, rate)
                return _motion(t, x=way * ahead[0], y=way * ahead[1])

            way = {0: "along the nose", 45: "across the diagonal", 90: "sideways"}[degrees]
            words = f"to and fro {way}, {amplitude:.1f} m each way at up to {amplitude * rate:.1f} m/s, nose held"
            duration_s = _whole(rate, 15.0, ramp_s=_SLOW_RAMP_S)
            out.append(ManoeuvrePiece(f"pass {degrees} at {share:g}", words, make, duration_s))
    for degrees, axis, way in ((0, "x", "along the nose"), (90, "y", "sideways")):
        amplitude, rate = _largest(limits, limits.room_m["xyz".index(axis)], 0.8)
        heave = min(limits.room_m[2], 0.6 * limits.climb_m_s / _HEAVE_RAD_S, 0.3 * _GRAVITY_M_S2 / _HEAVE_RAD_S**2)

        def make(t, amplitude=amplitude, rate=rate, axis=axis, heave=heave):
            return _motion(t, z=heave * np.sin(_phase(t, _HEAVE_RAD_S)), **{axis: _to_and_fro(t, amplitude, rate)})

        words = f"to and fro {way} at up to {amplitude * rate:.1f} m/s in waves of {heave:.1f} m up and down"
        out.append(ManoeuvrePiece(f"waves {degrees}", words, make, _whole(rate, 15.0, ramp_s=_SLOW_RAMP_S)))
    return out


def _turns(limits: Limits, most_rad_s2: float) -> list[ManoeuvrePiece]:
    longest_s = 30.0  # A turn that the rotors' torque makes more slowly is no candidate.
    room = min(limits.room_m[:2])
    amplitude, rate = _largest(limits, room, 0.8)
    # The ramp of a turn reaches its rate in RAMP_S, at most 1.9 times as fast in its midst.
    yaw_rate = min(0.8 * np.radians(limits.yaw_rate_deg_s), most_rad_s2 * _RAMP_S / 1.9)

    def spin(t):
        return _motion(t, _phase(t, yaw_rate, 2 * np.pi))

    def eight(t):
        size, angle = _swing(t, amplitude, rate / np.sqrt(2))
        return _motion(t, x=size * np.sin(angle), y=size / 2 * np.sin(2 * angle))

    def turn(t):
        # One way in the first half, back in the second: the nose ends where it was.
        half = t[: (len(t) + 1) // 2]
        speed = yaw_rate * _envelope(half)
        there = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(half))])
        return _motion(t, np.concatenate([there, there[: len(t) // 2][::-1]]))

    def drift(t):
        # To and fro over ground while the nose turns: body axes and world axes part.
        return _motion(t, _phase(t, 0.6 * yaw_rate, 2 * np.pi), x=_to_and_fro(t, amplitude, rate))

    words = f"a figure of eight, {amplitude:.1f} m each way, nose held"
    pieces = [ManoeuvrePiece("eight", words, eight, _whole(rate / np.sqrt(2), 15.0, ramp_s=_SLOW_RAMP_S))]
    # Half a turn by a quintic: its largest rate is 1.875 π / T, its largest acceleration 5.77 π / T².
    half_s = max(1.875 * np.pi / (0.8 * np.radians(limits.yaw_rate_deg_s)), np.sqrt(5.77 * np.pi / most_rad_s2), 1.0)

    def face(t):
        return _motion(t, np.pi * _smooth(np.minimum(t - 1.0, t[-1] - 1.0 - t) / half_s))

    pieces.append(ManoeuvrePiece("face", "turn the nose half round, hover, turn it back", face, 2 * half_s + 4.0))
    degrees = np.degrees(yaw_rate)
    pieces.append(ManoeuvrePiece("turn", f"turn on the spot to and fro at up to {degrees:.0f} degrees a second", turn))
    for name, words, make, speed in (
        ("spin", f"turn on the spot at up to {degrees:.0f} degrees a second", spin, yaw_rate),
        ("drift", "to and fro over ground while the nose turns all round", drift, 0.6 * yaw_rate),
    ):
        duration = _whole(speed, 12.0, 2 * np.pi)
        if duration <= longest_s:
            pieces.append(ManoeuvrePiece(name, words, make, duration))
    return pieces


def _climbs(limits: Limits) -> list[ManoeuvrePiece]:
    out = []
    for share in (0.5, 1.0):
        speed, room = share * limits.climb_m_s, limits.room_m[2]
        amplitude = min(room, max(0.2, speed**2 / 4.0))
        rate = min(speed / amplitude, np.sqrt(4.0 / amplitude))

        def make(t, amplitude=amplitude, rate=rate):
            size, angle = _swing(t, amplitude, rate, _RAMP_S)
            return _motion(t, z=-size * np.sin(angle))

        words = f"climb and descend by {amplitude:.1f} m each way at up to {amplitude * rate:.1f} m/s"
        out.append(ManoeuvrePiece(f"climb at {share:g}", words, make, _whole(rate, _PIECE_S)))
    return out


def _oscillations(limits: Limits, most_rad_s2: float) -> list[ManoeuvrePiece]:
    """Multisines of the acceleration along some axes (and of yaw) with harmonics of their own each."""
    # Oscillations of the acceleration asked for. Of the fastest little is left in the path, but what the attitude loop
    # makes of them turns the vehicle as hard as doublets do.
    bands_hz = ((0.3, 1.0), (0.8, 2.0), (1.5, 4.0), (0.3, 8.0))
    most = _most_level_m_s2(limits)
    families = (
        ("shake all", ("x", "y", "z", "yaw"), "small quick motions along and about all axes at once"),
        ("shake sideways", ("x", "y"), "small quick motions forwards and sideways"),
        ("shake height", ("z",), "small quick climbs and descents"),
        ("shake yaw", ("yaw",), "small quick turns of the nose"),
    )
    out = []
    for name, axes, words in families:
        for low_hz, high_hz in bands_hz:

            def make(t, axes=axes, low_hz=low_hz, high_hz=high_hz):
                inner = t[-1]
                count = np.arange(int(np.ceil(low_hz * inner)), int(high_hz * inner) + 1)
                position, yaw = _motion(t)
                for i, axis in enumerate(axes):
                    own = count[i :: len(axes)].astype(float)
                    wave = _multisine(t, own, i) * _envelope(t)
                    slope = np.gradient(wave, t)
                    bend = np.abs(np.gradient(slope, t)).max()
                    if axis == "yaw":
                        most_rate = 0.8 * np.radians(limits.yaw_rate_deg_s)
                        most_bend = most_rad_s2 / len(axes) ** 0.5
                        yaw = wave * min(np.radians(40.0), most_rate / np.abs(slope).max(), most_bend / bend)
                        continue
                    k = "xyz".index(axis)
                    # What several axes ask of a rotor at once adds up.
                    top = (most / np.sqrt(2) if len(axes) > 1 else most) if k < 2 else 4.0 / len(axes) ** 0.5
                    speed = limits.speed_m_s / np.sqrt(2) if k < 2 else limits.climb_m_s
                    size = min(top / bend, speed / np.abs(slope).max(), limits.room_m[k] / np.abs(wave).max())
                    position[:, k] = size * wave
                return position, yaw

            said = f"{words}, {low_hz:g} to {high_hz:g} times a second"
            out.append(ManoeuvrePiece(f"{name} to {high_hz:g} Hz", said, make))
    return out


def _doublets(limits: Limits, most_rad_s2: float) -> ManoeuvrePiece:
    """Pushes of the tilt forwards, sideways and of the nose, each followed by its opposite, which leads back."""
    doublet_s = 0.3  # Half of a doublet.
    most = _most_level_m_s2(limits)
    push = min(most, limits.speed_m_s / doublet_s, min(limits.room_m[:2]) / doublet_s**2)
    fastest = 0.5 * np.radians(limits.yaw_rate_deg_s) * doublet_s
    turn = min(np.radians(20.0), fastest, most_rad_s2 * doublet_s**2 / 5.77)

    def make(t):
        position, yaw = _motion(t)
        step, each = t[1] - t[0], 4.0 * doublet_s
        half = int(round(doublet_s / step))
        edge = np.hanning(max(half // 3, 3))
        for number in range(int((t[-1] - doublet_s) / (2 * each))):
            # + - at once, - + a little later: at rest again, and back.
            start = int(round((doublet_s / 2 + 2 * each * number) / step))
            wave = np.zeros(len(t))
            for place, sign in ((0, 1.0), (half, -1.0), (4 * half, -1.0), (5 * half, 1.0)):
                wave[start + place : start + place + half] = sign
            wave = np.convolve(wave, edge / edge.sum(), "same")
            axis = number % 3
            if axis < 2:
                position[:, axis] += push * step**2 * np.cumsum(np.cumsum(wave))
            else:
                yaw += turn * wave
        return position, yaw

    words = "quick pushes to and fro: forwards, sideways, of the nose"
    return ManoeuvrePiece("doublets", words, make, 8.0 * doublet_s * 6 + 1.0)


def joined(pieces: tuple[ManoeuvrePiece, ...] | list[ManoeuvrePiece], step_s: float, still_s: float = 1.0) -> Reference:
    """Pieces one after the other, `still_s` at rest before, between and after them; the nose keeps its last yaw."""
    position, yaw, turned = [np.zeros((1, 3))], [np.zeros(1)], 0.0
    rest = int(round(still_s / step_s))
    for piece in pieces:
        own = piece.reference(step_s)
        position += [np.zeros((rest, 3)), own.position_m[1:]]
        yaw += [np.full(rest, turned), turned + own.yaw_rad[1:]]
        turned = float(yaw[-1][-1])
    position.append(np.zeros((rest, 3)))
    yaw.append(np.full(rest, turned))
    every = np.concatenate(position)
    return Reference(step_s * np.arange(len(every)), every, np.concatenate(yaw))


def _number(value: object) -> object:
    """The value as it is; YAML's yes and no are no numbers, and text is none."""
    for part in value if isinstance(value, list) else [value]:
        if isinstance(part, bool):
            raise ValueError("found yes or no, expected a number")
        if isinstance(part, str):
            raise ValueError(f"found {part!r}, expected a number")
    return value


class Limits(KnownKeys, frozen=True, allow_inf_nan=False):
    """Limits of a flight; x and y are from the place of the start, heights above the ground, all in SI but degrees."""

    x_m: _Range = (-3.0, 3.0)
    """North of the start, lowest and highest."""
    y_m: _Range = (-3.0, 3.0)
    """East of the start, lowest and highest."""
    height_m: _Range = (0.8, 3.0)
    """Above the ground, lowest and highest."""
    wall_margin_m: float = Field(0.5, ge=0)
    """Kept from every side of that volume but the lowest height."""
    speed_m_s: float = Field(3.0, gt=0, le=60)
    climb_m_s: float = Field(1.5, gt=0, le=30)
    tilt_deg: float = Field(25.0, gt=0, le=70)
    yaw_rate_deg_s: float = Field(120.0, gt=0, le=2000)
    duration_s: float = Field(60.0, ge=10, le=1200)
    """In the air, in total; what the battery allows."""
    attitude_bandwidth_rad_s: float = Field(9.0, gt=0.5, le=100)
    """Natural frequency of the vehicle's attitude loop: faster changes are not followed."""
    position_bandwidth_rad_s: float | None = Field(None, gt=0.1, le=50)
    """Natural frequency of its position loop; a fifth of the attitude loop's where not stated."""
    target_sigma: float = Field(6.0, gt=0, le=100)
    """Separation, in standard errors, at which a question counts as settled."""

    home_deg: _Range | None = None
    """Latitude and longitude of the start, for a mission; without them none is written."""

    _numbers = field_validator("*", mode="before")(_number)

    @field_validator("x_m", "y_m", "height_m")
    @classmethod
    def _in_order(cls, value: _Range) -> _Range:
        if not value[0] < value[1]:
            raise ValueError(f"found [{value[0]:g}, {value[1]:g}], expected the lower number first")
        return value

    @field_validator("home_deg")
    @classmethod
    def _on_earth(cls, value: _Range | None) -> _Range | None:
        if value is not None and not (abs(value[0]) < 85 and abs(value[1]) <= 180):
            raise ValueError(f"found [{value[0]:g}, {value[1]:g}], expected latitude and longitude in degrees")
        return value

    @model_validator(mode="after")
    def _has_room(self) -> Limits:
        if not self.x_m[0] <= 0 <= self.x_m[1] or not self.y_m[0] <= 0 <= self.y_m[1]:
            raise ValueError("x_m and y_m are from the place of the start and must hold 0")
        if self.height_m[0] < 0:
            raise ValueError(f"height_m starts at {self.height_m[0]:g} m, below the ground")
        slow = self.position_bandwidth_rad_s
        if slow is not None and slow > self.attitude_bandwidth_rad_s / 2:
            raise ValueError(
                f"position_bandwidth_rad_s {slow:g} is more than half of attitude_bandwidth_rad_s "
                f"{self.attitude_bandwidth_rad_s:g}: such a loop does not hold"
            )
        if min(self.room_m) <= 0:
            raise ValueError(f"wall_margin_m {self.wall_margin_m:g} leaves no room to fly in")
        return self

    @property
    def room_m(self) -> tuple[float, float, float]:
        """Largest excursion from the middle of the volume along x, y and height."""
        m = self.wall_margin_m
        sizes = [(self.x_m[1] - self.x_m[0]) / 2 - m, (self.y_m[1] - self.y_m[0]) / 2 - m]
        return (*sizes, (self.height_m[1] - m - self.height_m[0]) / 2)

    @property
    def middle_m(self) -> tuple[float, float, float]:
        """Middle of the volume: north, east of the start, and height."""
        top = self.height_m[1] - self.wall_margin_m
        return (sum(self.x_m) / 2, sum(self.y_m) / 2, (self.height_m[0] + top) / 2)


class SessionLimits(KnownKeys, frozen=True, allow_inf_nan=False):
    """Limits of a session on a stand or bench."""

    duration_s: float = Field(600.0, ge=30, le=14400)
    """Of all steps together."""
    load_share: float = Field(1.0, gt=0, le=1.5)
    """Largest load of a bench, or speed of a stand's rotors, over the largest of the set."""
    wait_s: float = Field(60.0, ge=5, le=3600)
    """How long a load is held, or its absence."""
    tilt_deg: float = Field(15.0, ge=0, le=60)
    """To which a stand's mount can be tilted; 0 where it cannot."""
    target_sigma: float = Field(6.0, gt=0, le=100)
    """Separation, in standard errors, at which a question counts as settled."""

    _numbers = field_validator("*", mode="before")(_number)


def read_limits(path: Path | None, kind: type[_Kind] = Limits) -> _Kind:
    """Limits of a flight, or of another `kind`, from a file; the usual ones without any.

    Raises InputError: the file is not there, is no YAML, or states something that cannot be; one sentence.
    """
    if path is None:
        return kind()
    such = "speed_m_s: 3" if kind is Limits else "duration_s: 600"
    try:
        content = with_exponents(read_yaml(path))
    except InputError as error:
        raise InputError(f"{error}; expected lines such as {such}") from None
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            known = ", ".join(kind.model_fields)
            raise InputError(f"{path}: {name} is no limit; known are {known}{hint(name, kind.model_fields)}") from None
        said = first["msg"].removeprefix("Value error, ")
        said = said[0].lower() + said[1:]
        raise InputError(f"{path}: {name + ': ' if name else ''}{said}") from None
