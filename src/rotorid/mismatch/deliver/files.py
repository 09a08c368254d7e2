"""The three files that a finding may belong to: the vehicle, the conditions of a flight, the instruments.

Only what is established, or one member of a class, belongs anywhere. Wind, gusts and a payload for a time belong to a
run and to its instants (`conditions.yaml`), errors of sensors, clocks and stamps to the instruments
(`instruments.yaml`): a vehicle that held them would fly worse than the one believed. The vehicle's file is what the
simulator runs. All three are read back before they are delivered, and the simulation run forward uses each where it
belongs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from pydantic import Field, ValidationError

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.errors import InputError
from rotorid.io.models import KnownKeys
from rotorid.io.text.files import read_yaml
from rotorid.io.text.writing import rounded
from rotorid.mismatch.decide.findings import Analysis, Finding, RunWind, one_per_class
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.recordings import Vehicle

_Place = Literal["vehicle", "conditions", "instruments"]
CONDITIONS, INSTRUMENTS = "conditions.yaml", "instruments.yaml"
_ABOUT = {
    CONDITIONS: "Found in these recordings, no property of the vehicle: when the air moved, when a payload was aboard.",
    INSTRUMENTS: "Errors of sensors, clocks and stamps found in these recordings; no property of the vehicle.",
}


class Entry(KnownKeys, frozen=True):
    """One finding as a file has it."""

    id: str
    form: str = ""
    """Of the catalogue; empty where the parameters themselves describe it."""
    equation: str = ""
    sentence: str = ""
    one_of: tuple[str, ...] = ()
    """Of a class that the data leave open: its members, the id that stands for them first."""
    parameters: dict[str, float] = Field(default_factory=dict)
    """Symbol to value, SI units as the catalogue has them."""
    interval_95: dict[str, tuple[float, float]] = Field(default_factory=dict)


class Air(KnownKeys, frozen=True):
    """Wind of a run, straight lines between instants; outside of the condition's own the air is still."""

    time_s: tuple[float, ...]
    north_m_s: tuple[float, ...]
    east_m_s: tuple[float, ...]


class Condition(Entry):
    """A finding that holds in one run, from an instant to another."""

    run: str
    start_s: float | None = None
    """None from the run's beginning."""
    stop_s: float | None = None
    air: Air | None = None


class Conditions(KnownKeys, frozen=True):
    """The whole of `conditions.yaml`."""

    set: str
    conditions: tuple[Condition, ...] = ()

    def wind(self, run: str, time_s: np.ndarray) -> np.ndarray | None:
        """Velocity of the air over ground at instants (n,) of a run, (n, 3), m/s, world axes; None for still air."""
        blowing = [c for c in self.conditions if c.run == run and c.air is not None]
        if not blowing:
            return None
        wind = np.zeros((len(time_s), 3))
        for condition in blowing:
            air = condition.air
            for axis, values in enumerate((air.north_m_s, air.east_m_s)):
                before = values[0] if condition.start_s is None else 0.0
                after = values[-1] if condition.stop_s is None else 0.0
                wind[:, axis] += np.interp(time_s, air.time_s, values, left=before, right=after)
        return wind

    def present(self, condition: Condition, run: str, time_s: np.ndarray) -> np.ndarray:
        """Whether a condition holds at instants (n,) of a run, (n,) 0 or 1."""
        start = -np.inf if condition.start_s is None else condition.start_s
        stop = np.inf if condition.stop_s is None else condition.stop_s
        return ((condition.run == run) & (time_s >= start) & (time_s <= stop)).astype(float)


class Window(KnownKeys, frozen=True):
    """A part of a run, s on its clock."""

    run: str
    start_s: float | None = None
    stop_s: float | None = None


class Fault(Entry):
    """A finding about a sensor, a clock or a rig."""

    windows: tuple[Window, ...] = ()
    """When it was so; empty for always."""


class Instruments(KnownKeys, frozen=True):
    """The whole of `instruments.yaml`."""

    set: str
    instruments: tuple[Fault, ...] = ()


def conditions_of(analysis: Analysis) -> Conditions:
    """What an analysis found of the conditions of each run, to the digits that its file states."""
    found: list[Condition] = []
    for finding in delivered(analysis, "conditions"):
        own, kind = _entry(finding).model_dump(), catalogue()[finding.id].air_moves
        if kind:
            found += [Condition(**own, **_blowing(b)) for b in analysis.winds if b.kind == kind]
        else:
            found += [Condition(**own, **_within(*window)) for window in finding.windows]
    return _as_written(Conditions(set=analysis.recordings.name, conditions=tuple(found)))


def instruments_of(analysis: Analysis) -> Instruments:
    """What an analysis found of the instruments, to the digits that its file states."""
    entries = tuple(
        Fault(**_entry(f).model_dump(), windows=tuple(Window(**_within(*w)) for w in f.windows))
        for f in delivered(analysis, "instruments")
    )
    return _as_written(Instruments(set=analysis.recordings.name, instruments=entries))


def _as_written(content: Conditions | Instruments):
    """Content with its numbers as its file will state them: what is judged is what is read back."""
    return type(content).model_validate(rounded(content.model_dump(mode="json")))


def _within(run: str, start_s: float, stop_s: float) -> dict[str, str | float | None]:
    """Keys of a window; an end that is not finite is the run's."""
    start, stop = (float(x) if np.isfinite(x) else None for x in (start_s, stop_s))
    return {"run": run, "start_s": start, "stop_s": stop}


def _blowing(wind: RunWind) -> dict:
    """Keys of a condition in which the air moves."""
    air = Air(time_s=tuple(wind.time_s), north_m_s=tuple(wind.wind_m_s[:, 0]), east_m_s=tuple(wind.wind_m_s[:, 1]))
    ends = (-np.inf, np.inf) if wind.kind == "all the time" else wind.time_s[[0, -1]]
    return {**_within(wind.run, *ends), "air": air}


def _entry(finding: Finding) -> Entry:
    form = form_of(finding)
    # Moving air is stated by its velocity; the force that stands for it at one drag is another parameter.
    formless = form is None or bool(catalogue()[finding.id].air_moves)
    symbols = finding.parameters if formless else form.parameters
    values = [e.value for e in finding.parameters] if formless else finding.values
    others = [i for i in finding.alternatives if i != finding.id]
    return Entry(
        id=finding.id,
        form="" if formless else form.name,
        equation=finding.equation or (form.equation if form else ""),
        sentence=finding.sentence,
        one_of=(finding.id, *others) if finding.status == "ambiguous" and others else (),
        parameters={p.symbol: float(v) for p, v in zip(symbols, values, strict=True)},
        interval_95={e.symbol: (float(e.low), float(e.high)) for e in finding.parameters},
    )


def text_of(content: Conditions | Instruments) -> str:
    """A file's text: a line on what it is, then YAML; numbers to the digits that a verdict states."""
    name = CONDITIONS if isinstance(content, Conditions) else INSTRUMENTS
    plain = rounded(content.model_dump(mode="json", exclude_defaults=True))
    return f"# {_ABOUT[name]}\n{yaml.safe_dump(plain, sort_keys=False, allow_unicode=True)}"


def read_conditions(path: Path) -> Conditions:
    """A `conditions.yaml`; InputError names the file and what does not fit."""
    return _read(path, Conditions)


def read_instruments(path: Path) -> Instruments:
    """An `instruments.yaml`; InputError names the file and what does not fit."""
    return _read(path, Instruments)


def _read(path: Path, kind):
    try:
        return kind.model_validate(read_yaml(path))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(f"{path}: {where}: {first['msg']}") from None


def empty(content: Conditions | Instruments) -> bool:
    """Whether there is nothing to write."""
    return not (content.conditions if isinstance(content, Conditions) else content.instruments)


def form_of(finding: Finding) -> Form | SpeedForm | None:
    """The form of a finding; on a stand one between command and rotor speed is known by its equation."""
    if finding.form or finding.speed_form or not finding.values or finding.id not in catalogue():
        return finding.form or finding.speed_form
    speed_forms = catalogue()[finding.id].speed_forms
    return next((f for f in speed_forms if f.equation == finding.equation), None)


def place_of(finding: Finding) -> _Place | None:
    """The file that a finding belongs to; None for a mistake in the set, which is corrected in the recordings."""
    effect = catalogue()[finding.id]
    if effect.kind == "mistake":
        return None
    if effect.air_moves:
        return "conditions"
    form = form_of(finding)
    if isinstance(form, SpeedForm):
        return "vehicle"
    if effect.kind == "sensor" or effect.of_the_rig:
        return "instruments"
    return "conditions" if finding.windows else "vehicle"  # with a payload on board for a time, say


def claimed(findings: Sequence[Finding]) -> list[Finding]:
    """Established findings, and of each class of alternatives the most significant member."""
    by_p = sorted((f for f in findings if f.status in CLAIMED), key=lambda f: (f.status != "established", f.p_value))
    kept = {id(f) for f in one_per_class(by_p)}
    return [f for f in findings if id(f) in kept]


def delivered(analysis: Analysis, place: _Place) -> list[Finding]:
    """Findings that go into one of the files, in the order of the analysis, less what the chosen vehicle lacks.

    A condition or an error of a sensor may have no form (a wind, a delay of stamps): its parameters describe it.
    """
    found = [f for f in claimed(analysis.findings) if f.delivered and place_of(f) == place]
    return [f for f in found if form_of(f) is not None] if place == "vehicle" else found


def with_effects(vehicle: Vehicle, findings: Sequence[Finding]) -> Vehicle:
    """A vehicle with an entry under `effects` for each finding that has a form."""
    return vehicle.model_copy(update={"effects": tuple(entry_of(f) for f in findings if form_of(f) is not None)})


def entry_of(finding: Finding) -> dict:
    """A finding as a vehicle file has it: id, form, parameters, and of a class the members it stands for."""
    form = form_of(finding)
    values = dict(zip((p.symbol for p in form.parameters), map(float, finding.values), strict=True))
    entry = {"id": finding.id, "form": form.name, "parameters": values}
    others = [i for i in finding.alternatives if i != finding.id]
    return {**entry, "one_of": [finding.id, *others]} if finding.status == "ambiguous" and others else entry


def improved_vehicle(analysis: Analysis) -> Vehicle:
    """The vehicle that is taken home: values re-estimated, and the effects of the vehicle that stand."""
    return with_effects(analysis.improved, delivered(analysis, "vehicle"))
