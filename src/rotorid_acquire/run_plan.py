"""A campaign's plan: what is recorded, in which order, how often, and what of it is done; recorded step after step.

Checks come first; it is the same with instruments and with emulators. What is done is read from the recordings
themselves, so a campaign goes on after anything: a step is done when one of its attempts (`name`, `name.2`, `name.3`,
…) has ended `finished` and its log is as it was recorded. The metadata of one whose recorder was killed are completed
from its log.
"""

from __future__ import annotations

import itertools
import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from rotorid.errors import InputError
from rotorid.io.models import KnownKeys, read_model
from rotorid.io.text.wording import explain, hint
from rotorid_acquire import procedures
from rotorid_acquire.io.logs import Log, read_log
from rotorid_acquire.io.rawlog import RECEIVED, read_raw
from rotorid_acquire.io.session import Counts, Ended, Setup, read_session, session_path, write_index, write_session
from rotorid_acquire.io.wire import EXPERIMENTS, INSTRUMENTS
from rotorid_acquire.procedures import programme_of, recorders_for, run_with
from rotorid_acquire.recorder import NAME, Recorder
from rotorid_acquire.transport import AcquireError

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


class _Checks(KnownKeys):
    """What is looked at before the first step. Keys of the dictionaries are columns."""

    disk_mb: float = 100
    samples: int = 50
    noise: dict[str, float] = {}  # largest standard deviation at rest, in the column's unit
    zero: dict[str, float] = {}  # largest mean at rest, either sign: the tare
    clock_s: float = 5  # the newest recording in the folder may not be further in the future


class _Group(KnownKeys):
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
    checks: _Checks = _Checks()
    limits: dict[str, tuple[float, float]] = {}  # column: lowest and highest; beyond, everything stops
    steps: list[_Group]

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
class _Step:
    """One recording of the plan."""

    number: int
    name: str
    group: _Group
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
    """Read and validate. Raises InputError naming the file and the first thing that is wrong."""
    return read_model(path, CampaignPlan)


def steps_of(plan: CampaignPlan) -> list[_Step]:
    """All steps in the order in which they are recorded; the same plan gives the same order each time.

    Raises InputError for names that are none or not each step's own, and for instruments without a port.
    """
    steps: list[_Step] = []
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
                raise InputError(
                    f"steps.{place}: {group.name!r} or its `ask` uses {error}, which is not in `over`"
                ) from error
            step = _Step(len(steps) + 1, name, group, values, _instruments(plan, place, group))
            _check_step(step, place, plan.operator)
            steps.append(step)
    names = [step.name for step in steps]
    for name in names:
        if not NAME.fullmatch(name):
            raise InputError(f"a recording cannot be called {name!r}: letters, digits, '.', '_', '+' and '-' only")
        if names.count(name) > 1:
            raise InputError(f"two steps are called {name!r}; put {{repeat}} or a value of `over` into the name")
    return steps


def _check_step(step: _Step, place: int, operator: str | None) -> None:
    """InputError where a setup does not fit, or where a setting or a value of `over` is one that nothing reads."""
    group, known = step.group, (*_SETTINGS[step.group.do], "tolerance", "wait_s")
    try:
        step.setup(operator)
    except ValidationError as error:
        raise InputError(f"steps.{place}: setup.{explain(error, Setup)}") from None
    for name in group.settings:
        if name not in known:
            raise InputError(f"steps.{place}: settings.{name}: {group.do} has no such setting{hint(name, known)}")
    for name in group.over:
        if name not in known and name not in Setup.model_fields and f"{{{name}}}" not in group.name + group.ask:
            raise InputError(f"steps.{place}: over.{name}: nothing reads it{hint(name, [*known, *Setup.model_fields])}")


def _instruments(plan: CampaignPlan, place: int, group: _Group) -> tuple[str, ...]:
    needed = _NEEDS.get(group.do, ())
    if group.instrument is not None and len(needed) < 2:
        needed = (group.instrument,)
    if not needed:
        raise InputError(f"steps.{place}: `do: stream` needs an `instrument`")
    for instrument in needed:
        if instrument not in plan.ports:
            raise InputError(f"steps.{place}: {group.do} needs a {instrument}, and `ports` has none")
    return needed


def attempts(plan: CampaignPlan, step: _Step) -> list[str]:
    """Names of the step's attempts that have left anything in the folder, oldest first."""
    found = []
    for number in itertools.count(1):
        name = _attempt(step, number)
        files = [plan.out / f"{stem}{end}" for stem in _stems(step, name) for end in (".yaml", ".rlog", ".rlog.gz")]
        if not any(path.exists() for path in files):
            return found
        found.append(name)


def _attempt(step: _Step, number: int) -> str:
    return step.name if number == 1 else f"{step.name}.{number}"


def is_done(plan: CampaignPlan, step: _Step) -> bool:
    """Whether one attempt has finished and its logs are as they were recorded."""
    return any(all(_whole(plan.out, stem) for stem in _stems(step, name)) for name in attempts(plan, step))


def _stems(step: _Step, name: str) -> list[str]:
    """File names, without their ends, of an attempt: one for each instrument."""
    return [name] if len(step.instruments) == 1 else [f"{name}-{instrument}" for instrument in step.instruments]


def _whole(folder: Path, stem: str) -> bool:
    try:
        session = read_session(folder / f"{stem}.yaml")
        if session.ended != Ended.FINISHED:
            return False
        log = read_log(folder / session.log)
    except (InputError, OSError):
        return False
    return not log.faults and log.cut_at is None


@dataclass(frozen=True)
class Desk:
    """Who sits there: how they are informed, asked and waited for."""

    say: Callable[[str], None]
    ask: Callable[[str], str]  # a question; the answer is "", or a word
    prompts: Callable[[_Step], Callable[[Recorder], procedures.Prompt]]  # how a procedure asks for a load
    watch: Callable[[list[Recorder], Callable[[], None]], None]  # run with these recorders, showing them


def check(plan: CampaignPlan, ports: dict[str, str], desk: Desk) -> list[str]:
    """Ports, identity, noise, tare, disk and clock; a sentence for each thing that is not as it should be."""
    faults = []
    plan.out.mkdir(parents=True, exist_ok=True)
    free_mb = shutil.disk_usage(plan.out).free / 1e6
    if free_mb < plan.checks.disk_mb:
        faults.append(f"{plan.out}: {free_mb:.0f} MB are free, {plan.checks.disk_mb:g} are asked for (checks.disk_mb)")
    faults += _clock(plan)
    for instrument, port in ports.items():
        name = f"check-{instrument}-{datetime.now():%Y%m%d-%H%M%S-%f}"
        try:
            (recorder,) = recorders_for({instrument: port}, plan.out / "checks", name, procedure={"name": "check"})
            run_with([recorder], lambda r: _at_rest(r, plan.checks.samples))
            faults += _rest_faults(plan, recorder)
            desk.say(
                f"check: {instrument} on {port}: {recorder.session.firmware}, {recorder.session.counts.samples} samples"
            )
        except AcquireError as error:
            faults.append(f"{instrument}: {error}")
    return faults


def _clock(plan: CampaignPlan) -> list[str]:
    latest = datetime.now().astimezone() + timedelta(seconds=plan.checks.clock_s)
    for path in plan.out.glob("*.yaml"):
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("started: "):
                try:
                    started = datetime.fromisoformat(line.removeprefix("started: ").strip("'"))
                except ValueError:  # whatever that file is, it says no time
                    break
                if started.astimezone() > latest:
                    return [f"this computer's clock is behind: {path.name} was recorded at {started}; set the clock"]
    return []


def _at_rest(recorder: Recorder, samples: int) -> None:
    """A few samples of an instrument that nobody touches; of one that moves when it streams, only who it is."""
    name = recorder.instrument.name
    if name in ("quadrotor", "tensile"):
        return
    if name == "wrench":
        procedures.measure_wrench(recorder, 0.01, samples=samples)
    else:
        procedures.stream(recorder, samples)


def _rest_faults(plan: CampaignPlan, recorder: Recorder) -> Iterator[str]:
    table = read_log(recorder.log_path).table
    yield from recorder.session.warnings
    for column in recorder.instrument.columns:
        if column not in table or not len(table):
            continue
        noise, mean = float(np.std(table[column])), float(np.mean(table[column]))
        if noise > plan.checks.noise.get(column, np.inf):
            yield f"{column}: noise at rest {noise:.3g}, allowed {plan.checks.noise[column]:g} (checks.noise)"
        if abs(mean) > plan.checks.zero.get(column, np.inf):
            yield f"{column}: reads {mean:.3g} at rest, allowed {plan.checks.zero[column]:g} (checks.zero); tare it"


def _record_step(plan: CampaignPlan, step: _Step, ports: dict[str, str], desk: Desk) -> None:
    """Record one step under the next free name. Raises AcquireError."""
    setup: Setup = step.setup(plan.operator)
    recorders = recorders_for(
        {instrument: ports[instrument] for instrument in step.instruments},
        plan.out,
        _attempt(step, len(attempts(plan, step)) + 1),
        dict.fromkeys(step.instruments, setup),
        procedure={
            "name": step.group.do,
            "campaign": plan.name,
            "step": step.number,
            **step.group.settings,
            **step.values,
        },
        limits=plan.limits,
        say=desk.say,
    )
    desk.watch(recorders, lambda: run_with(recorders, lambda *opened: _carry_out(step, desk, *opened)))


def _carry_out(step: _Step, desk: Desk, *recorders: Recorder) -> None:
    do, get, first = step.group.do, step.setting, recorders[0]
    if do == "stream":
        procedures.stream(first, get("samples", 500), get("interval_s", 0.0))
    elif do in procedures.BENCH_TESTS:
        wait_s = get("wait_s", procedures.WAIT_S)
        procedures.bench_test(first, do, desk.prompts(step)(first), get("samples"), get("tolerance"), wait_s)
    elif do == "thrust":
        procedures.thrust_test(first, get("throttle", 0.1), get("rest_s", 1.0), get("hold_s", 4.0))
    elif do == "torque":
        procedures.torque_test(*recorders, get("throttle", 0.1), get("rest_s", 2.0), get("hold_s", 6.0))
    elif do == "wrench":
        procedures.measure_wrench(
            first, get("interval_s", 0.01), offset=get("offset", False), samples=get("samples", 500)
        )
    elif do == "experiment":
        letter, programme = programme_of(EXPERIMENTS[get("experiment", 1)])
        procedures.experiment(*recorders, letter, programme)
    elif do == "tensile":
        procedures.stream(first, None, moves=True)


def _complete_killed(plan: CampaignPlan, steps: list[_Step], say: Callable[[str], None]) -> None:
    """Counts and gaps for the metadata of attempts whose recorder was killed; the attempts stay what they are."""
    for step in steps:
        for name in attempts(plan, step):
            for stem in _stems(step, name):
                with suppress(InputError, OSError):  # such a one is no recording to complete
                    session = read_session(plan.out / f"{stem}.yaml")
                    log = plan.out / session.log
                    if session.ended == Ended.RECORDING and repair(log, read_log(log)):
                        say(f"{log}: its recorder was killed; the metadata now say what the log holds")


def run(plan: CampaignPlan, ports_of: Callable, desk: Desk, repeat: str | None = None, checked: bool = False) -> int:
    """All steps that are not done, or `repeat` alone once more. Returns how many are left.

    `ports_of(step or None)` is a context that gives the ports of a step, or of the checks. Raises AcquireError where
    a step fails: what was wrong has to be seen to before the next one.
    """
    steps = steps_of(plan)
    _complete_killed(plan, steps, desk.say)
    done = {step.name for step in steps if is_done(plan, step)}
    wanted = [step for step in steps if step.name == repeat or (repeat is None and step.name not in done)]
    desk.say(f"{plan.name}: {len(done)} of {len(steps)} recordings are there")
    if wanted and not checked:
        with ports_of(None) as ports:
            needed = {instrument for step in wanted for instrument in step.instruments}
            faults = check(plan, {name: port for name, port in ports.items() if name in needed}, desk)
        if faults:
            raise AcquireError("before the first recording: " + "; ".join(faults))
    for step in wanted:
        left = f"{len(steps) - len(done)} left"
        word = desk.ask(f"step {step.number} of {len(steps)} ({left}), {step.name}: {step.ask or 'ready?'}")
        if word in ("q", "quit"):
            break
        if word in ("s", "skip"):
            continue
        with ports_of(step) as ports:
            _record_step(plan, step, ports, desk)
        write_index(plan.out)
        if is_done(plan, step):
            done.add(step.name)
    return len(steps) - len(done)


@contextmanager
def emulated_ports(
    plan: CampaignPlan, step: _Step | None, folder: Path, speed: float, place_s: float
) -> Iterator[dict[str, str]]:
    """Emulators under the plan's instruments; a weight that the step asks for is put on by itself."""
    from contextlib import ExitStack

    from rotorid_acquire.emulators.ports import EmulatedPorts, build
    from rotorid_acquire.emulators.truth import draw_truth

    together = {("quadrotor", "wrench"): "stand", ("rotor", "wrench"): "torque"}
    names = tuple(step.instruments) if step is not None else tuple(plan.ports)
    worlds = [together[names]] if names in together else list(names)
    with ExitStack() as stack:
        ports = {}
        for what in worlds:
            number = step.setting("experiment", 1) if step is not None else 1
            world = build(what, draw_truth(plan.seed), plan.seed + (step.number if step else 0), experiment=number)
            if step is not None and step.setting("load_gf") is not None:
                axis = step.setting("axis") or step.group.setup.get("axis", "z")
                world.plan(place_s, axis, float(step.setting("load_gf")))
            links = [folder / f"tty-{line.device.instrument.name}" for line in world.lines]
            emulated = stack.enter_context(EmulatedPorts(world, links, speed=speed))
            ports |= {line.device.instrument.name: port for line, port in zip(world.lines, emulated.names, strict=True)}
        yield ports


def repair(log: Path, parsed: Log) -> bool:
    """Fill in counts and gaps where the metadata still say `recording`. True if there was something to do.

    A log whose recorder is still at work looks the same: the command is for logs, not for recordings.
    """
    session = parsed.session
    if session is None or session.ended != Ended.RECORDING or session.duration_s is not None:
        return False
    table = parsed.table
    raw = read_raw(log)
    if isinstance(parsed, Log):
        received = sum(len(chunk.data) for chunk in raw.chunks if chunk.tag == RECEIVED)
        session.counts = Counts(
            bytes_received=received,
            samples=len(table),
            missing=parsed.missing,
            repeated=parsed.repeated,
            checksum_errors=parsed.checksum_errors,
            broken_frames=parsed.broken_frames,
            resets=parsed.resets,
            malformed=parsed.malformed or None,
            unknown_kinds=parsed.unknown_kinds or None,
        )
        session.gaps = parsed.gaps[:1000]
        session.gaps_left_out = max(0, len(parsed.gaps) - 1000)
        time_s = table.time_s
    else:
        session.counts, session.warnings, time_s = parsed.counts, parsed.warnings, table.host_time_s
    if not parsed.faults:  # from now on a change of the log is noticed
        session.log_sha256 = raw.sha256
    session.duration_s = round(float(time_s.iloc[-1]), 6) if len(table) else 0.0
    write_session(session, session_path(log))
    return True
