"""A campaign's plan: what is recorded, in which order, how often; and what of it is done.

What is done is read from the recordings themselves, so a campaign goes on after anything: a step is done when one of
its attempts (`name`, `name.2`, `name.3`, …) has ended `finished` and its log is as it was recorded.
"""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, model_validator

from rotorid.acquire.recorder import NAME
from rotorid.errors import InputError
from rotorid.io.logs import LogError, read_log
from rotorid.io.models import KnownKeys, read_model
from rotorid.io.rawlog import NotALog
from rotorid.io.session import Ended, SessionError, Setup, read_session
from rotorid.io.text.wording import explain, hint
from rotorid.io.wire import INSTRUMENTS

_Kind = Literal["stream", "calibrate", "static", "dynamic", "thrust", "torque", "wrench", "experiment", "tensile"]
_NEEDS: dict[str, tuple[str, ...]] = {
    "calibrate": ("bench",),
    "static": ("bench",),
    "dynamic": ("bench",),
    "thrust": ("rotor",),
    "torque": ("rotor", "wrench"),
    "wrench": ("wrench",),
    "experiment": ("quadrotor", "wrench"),
    "tensile": ("tensile",),
}

_SETTINGS: dict[str, tuple[str, ...]] = {
    "stream": ("samples", "interval_s"),
    "calibrate": ("samples",),
    "static": ("samples", "axis", "load_gf"),
    "dynamic": ("samples", "axis", "load_gf"),
    "thrust": ("throttle", "rest_s", "hold_s"),
    "torque": ("throttle", "rest_s", "hold_s"),
    "wrench": ("interval_s", "offset", "samples"),
    "experiment": ("experiment",),
    "tensile": (),
}
"""What the procedures read, except `tolerance` and `wait_s`."""


class PlanError(InputError):
    """The plan is not what it should be; the sentence names file and place."""


class Checks(KnownKeys):
    """What is looked at before the first step. Keys of the dictionaries are columns."""

    disk_mb: float = 100
    samples: int = 50
    noise: dict[str, float] = {}  # largest standard deviation at rest, in the column's unit
    zero: dict[str, float] = {}  # largest mean at rest, either sign: the tare
    clock_s: float = 5  # the newest recording in the folder may not be further in the future


class Group(KnownKeys):
    """Steps of one kind: all combinations of `over`, each `repeats` times."""

    name: str  # of the recordings; {key} stands for a value of `over`, {repeat} for the repeat
    do: _Kind
    instrument: str | None = None  # of `stream`; of bench tests: bench or jr3
    over: dict[str, list[Any]] = {}
    repeats: int = Field(default=1, ge=1)
    order: Literal["as written", "random"] = "as written"
    ask: str = ""  # what the person has to do first
    setup: dict[str, Any] = {}
    settings: dict[str, Any] = {}  # of the procedure: samples, throttle, hold_s, number, …


class CampaignPlan(KnownKeys):
    """A campaign."""

    name: str
    out: Path
    ports: dict[str, str]  # instrument: serial port, best by its stable name in /dev/serial/by-id
    operator: str | None = None
    seed: int = 1  # of the random order
    checks: Checks = Checks()
    limits: dict[str, tuple[float, float]] = {}  # column: lowest and highest; beyond, everything stops
    steps: list[Group]

    @model_validator(mode="after")
    def _fits(self) -> CampaignPlan:
        known = [column for instrument in INSTRUMENTS.values() for column in instrument.columns]
        for instrument in self.ports:
            if instrument not in INSTRUMENTS:
                raise ValueError(f"ports: there is no instrument {instrument!r}; there are {', '.join(INSTRUMENTS)}")
        for column in [*self.limits, *self.checks.noise, *self.checks.zero]:
            if column not in known:
                raise ValueError(f"limits and checks are by column of an instrument, and {column!r} is none")
        return self


@dataclass(frozen=True)
class Step:
    """One recording of the plan."""

    number: int
    name: str
    group: Group
    values: dict[str, Any]  # of `over`, and `repeat`
    instruments: tuple[str, ...]

    @property
    def ask(self) -> str:
        return self.group.ask.format(**self.values)

    def setup(self, operator: str | None) -> Setup:
        """What the metadata say: the group's setup, the step's values where they are keys of it."""
        kind = {"calibrate": "calibration", "stream": "free", "wrench": "free", "experiment": "dynamics"}
        own = {key: value for key, value in self.values.items() if key in Setup.model_fields}
        return Setup.model_validate(
            {"kind": kind.get(self.group.do, self.group.do), "operator": operator, **self.group.setup, **own}
        )

    def setting(self, name: str, default: Any = None) -> Any:
        """A setting of the procedure: the step's own value, else the group's."""
        return self.values.get(name, self.group.settings.get(name, default))


def read_plan(path: Path) -> CampaignPlan:
    """Read and validate. Raises PlanError naming the file and the first thing that is wrong."""
    return read_model(path, CampaignPlan, PlanError)


def steps_of(plan: CampaignPlan) -> list[Step]:
    """All steps in the order in which they are recorded; the same plan gives the same order each time.

    Raises PlanError for names that are none or not each step's own, and for instruments without a port.
    """
    steps: list[Step] = []
    for place, group in enumerate(plan.steps):
        combinations = [
            dict(zip(group.over, values, strict=True)) | {"repeat": repeat}
            for repeat in range(1, group.repeats + 1)
            for values in itertools.product(*group.over.values())
        ]
        if group.order == "random":
            random.Random(f"{plan.seed} {place}").shuffle(combinations)
        for values in combinations:
            try:
                name = group.name.format(**values)
                group.ask.format(**values)
            except (KeyError, IndexError, ValueError, AttributeError) as error:
                raise PlanError(
                    f"steps.{place}: {group.name!r} or its `ask` uses {error}, which is not in `over`"
                ) from error
            step = Step(len(steps) + 1, name, group, values, _instruments(plan, place, group))
            _check_step(step, place, plan.operator)
            steps.append(step)
    names = [step.name for step in steps]
    for name in names:
        if not NAME.fullmatch(name):
            raise PlanError(f"a recording cannot be called {name!r}: letters, digits, '.', '_', '+' and '-' only")
        if names.count(name) > 1:
            raise PlanError(f"two steps are called {name!r}; put {{repeat}} or a value of `over` into the name")
    return steps


def _check_step(step: Step, place: int, operator: str | None) -> None:
    """PlanError where a setup does not fit, or where a setting or a value of `over` is one that nothing reads."""
    group, known = step.group, (*_SETTINGS[step.group.do], "tolerance", "wait_s")
    try:
        step.setup(operator)
    except ValidationError as error:
        raise PlanError(f"steps.{place}: setup.{explain(error, Setup)}") from None
    for name in group.settings:
        if name not in known:
            raise PlanError(f"steps.{place}: settings.{name}: {group.do} has no such setting{hint(name, known)}")
    for name in group.over:
        if name not in known and name not in Setup.model_fields and f"{{{name}}}" not in group.name + group.ask:
            raise PlanError(f"steps.{place}: over.{name}: nothing reads it{hint(name, [*known, *Setup.model_fields])}")


def _instruments(plan: CampaignPlan, place: int, group: Group) -> tuple[str, ...]:
    needed = _NEEDS.get(group.do, ())
    if group.instrument is not None and len(needed) < 2:
        needed = (group.instrument,)
    if not needed:
        raise PlanError(f"steps.{place}: `do: stream` needs an `instrument`")
    for instrument in needed:
        if instrument not in plan.ports:
            raise PlanError(f"steps.{place}: {group.do} needs a {instrument}, and `ports` has none")
    return needed


def attempts(plan: CampaignPlan, step: Step) -> list[str]:
    """Names of the step's attempts that have left anything in the folder, oldest first."""
    found = []
    for number in itertools.count(1):
        name = step.name if number == 1 else f"{step.name}.{number}"
        files = [plan.out / f"{stem}{end}" for stem in stems(step, name) for end in (".yaml", ".rlog", ".rlog.gz")]
        if not any(path.exists() for path in files):
            return found
        found.append(name)


def next_attempt(plan: CampaignPlan, step: Step) -> str:
    """The name of the recording that would be made now."""
    number = len(attempts(plan, step)) + 1
    return step.name if number == 1 else f"{step.name}.{number}"


def is_done(plan: CampaignPlan, step: Step) -> bool:
    """Whether one attempt has finished and its logs are as they were recorded."""
    return any(all(_whole(plan.out, stem) for stem in stems(step, name)) for name in attempts(plan, step))


def stems(step: Step, name: str) -> list[str]:
    """File names, without their ends, of an attempt: one for each instrument."""
    return [name] if len(step.instruments) == 1 else [f"{name}-{instrument}" for instrument in step.instruments]


def _whole(folder: Path, stem: str) -> bool:
    try:
        session = read_session(folder / f"{stem}.yaml")
        if session.ended != Ended.FINISHED:
            return False
        log = read_log(folder / session.log)
    except (SessionError, LogError, NotALog, OSError):
        return False
    return not log.faults and log.cut_at is None
