"""What a flight may ask of a vehicle and its room, a session of a stand or bench, as its user states it."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml, with_exponents
from rotorid.io.text.wording import hint

_Range = tuple[float, float]
T = TypeVar("T", bound=BaseModel)


def _number(value: object) -> object:
    """The value as it is; YAML's yes and no are no numbers, and text is none."""
    for part in value if isinstance(value, list) else [value]:
        if isinstance(part, bool):
            raise ValueError("found yes or no, expected a number")
        if isinstance(part, str):
            raise ValueError(f"found {part!r}, expected a number")
    return value


class Limits(BaseModel):
    """Limits of a flight; x and y are from the place of the start, heights above the ground, all in SI but degrees."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

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


class SessionLimits(BaseModel):
    """Limits of a session on a stand or bench."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

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


def read_limits(path: Path | None, kind: type[T] = Limits) -> T:
    """Limits of a flight, or of another `kind`, from a file; the usual ones without any.

    Raises
    ------
    InputError
        The file is not there, is no YAML, or states something that cannot be; one sentence.
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
