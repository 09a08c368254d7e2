"""The configuration: one typed model of `config.yaml`, checked before the first job.

Every value is written out in `config.yaml`; the model holds no defaults, so what the file says is what runs.
A stage that needs settings adds one class here and one field to `Config`; the JSON schema in
`workflow/schemas/config.schema.json` is generated from it (`python -m rotorid_lab.config --write-schema`).
"""

from __future__ import annotations

import copy
import json
import re
import sys
import unicodedata
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from rotorid.errors import InputError
from rotorid.io.text.wording import LONGEST, explained
from rotorid.mismatch.decide.rules import RULES

READING_S = 0.004
"""Time between readings, s."""
SCHEMA_PATH = Path(__file__).parents[2] / "workflow" / "schemas" / "config.schema.json"

_LONGEST_WINDOW = 301
"""Samples; the shortest recordings of a steady load have as many."""
_SMALLEST_RATE, _LARGEST_RATE = 1e-6, 10.0
_MOST_EPOCHS, _MOST_NODES, _MOST_LAYERS = 10_000_000, 1000, 10
"""Bounds of a network's training; beyond them it does not converge, or not on one computer."""
_LONGEST_TITLE = 200
"""Characters; more do not fit on a title page."""
_MOST_SETS = 10_000
"""Sets in one job: beyond that what a stopped job had done is lost for days."""
_FASTEST_ROTOR_RAD_S = 1e5
"""A small turbine's speed, which no propeller reaches."""
_SLOWEST_REAL_FLIGHT_HZ = 400.0
"""Lowest rate of the real flights that the grey box reads."""


_NARROWEST_BAND_HZ = 1.0
"""Oscillations in a narrower band have no room to differ."""
_WHOLE, _NUMBER = (
    re.compile(r"[-+]?(0|[1-9][0-9]{0,17})"),
    re.compile(r"[-+]?((0|[1-9][0-9]{0,30})(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?"),
)


class Section(BaseModel):
    """A group of keys: frozen, no key unknown, no value converted from another type."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


def _readable(text: str) -> str:
    if text.isspace():
        raise ValueError(f"found {text!r}, expected text that is not blank")
    if any(unicodedata.category(x) in ("Cc", "Zl", "Zp") for x in text):
        raise ValueError(f"found {_quoted(text)}, expected one line without control characters")
    return text


def _short(text: str) -> str:
    if len(text) > _LONGEST_TITLE:
        raise ValueError(f"found {_quoted(text)}, expected at most {_LONGEST_TITLE} characters, not {len(text)}")
    return text


def _quoted(text: str) -> str:
    return repr(text if len(text) <= LONGEST else text[: LONGEST - 3] + "...")


_Text = Annotated[str, Field(min_length=1), AfterValidator(_readable)]
_Title = Annotated[_Text, AfterValidator(_short)]


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= limits[0] < limits[1]:
        raise ValueError(f"found {list(limits)}, expected [low, high] with 0 <= low < high")
    return limits


_Limits = Annotated[tuple[float, float], AfterValidator(_rising)]
_Counts = Annotated[tuple[int, int], AfterValidator(_rising)]


def _odd(window: int) -> int:
    if window % 2 == 0:
        raise ValueError(f"found {window}, expected an odd number: as many samples before the middle one as after it")
    return window


_SHORT_HASH = re.compile(r"(?=.*[a-f])[0-9a-f]{8}")
"""First digits of a commit's hash, with a letter among them: a day without hyphens is none."""


def _release(text: str) -> str:
    try:
        known = text == "" or bool(_SHORT_HASH.fullmatch(text)) or date.fromisoformat(text).isoformat() == text
    except ValueError:
        known = False
    if not known:
        raise ValueError(
            f"found {text!r}, expected the first eight digits of a commit's hash, as 0285341c, a day of the calendar, "
            "as 2026-11-30, or an empty text"
        )
    return text


def _part_of_a_reading(step_s: float) -> float:
    every = round(READING_S / step_s)
    if every < 1 or abs(every * step_s / READING_S - 1) > 1e-6:
        raise ValueError(
            f"found {step_s:g}, expected a step of which a whole number makes up {READING_S:g} s, a reading"
        )
    return step_s


class Report(Section):
    """What the report is called and which chapters it has, in their order."""

    title: _Title = Field(description="Title on the first page [text].")
    subtitle: _Title = Field(description="Line under the title [text].")
    chapters: list[_Name] = Field(
        min_length=1,
        description="Chapters in reading order; each has notebooks/<name>.ipynb, notebooks/<name>.md and a "
        "rule chapter_<name> [names].",
    )

    @model_validator(mode="after")
    def _no_chapter_twice(self) -> Report:
        twice = {name for name in self.chapters if self.chapters.count(name) > 1}
        if twice:
            raise ValueError(f"chapters must not name a chapter twice, but {', '.join(sorted(twice))} is")
        return self


class FilterSettings(Section):
    """Filters for one instrument's readings."""

    low_pass_hz: float = Field(ge=0.01, lt=25, description="Cutoff of the thesis's first-order low-pass [Hz].")
    zero_phase_hz: float = Field(ge=0.01, lt=25, description="Cutoff of the zero-phase low-pass [Hz].")
    spike_window: Annotated[int, AfterValidator(_odd)] = Field(
        ge=3, le=_LONGEST_WINDOW, description="Samples around one that its median is taken of [1]."
    )
    spike_threshold: float = Field(
        ge=2, le=1000, description="Robust standard deviations beyond which a sample is a spike [1]."
    )
    steady_window: int = Field(ge=2, le=_LONGEST_WINDOW, description="Samples that have to be steady [1].")


class CellFilterSettings(FilterSettings):
    """The same for readings of load cells, of which 1 kgf is some 0.15 mV."""

    steady_tolerance: float = Field(
        ge=1e-10, le=1e-5, description="Span of the low-passed signal that counts as steady [V]."
    )


class ReferenceFilterSettings(FilterSettings):
    """The same for readings of the reference sensor."""

    steady_tolerance: float = Field(
        ge=1e-3, le=10, description="Span of the low-passed signal that counts as steady [N]."
    )


class Filters(Section):
    """Filters of the bench's instruments."""

    bench: CellFilterSettings = Field(description="Load cells of the bench.")
    jr3: ReferenceFilterSettings = Field(description="Reference sensor of the bench's tests.")


class BenchSettings(Section):
    """The load-cell bench."""

    noise_n: float = Field(ge=0, le=10, description="Believed one-sigma noise of a sample of the bench's force [N].")
    matrix_largest_n: float = Field(
        ge=0.1,
        le=1000,
        description="Largest load that the calibration matrix is fitted to: beyond it cells leave their range [N].",
    )
    reference_noise_n: float = Field(ge=0, le=10, description="Believed one-sigma noise of the reference sensor [N].")


class FemSettings(Section):
    """Finite elements of the load-cell bench."""

    mesh: Literal["coarse", "full"] = Field(
        description="How fine the meshes are: coarse takes some 20 s, full some minutes [coarse or full]."
    )
    draws: int = Field(ge=0, le=10_000, description="Benches with all assumed sizes drawn at once [1].")
    seed: int = Field(ge=0, description="Seed of these draws [1].")


class StandSettings(Section):
    """The vehicle on the six-axis sensor."""

    clock_error: float = Field(ge=1e-7, lt=0.1, description="Largest relative error of a device's clock [1].")
    force_noise_n: float = Field(ge=0, le=10, description="Believed one-sigma noise of the sensor's force [N].")
    moment_noise_n_m: float = Field(ge=0, le=1, description="Believed one-sigma noise of the sensor's moment [N m].")
    thrust_noise_n: float = Field(ge=0, le=10, description="Believed one-sigma noise of the thrust tester [N].")
    speed_noise_relative: float = Field(
        ge=0, lt=0.2, description="One-sigma noise of the tester's rotor speed, as a share of it [1]."
    )


class RotorSettings(Section):
    """Thrust coefficients from stand runs."""

    speed_noise_relative: float = Field(
        ge=0, lt=0.2, description="One-sigma noise of a rotor-speed reading, as a share of it [1]."
    )
    outlying_above: float = Field(
        ge=1, le=100, description="Modified z-score beyond which a motor is called outlying [1]."
    )


class Residuals(Section):
    """Rigid-body residuals of the NeuroBEM flights."""

    cutoff_hz: float = Field(ge=0.1, lt=190, description="Low-pass of both sides of the residual [Hz].")
    airspeed_bin_m_s: float = Field(ge=0.01, le=100, description="Width of a bin of airspeed [m/s].")
    block_s: float = Field(ge=0.1, le=60, description="Length of the blocks that the bootstrap draws [s].")
    seed: int = Field(ge=0, description="Seed of the bootstrap [1].")


class Simulation(Section):
    """The simulated vehicle's readings and disturbances."""

    seed: int = Field(ge=0, description="Seed of disturbance and noise [1].")
    duration_s: float = Field(
        gt=1, le=3600, description="Length of the attitude-control simulation, whose errors count from 1 s on [s]."
    )
    step_s: float = Field(ge=1e-5, le=0.01, description="Step of the integrator and the controller [s].")
    moment_n_m: float = Field(ge=0, le=1, description="One-sigma moment on the airframe about each axis [N m].")
    force_n: float = Field(ge=0, le=10, description="One-sigma force on the airframe along each axis [N].")
    correlation_s: float = Field(ge=0, le=3600, description="Correlation time of moment and force [s].")
    rate_noise_rad_s: float = Field(ge=1e-6, le=10, description="One-sigma noise of a body rate's reading [rad/s].")
    acceleration_noise_rad_s2: float = Field(
        ge=0, le=1000, description="One-sigma noise of an angular acceleration's reading [rad/s2]."
    )
    speed_noise_relative: float = Field(
        ge=0, lt=0.2, description="One-sigma noise of a rotor-speed reading, as a share of it [1]."
    )


class GreyBox(Section):
    """Parameters of the equations of motion from data."""

    seed: int = Field(ge=0, description="Seed of weights, search and draws [1].")
    rotor_rate: float = Field(
        ge=_SMALLEST_RATE, le=_LARGEST_RATE, description="Learning rate of the rotor networks [1]."
    )
    rotor_epochs: int = Field(ge=1, le=_MOST_EPOCHS, description="Epochs of the rotor networks [1].")
    rotor_hidden: int = Field(ge=1, le=_MOST_NODES, description="Hidden nodes of the rotor networks [1].")
    inertia_rate: float = Field(
        ge=_SMALLEST_RATE, le=_LARGEST_RATE, description="Learning rate of the inertia network [1]."
    )
    inertia_epochs: int = Field(ge=1, le=_MOST_EPOCHS, description="Epochs of the inertia network [1].")
    inertia_every: int = Field(ge=1, le=100, description="Every how many samples the inertia network is shown [1].")
    speed_limits_rad_s: _Limits = Field(
        strict=False, description="Lowest and highest rotor speed that the motors can hold [rad/s]."
    )
    design_limits_rad_s: _Limits = Field(
        strict=False, description="Rotor speeds that the excitation may use, room left for control [rad/s]."
    )
    design_tilt_deg: float = Field(ge=0.1, lt=60, description="Largest tilt that the excitation may cause [deg].")
    design_harmonics: _Counts = Field(
        strict=False, description="Lowest and highest harmonic of the excitation's period [1]."
    )
    design_period_s: float = Field(gt=0, le=3600, description="Period of the excitation [s].")
    design_candidates: int = Field(ge=4, le=1_000_000, description="Excitations tried by the search [1].")
    flight_s: float = Field(gt=0, le=3600, description="Length of the identification flight [s].")
    flight_step_s: Annotated[float, AfterValidator(_part_of_a_reading)] = Field(
        ge=1e-5, description="Time for which that flight's motor commands are held; whole ones make up a reading [s]."
    )
    motor_time_s: float = Field(ge=0, le=1, description="Time constant of the motors on that flight [s].")
    draws: int = Field(
        ge=1, le=1000, description="Identification flights, each with its own disturbance and noise [1]."
    )
    band_hz: _Limits = Field(strict=False, description="Band in which real flights determine their inertia [Hz].")
    block_s: float = Field(ge=0.1, le=60, description="Blocks of flight that the bootstrap draws [s].")

    @model_validator(mode="after")
    def _can_be_flown(self) -> GreyBox:
        (low, high), (slowest, fastest) = self.speed_limits_rad_s, self.design_limits_rad_s
        if high > _FASTEST_ROTOR_RAD_S:
            raise ValueError(f"speed_limits_rad_s reaches {high:g}, expected at most {_FASTEST_ROTOR_RAD_S:g}")
        if not low <= slowest < fastest <= high:
            raise ValueError(
                f"design_limits_rad_s is {[slowest, fastest]}, expected to lie within speed_limits_rad_s, {[low, high]}"
            )
        if fastest < 1.05 * slowest:
            raise ValueError(
                f"design_limits_rad_s is {[slowest, fastest]}, expected the higher to be 5 % above the lower or more"
            )
        first, last = self.design_harmonics
        # The three axes share the harmonics, and the harmonic 0 is no oscillation.
        if first < 1 or last - first < 2:
            raise ValueError(
                f"design_harmonics is {[first, last]}, expected [low, high] with low of 1 or more and three harmonics"
            )
        if last / self.design_period_s >= 0.5 / READING_S:
            raise ValueError(
                f"design_harmonics reaches {last / self.design_period_s:g} Hz with a design_period_s of "
                f"{self.design_period_s:g} s, expected less than {0.5 / READING_S:g} Hz, half the rate of the readings"
            )
        if self.flight_s < self.design_period_s:
            raise ValueError(
                f"flight_s is {self.flight_s:g}, expected at least design_period_s, {self.design_period_s:g}"
            )
        if not 0 < self.band_hz[0] < self.band_hz[1] < _SLOWEST_REAL_FLIGHT_HZ / 2:
            raise ValueError(
                f"band_hz is {list(self.band_hz)}, expected to lie within 0 and "
                f"{_SLOWEST_REAL_FLIGHT_HZ / 2:g} Hz, both not in it"
            )
        if self.band_hz[1] - self.band_hz[0] < _NARROWEST_BAND_HZ:
            raise ValueError(
                f"band_hz is {list(self.band_hz)}, expected {_NARROWEST_BAND_HZ:g} Hz between them or more"
            )
        return self


class BlackBox(Section):
    """The stand's wrench without knowledge of the vehicle."""

    seed: int = Field(ge=0, description="Seed of weights, folds and held-out samples [1].")
    epochs: int = Field(ge=1, le=_MOST_EPOCHS, description="Epochs of the network [1].")
    rate: float = Field(ge=_SMALLEST_RATE, le=_LARGEST_RATE, description="Learning rate of the network [1].")
    hidden: tuple[Annotated[int, Field(ge=1, le=_MOST_NODES)], ...] = Field(
        min_length=1, max_length=_MOST_LAYERS, strict=False, description="Nodes of each hidden layer [1]."
    )
    held_out_samples: int = Field(
        ge=2, le=10_000, description="Samples held out at random, as the thesis does; of one alone nothing spreads [1]."
    )
    folds: int = Field(ge=2, le=1000, description="Parts into which whole experiments are held out [1].")
    share: float = Field(ge=0.5, lt=1, description="Share of new samples that an interval is to cover [1].")


class Proof(Section):
    """The proof on concealed recordings."""

    seeds: dict[str, Annotated[int, Field(ge=0)]] = Field(
        description="Repetitions taken of each family of cases in proof/rotorid_proof/concealed/cases.tsv; 0 leaves it "
        "out [1]."
    )
    release: Annotated[str, AfterValidator(_release)] = Field(
        description="Release proof: commit (or date) whose cases, never looked at, are drawn; empty for none [name]."
    )
    released: dict[str, Annotated[int, Field(ge=0)]] = Field(
        description="Repetitions taken of each family of drawn cases in a release proof [1]."
    )
    cases: list[_Text] = Field(min_length=1, description="Shell patterns on case names; one must fit [names].")
    batch: int = Field(ge=1, le=_MOST_SETS, description="Cases that one job treats [1].")
    delivered: int = Field(
        ge=1, description="Concealed cases, evenly over the list, whose delivered vehicle is put to the test [1]."
    )
    peers: bool = Field(description="Whether other methods are asked about the same recordings [true, false].")
    real: bool = Field(description="Whether the public real recordings are studied [true, false].")
    tables: _Text = Field(
        description="Folder whose tables the report's chapter shows: docs/proof holds those of the last full proof, "
        "results/proof makes the proof part of the report [path]."
    )


class Plantings(Section):
    """Something exact put into real flights."""

    cases: list[_Text] = Field(
        min_length=1, description="Shell patterns on the names in workflow/plantings.tsv; one must fit [names]."
    )
    batch: int = Field(ge=1, le=_MOST_SETS, description="Sets that one job judges [1].")
    kept: _Text = Field(
        description="Table whose rows are kept next to new ones, marked where older code judged them; a file that does "
        "not exist keeps none [path]."
    )


class Decisions(Section):
    """Evidence of many sets, on which decisions are scored."""

    seeds: dict[str, Annotated[int, Field(ge=0)]] = Field(
        description="Repetitions kept of each family of cases in proof/rotorid_proof/concealed/cases.tsv; 0 leaves it "
        "out [1]."
    )
    plantings: list[_Text] = Field(
        description="Shell patterns on the names in workflow/plantings.tsv of those kept [names]."
    )
    studies: bool = Field(description="Whether the studies of real recordings are kept, too [true, false].")


class Rules(Section):
    """Rules of the mismatch stage (`rotorid.mismatch.decide.rules`)."""

    off: list[_Text] = Field(description="Rules that are left out of every verdict [names].")

    @model_validator(mode="before")
    @classmethod
    def _off_is_a_name(cls, values):
        # YAML reads the bare word off as false.
        if isinstance(values, dict) and False in values:
            return {"off" if key is False else key: value for key, value in values.items()}
        return values

    @field_validator("off")
    @classmethod
    def _known(cls, names):
        if unknown := [name for name in names if name not in RULES]:
            raise ValueError(f"no rule is named {', '.join(unknown)}; the rules are {', '.join(RULES)}")
        return names


class Ablation(Section):
    """What each rule of the mismatch stage is worth."""

    cases: list[_Text] = Field(
        min_length=1,
        description="Shell patterns on the cases of proof/rotorid_proof/concealed/cases.tsv; one must fit [names].",
    )
    most: int = Field(ge=1, description="Sets that a rule is judged without, of those in which it fired [1].")


class Fleet(Section):
    """Every recording set of a folder, judged together."""

    batch: int = Field(ge=1, le=_MOST_SETS, description="Sets that one job judges [1].")
    history: bool = Field(description="Whether each vehicle's later sets are compared with its first [true, false].")
    good: int = Field(ge=1, le=_MOST_SETS, description="First sets of each vehicle that count as good [1].")


class Config(Section):
    """The whole of `config.yaml`."""

    recordings: _Text = Field(description="Folder that holds the recording sets, one folder each [path].")
    raw: _Text = Field(description="Folder of the raw logs, with sessions.tsv [path].")
    filter: Filters = Field(description="Filters of the bench's instruments.")
    bench: BenchSettings = Field(description="The load-cell bench.")
    fem: FemSettings = Field(description="Finite elements of the load-cell bench.")
    stand: StandSettings = Field(description="The vehicle on the six-axis sensor.")
    rotor: RotorSettings = Field(description="Thrust coefficients from stand runs.")
    residuals: Residuals = Field(description="Rigid-body residuals of the NeuroBEM flights.")
    simulation: Simulation = Field(description="The simulated vehicle's readings and disturbances.")
    grey_box: GreyBox = Field(description="Parameters of the equations of motion from data.")
    black_box: BlackBox = Field(description="The stand's wrench without knowledge of the vehicle.")
    proof: Proof = Field(description="The proof on concealed recordings.")
    plantings: Plantings = Field(description="Plantings in real flights.")
    decisions: Decisions = Field(description="The bench for decisions.")
    rules: Rules = Field(description="Rules of the mismatch stage.")
    ablation: Ablation = Field(description="What each of these rules is worth.")
    fleet: Fleet = Field(description="Every recording set of a folder, judged together.")
    report: Report = Field(description="The report.")


def check(values: Mapping[str, Any], source: str = "config.yaml") -> Config:
    """Turn parsed YAML into a `Config`.

    Parameters
    ----------
    values
        The parsed file, as Snakemake holds it.
    source
        Name of the file for the message.

    Raises
    ------
    InputError
        One sentence for each unknown key, missing key, wrong type or impossible value.
    """
    try:
        return Config.model_validate(dict(values))
    except ValidationError as error:
        raise InputError("\n".join(f"{source}: {clause}" for clause in explained(error, Config))) from None


def from_command_line(values: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The values, with numbers, true and false where `given` has them as text.

    Snakemake reads all that stands in braces after `--config` as text: `fleet={batch: 3}` arrives as '3'. Only text at
    a place where the model wants another type is read.

    Parameters
    ----------
    values
        The whole configuration, as Snakemake holds it.
    given
        What of it stands on the command line.
    """
    try:
        Config.model_validate(dict(values))
    except ValidationError as error:
        read = copy.deepcopy(dict(values))
        for entry in error.errors():
            if isinstance(entry["input"], str) and _at(given, entry["loc"]) == entry["input"]:
                _at(read, entry["loc"][:-1])[entry["loc"][-1]] = _as_number(entry["input"], entry["type"])
        return read
    return dict(values)


def _at(values: Any, location: tuple[str | int, ...]) -> Any:
    """What stands at a location of a pydantic error; None where nothing does."""
    for part in location:
        if not (isinstance(values, dict) and part in values or isinstance(values, list) and part in range(len(values))):
            return None
        values = values[part]
    return values


def _as_number(text: str, wanted: str) -> str | int | float | bool:
    """Text as a number of the type that a pydantic error `wanted`, true or false; as it is where it is none."""
    if wanted.startswith("bool"):
        return {"true": True, "false": False}.get(text.lower(), text)
    if wanted.startswith(("int", "float")) and _WHOLE.fullmatch(text):
        return int(text)
    return float(text) if wanted.startswith(("int", "float")) and _NUMBER.fullmatch(text) else text


def schema_text() -> str:
    """The JSON schema of `config.yaml` as text."""
    return json.dumps(Config.model_json_schema(), indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    if "--write-schema" in sys.argv:
        SCHEMA_PATH.write_text(schema_text())
    else:
        print(schema_text(), end="")
