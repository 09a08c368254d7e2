"""Carries out a campaign's plan: checks first, then step after step; the same with instruments and with emulators.

Completes the metadata of a recording whose recorder was killed, from the log alone.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from rotorid.acquire import procedures
from rotorid.acquire.errors import AcquireError
from rotorid.acquire.plan import CampaignPlan, Step, attempts, is_done, next_attempt, stems, steps_of
from rotorid.acquire.procedures import programme_of
from rotorid.acquire.record import recorders_for, run_with
from rotorid.acquire.recorder import Recorder
from rotorid.io.experiments import EXPERIMENTS
from rotorid.io.index import write_index
from rotorid.io.logs import Log, LogError, read_log
from rotorid.io.rawlog import RECEIVED, NotALog, read_raw
from rotorid.io.session import Counts, Ended, GapEntry, SessionError, Setup, read_session, session_path, write_session

_Say = Callable[[str], None]
_Ask = Callable[[str], str]
_Prompts = Callable[[Step], Callable[[Recorder], procedures.Prompt]]
_Watch = Callable[[list[Recorder], Callable[[], None]], None]


@dataclass(frozen=True)
class Desk:
    """Who sits there: how they are informed, asked and waited for."""

    say: _Say
    ask: _Ask  # a question; the answer is "", or a word
    prompts: _Prompts  # how a procedure asks for a load
    watch: _Watch  # run with these recorders, showing them


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


def _record_step(plan: CampaignPlan, step: Step, ports: dict[str, str], desk: Desk) -> None:
    """Record one step under the next free name. Raises AcquireError."""
    setup: Setup = step.setup(plan.operator)
    recorders = recorders_for(
        {instrument: ports[instrument] for instrument in step.instruments},
        plan.out,
        next_attempt(plan, step),
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


def _carry_out(step: Step, desk: Desk, *recorders: Recorder) -> None:
    do, get, first = step.group.do, step.setting, recorders[0]
    rule = procedures.STEADY_JR3 if first.instrument.name == "jr3" else procedures.SteadyRule()
    if get("tolerance") is not None:
        rule = replace(rule, tolerance=get("tolerance"))
    wait_s = get("wait_s", procedures.WAIT_S)
    prompt = desk.prompts(step)(first)
    if do == "stream":
        procedures.stream(first, get("samples", 500), get("interval_s", 0.0))
    elif do == "calibrate":
        procedures.calibrate_cell(first, prompt, get("samples", 400))
    elif do == "static":
        procedures.static_test(first, prompt, get("samples", 50), rule, wait_s)
    elif do == "dynamic":
        procedures.dynamic_test(first, prompt, get("samples", 1500), rule, wait_s)
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


def _complete_killed(plan: CampaignPlan, steps: list[Step], say: _Say) -> None:
    """Counts and gaps for the metadata of attempts whose recorder was killed; the attempts stay what they are."""
    for step in steps:
        for name in attempts(plan, step):
            for stem in stems(step, name):
                with suppress(SessionError, LogError, NotALog, OSError):  # such a one is no recording to complete
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
def real_ports(plan: CampaignPlan, step: Step | None) -> Iterator[dict[str, str]]:
    """The plan's own."""
    yield plan.ports


@contextmanager
def emulated_ports(
    plan: CampaignPlan, step: Step | None, folder: Path, speed: float, place_s: float
) -> Iterator[dict[str, str]]:
    """Emulators under the plan's instruments; a weight that the step asks for is put on by itself."""
    from contextlib import ExitStack

    from rotorid.acquire.emulators.build import build
    from rotorid.acquire.emulators.ports import EmulatedPorts
    from rotorid.acquire.emulators.truth import draw_truth

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
    if not parsed.faults:  # from now on a change of the log is noticed
        session.log_sha256 = raw.sha256
    session.gaps = [GapEntry(**asdict(gap)) for gap in parsed.gaps[:1000]]
    session.gaps_left_out = max(0, len(parsed.gaps) - 1000)
    session.duration_s = round(float(table.time_s.iloc[-1]), 6) if len(table) else 0.0
    write_session(session, session_path(log))
    return True
