"""What to load, throttle, tilt and wait next on a stand or a bench, so that what a set left open is settled, as files.

A step is a schedule that starts and ends unloaded: loads of a bench (hung on by hand or pulled by a machine), throttle
of a stand's rotors, in one mounting. Its load is known as soon as it is asked for, so that nothing is simulated but the
columns that every competing effect would have in it; separations are predicted and steps chosen as for flights.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.writing import all_or_none, rounded
from rotorid.mismatch.decide.findings import with_probabilities
from rotorid.mismatch.evidence.regression import Regression
from rotorid.mismatch.evidence.rows import Term
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.instrument.analyse import decided_of_reading, first_model, with_plainer_forms
from rotorid.mismatch.instrument.chain import ChainResult, unseen_loadings
from rotorid.mismatch.instrument.mistakes import find_mistakes
from rotorid.mismatch.instrument.model import (
    ReadingModel,
    chosen_already,
    make_terms,
    rows_of,
    whole_reading,
)
from rotorid.mismatch.instrument.setup import set_up
from rotorid.plan.candidates import SessionLimits
from rotorid.plan.plan import Forecast, Plan, Tried, better_first, first_and_second
from rotorid.plan.questions import Question, claimed_in, in_thirds, question_of
from rotorid.plan.separation import FITTED_SHARE, Information, asked_terms, of_set, placed, separations
from rotorid.plan.write import (
    by_hand_as_data,
    draw_separations,
    draw_starts,
    forecast_as_data,
    sentences,
    unanswerable_as_data,
)
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.sufficient import sufficient
from rotorid.report.plots.style import figure, use
from rotorid.steps import step

REST_S = 2.0
"""Unloaded before and after every step."""
_MOST_STEPS = 40
_STANDARD = "slow steps"
_STEP_S = 0.3
"""A change of the load from one level to the next takes this long."""


@dataclass(frozen=True)
class SessionStep:
    """A part of a session: a load (n, 3) of a bench or speeds (n, rotors) of a stand, as shares of the largest."""

    name: str
    words: str
    duration_s: float
    make: Callable[[np.ndarray], np.ndarray]
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    """Roll and pitch of a stand's mount."""


@dataclass(frozen=True)
class KnownInstrument:
    """A stand's or bench's set as the engine fitted it, and what it leaves open."""

    recordings: RecordingSet
    model: ReadingModel
    chain: ChainResult | None
    questions: tuple[Question, ...]
    unanswerable: tuple[tuple[tuple[str, ...], str], ...]
    chains: tuple = ()

    @property
    def regression(self) -> Regression:
        """The engine's normal equations of the set."""
        return self.model.regression


def known_instrument(recordings: RecordingSet, claimed: Collection[str] | None = None) -> KnownInstrument:
    """The set fitted as `rotorid.mismatch.instrument.analyse` does, and its open questions.

    Of ids that the verdict on the set does not claim (`claimed`) nothing is asked.
    """
    recordings, mistakes, _ = find_mistakes(recordings)
    part, _ = parts_of(recordings, split_runs(recordings))
    setup = set_up(part, recordings)
    model, chain, loadings = first_model(setup, make_terms(setup)[0])
    model = with_plainer_forms(model, loadings)
    questions, unanswerable = [], [(f.alternatives, f.sentence) for f in mistakes if f.status == "ambiguous"]
    chosen = chosen_already(model)
    inside = with_probabilities(decided_of_reading(model), chosen.found, chosen.support)
    seen = {frozenset(ids) for ids, _ in unanswerable}
    for finding in (*inside, *(() if chain is None else chain.findings)):
        ids = tuple(finding.alternatives) if finding.status == "ambiguous" else ()
        if claimed is not None and finding.id not in claimed:
            continue
        if not ids or frozenset(ids) in seen:
            continue
        seen.add(frozenset(ids))
        question = question_of(model, finding, ids)
        if question is None:
            unanswerable.append(
                (ids, "it lies between command and rotor speed; record the speeds next to the commands")
            )
        else:
            questions.append(question)
    return KnownInstrument(recordings, model, chain, tuple(questions), tuple(unanswerable))


def known_instrument_from(recordings: RecordingSet, verdict: dict) -> KnownInstrument:
    """A stand's or bench's set fitted, with the questions that its verdict (content of verdict.json) leaves open.

    InputError where the set does not suffice.
    """
    return known_instrument(sufficient(recordings), claimed_in(verdict))


def through(t: np.ndarray, levels: Sequence[float]) -> np.ndarray:
    """Levels held for equal times, from nothing and back to it, (n,)."""
    held = np.array([0.0, *levels, 0.0])
    cuts = REST_S + (t[-1] - 2 * REST_S) * np.arange(len(held) - 1) / (len(held) - 2)
    out = np.zeros(len(t))
    for a, b, cut in zip(held[:-1], held[1:], cuts, strict=True):
        out += (b - a) * 0.5 * (1 - np.cos(np.pi * np.clip((t - cut) / _STEP_S + 0.5, 0, 1)))
    return out


def courses(limits: SessionLimits) -> dict[str, tuple[str, float, Callable[[np.ndarray], np.ndarray]]]:
    """To a name what it is in words, its duration, s, and the load over time as a share of the largest."""
    up = np.linspace(0.2, 1.0, 5)
    ladder = [*up, *up[-2::-1]]
    loops = [0.2, 0.4, 0.2, 0.4, 0.2, 0.6, 1.0, 0.6, 0.2, 0.6, 1.0, 0.4]
    draws = np.random.default_rng(3).permutation(np.linspace(0.1, 1.0, 12))
    wait = limits.wait_s
    return {
        "slow steps": ("in five steps up and down, 5 s each", 5.0 * len(ladder), lambda t: through(t, ladder)),
        "quick steps": ("in twelve steps in no order, 1 s each", 1.0 * len(draws), lambda t: through(t, draws)),
        "loops": ("up and down, twice by little and twice by much, 2.5 s a step", 30.0, lambda t: through(t, loops)),
        "held": (f"held for {wait:.0f} s", wait, lambda t: through(t, [1.0])),
        "rested": (
            f"nothing for {wait:.0f} s, full for 5 s, nothing for {wait:.0f} s",
            2 * wait + 5.0,
            lambda t: np.where(np.abs(t - t[-1] / 2) < 2.5, 1.0, 0.0),
        ),
    }


def _places(known: KnownInstrument) -> list[tuple[str, np.ndarray]]:
    """To a name the shares (k,) of every axis of a bench or rotor of a stand that is loaded together."""
    vehicle = known.recordings.vehicle
    if vehicle.kind == "bench":
        loaded = [k for k in known.model.setup.instrument.channels if np.abs(_largest(known)[k]) > 0]
        alone = [(f"along {'xyz'[k]}", np.eye(3)[k]) for k in loaded]
        return [*alone, *([("along all axes", np.eye(3)[loaded].sum(axis=0))] if len(loaded) > 1 else [])]
    count = vehicle.rotor_count
    alone = [(f"of rotor {i + 1} alone", np.eye(count)[i]) for i in range(count)] if count > 1 else []
    return [("of all rotors" if count > 1 else "of the rotor", np.ones(count)), *alone]


def _largest(known: KnownInstrument) -> np.ndarray:
    """Largest load along x, y, z of a bench, N with its sign, or speed of a stand's rotors, rad/s, in the set."""
    loadings = known.model.setup.loadings
    if known.recordings.vehicle.kind == "bench":
        load = np.concatenate([x.load[:, :3] for x in loadings])
        return load[np.abs(load).argmax(axis=0), np.arange(3)]
    speeds = np.concatenate([x.command if x.command is not None else x.motion.rotor_speed for x in loadings])
    return np.full(speeds.shape[1], np.nanmax(speeds))


def _tilts(known: KnownInstrument, limits: SessionLimits) -> list[tuple[float, float]]:
    """Roll and pitch, rad, that the mount can be set to: level, and a tilt about either axis."""
    runs = known.recordings.runs
    if known.recordings.vehicle.kind == "bench" or not all(r.has(*c.MOUNT) for r in runs):
        return [(0.0, 0.0)]
    angle = np.radians(limits.tilt_deg)
    return [(0.0, 0.0), (angle, 0.0), (0.0, angle)] if angle > 0 else [(0.0, 0.0)]


def options(known: KnownInstrument, limits: SessionLimits) -> list[SessionStep]:
    """Every step of the families."""
    bench = known.recordings.vehicle.kind == "bench"
    out = []
    for tilt in _tilts(known, limits):
        leaning = ", ".join(f"{a} {np.degrees(x):.0f}°" for a, x in zip(("roll", "pitch"), tilt, strict=True) if x)
        mounted = f"mount the vehicle with {leaning}, then " if leaning else ""
        for where, shares in _places(known):
            for name, (words, seconds, course) in courses(limits).items():
                if leaning and (name not in ("slow steps", "rested") or where.endswith("alone")):
                    continue
                what = f"load {where}, " if bench else f"throttle {where}, "
                share = shares * limits.load_share

                def make(t, course=course, share=share, bench=bench):
                    # Thrust is nearly the square of the speed: even steps of the load.
                    level = course(t) if bench else np.sqrt(np.maximum(course(t), 0.0))
                    return level[:, None] * share

                called = f"{name} {where}{' ' + leaning if leaning else ''}"
                out.append(SessionStep(called, mounted + what + words, seconds + 2 * REST_S, make, tilt))
    return out


def table_of(known: KnownInstrument, step: SessionStep) -> pd.DataFrame:
    """What the set's columns would hold of a step: times, load or speeds, mount; readings are nothing."""
    setup, vehicle = known.model.setup, known.recordings.vehicle
    t = np.arange(0.0, step.duration_s, 1.0 / setup.instrument.rate_hz)
    asked = step.make(t) * _largest(known)
    table = {c.TIME: t} | {(c.FORCE + c.MOMENT)[k]: np.zeros(len(t)) for k in setup.instrument.channels}
    if vehicle.kind == "bench":
        return pd.DataFrame(table | {n: asked[:, k] for k, n in enumerate(c.REFERENCE_FORCE)})
    first = known.recordings.runs[0]
    scale = 1.0 / setup.full_speed if setup.full_speed else 1.0
    for stem, factor in (("rotor_speed", 1.0), ("rotor_command", 1.0), ("throttle", scale)):
        names = c.rotor_columns(stem, vehicle.rotor_count)
        if first.has(*names):
            table |= {n: factor * asked[:, i] for i, n in enumerate(names)}
    for name, angle in zip(c.MOUNT, step.tilt_rad, strict=True):
        if first.has(name):
            table[name] = np.full(len(t), angle)
    for name in (c.BATTERY_VOLTAGE, c.TEMPERATURE):
        if all(r.has(name) for r in known.recordings.runs):
            table[name] = np.full(len(t), np.nanmedian(first.column(name)))
    return pd.DataFrame(table)


@step("predicting a step")
def of_step(known: KnownInstrument, step: SessionStep, terms: Sequence[Term]) -> Information:
    """What the fitted part of a step would hold, in the columns of the set's regression."""
    return _of_run(known, Run("planned", table_of(known, step)), terms).share(FITTED_SHARE)


def _of_run(known: KnownInstrument, run: Run, terms: Sequence[Term]) -> Information:
    """What a run after the set would hold, in the columns of the set's regression."""
    model, name = known.model, run.name
    session, first = model.setup.session, known.recordings.runs[0].name
    begins, seconds = float(run.time_s[0]), float(run.time_s[-1] - run.time_s[0])
    if session is not None:
        later = session.start_s | {name: max(session.start_s.values(), default=0.0) + session.length_s + begins}
        warm = {name: session.first_temperature_c[first]} if first in session.first_temperature_c else {}
        session = replace(
            session,
            first_s={**session.first_s, name: begins},
            start_s=later,
            first_temperature_c={**session.first_temperature_c, **warm},
        )
    unseen = RecordingSet(name, known.recordings.vehicle, (run,), ())
    own = unseen_loadings(replace(model.setup, session=session), unseen, known.chain)[1]
    made = rows_of(model.setup, list(terms), own, whole_reading(model.terms, model.selection.active))
    added = known.regression.again([replace(r, y=np.nan_to_num(r.y)) for r in made], terms)
    return Information(placed(known, terms, added.gram.sum(axis=0)), seconds=seconds)


def _fitted_runs(known: KnownInstrument, steps: Sequence[SessionStep]) -> list[Run]:
    """The runs of a session that the joint judgement fits: whole steps, or parts of the steps of a short session."""
    runs = tuple(Run(f"step{i + 1:02d}", table_of(known, s)) for i, s in enumerate(steps))
    whole = in_thirds(RecordingSet("planned", known.recordings.vehicle, runs, None))
    fitted = split_runs(whole).training if len(whole.runs) >= 3 else [r.name for r in whole.runs]
    return [r for r in whole.runs if r.name in fitted]


def _forecast(known: KnownInstrument, name: str, taken: Sequence[Tried]) -> Forecast:
    """What is expected of steps taken."""
    # What is mounted alike, and what is done alike, follows each other.
    taken = sorted(taken, key=lambda t: (t.piece.tilt_rad != (0.0, 0.0), t.piece.tilt_rad, t.piece.name))
    steps, terms, before = tuple(t.piece for t in taken), asked_terms(known), of_set(known)
    after = before
    for run in _fitted_runs(known, steps) if steps else ():
        after = after + _of_run(known, run, terms)
    questions = tuple((q.ids, tuple(separations(known, q, before, after))) for q in known.questions)
    return Forecast(name, steps, None, None, questions, ())


def _standard_steps(tried: Sequence[Tried], limits: SessionLimits) -> list[Tried]:
    """What is loaded without a plan: slowly up and down in every place, mounted level, as often as time allows."""
    once = [t for t in tried if t.information is not None and t.piece.name.startswith(_STANDARD)]
    once = [t for t in once if t.piece.tilt_rad == (0.0, 0.0)]
    seconds = sum(t.flown_s for t in once)
    return once * min(int(limits.duration_s / seconds), _MOST_STEPS // len(once)) if once else []


def plan_session(known: KnownInstrument, limits: SessionLimits) -> Plan:
    """The steps that settle most in the time allowed; none where nothing is open or nothing helps."""
    about = {"set": known.recordings.name, "kind": known.recordings.vehicle.kind, "limits": limits}
    about |= {"unanswerable": known.unanswerable}
    if not known.questions:
        return Plan("chosen", (), None, None, (), (), **about)
    terms, tried = asked_terms(known), []
    for tested in options(known, limits):
        try:
            tried.append(Tried(tested, of_step(known, tested, terms), tested.duration_s))
        except InputError as error:
            tried.append(Tried(tested, None, tested.duration_s, str(error)))
    found, _ = first_and_second(known, limits, tried, partial(_forecast, known), _MOST_STEPS)
    if usual := _standard_steps(tried, limits):
        found.append(_forecast(known, "standard", usual))
    best, *others = better_first(found, limits.target_sigma)
    parts = [table_of(known, s).assign(run=f"step{i + 1:02d}") for i, s in enumerate(best.pieces)]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    readings = [n for n in table.columns if n in c.FORCE + c.MOMENT]
    return Plan(**vars(best), **about, table=table.drop(columns=readings), others=tuple(others))


def text(plan: Plan) -> list[str]:
    """The session in sentences, for the screen and for a page."""
    return sentences(
        plan,
        begin=f"Record {len(plan.pieces)} runs of {plan.duration_s:.0f} s in all (without the time to mount):",
        none="No load within the limits separates what is open any further.",
        more="time, load or tilt",
        kind="session",
        schedule="schedule",
        needed="further measurement",
        standard=True,
    )


def _session_as_data(session: Forecast, target: float) -> dict:
    """A session and what is expected of it, for JSON; its steps in the order in which they are recorded."""
    steps = [
        {
            "run": f"step{i + 1:02d}",
            "name": s.name,
            "words": s.words,
            "duration_s": s.duration_s,
            "roll_deg": float(np.degrees(s.tilt_rad[0])),
            "pitch_deg": float(np.degrees(s.tilt_rad[1])),
        }
        for i, s in enumerate(session.pieces)
    ]
    return forecast_as_data(session, target, {"steps": steps})


def _summary(plan: Plan) -> dict:
    """The session as data, for `plan.json`."""
    target = plan.limits.target_sigma
    return rounded(
        {"set": plan.set, "kind": plan.kind, "settles": plan.settles}
        | _session_as_data(plan, target)
        | {
            "others": [{"name": other.name} | _session_as_data(other, target) for other in plan.others],
            "not_by_loading": unanswerable_as_data(plan),
            "by_hand": by_hand_as_data(plan),
            "limits": plan.limits.model_dump(mode="json"),
        }
    )


def _draw(plan: Plan, path: Path) -> None:
    """Write the picture as PNG: the loads or speeds of the session one after the other, and the separations."""
    use()
    bench = plan.kind == "bench"
    stem = list(c.REFERENCE_FORCE) if bench else [n for n in plan.table.columns if n.startswith("rotor_speed")]
    stem = stem or [n for n in plan.table.columns if n.startswith(("rotor_command", "throttle"))]
    fig, axes = figure(4.2, 2, 1)
    step = float(plan.table[c.TIME].iloc[1] - plan.table[c.TIME].iloc[0])
    t = step * np.arange(len(plan.table))
    every = max(1, len(t) // 3000)
    for k, name in enumerate(stem):
        if np.abs(plan.table[name]).max() > 0:
            label = name.split("_force_")[-1][0] if bench else f"rotor {k + 1}"
            axes[0].plot(t[::every], plan.table[name].to_numpy()[::every], label=label, lw=0.9)
    unit = "load [N]" if bench else ("throttle [-]" if stem[0].startswith("throttle") else "rotor speed [rad/s]")
    axes[0].set(xlabel="time [s]", ylabel=unit, xlim=(0, t[-1]))
    axes[0].legend(loc="upper right", ncols=4)
    draw_starts(axes[0], np.cumsum([0.0, *(s.duration_s for s in plan.pieces[:-1])]), numbered=True)
    draw_separations(axes[1], plan, "session")
    fig.savefig(path, format="png")


def write(plan: Plan, folder: Path) -> list[Path]:
    """Write everything; returns the files, the picture last. Nothing is left half written."""
    paths = [folder / n for n in ("plan.json", *(("session.csv", "plan.png") if plan.pieces else ()))]
    with all_or_none(*paths) as parts:
        if plan.pieces:
            first = ["run", c.TIME]
            table = plan.table[[*first, *(n for n in plan.table.columns if n not in first)]]
            table.to_csv(parts[1], index=False, float_format="%.6g", lineterminator="\n")
            _draw(plan, parts[2])
        parts[0].write_text(json.dumps(_summary(plan), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return paths
