"""A session of a stand or bench as files: the schedule, a picture, and what each outcome would mean."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from rotorid.io.text.writing import all_or_none, rounded
from rotorid.plan.session import SessionForecast, SessionPlan, words_of_steps
from rotorid.plan.write import outcome, questions_as_data, steps_of, words_of
from rotorid.recordings import columns as c
from rotorid.report.plots.style import BLUE, GREY, ORANGE, RED, figure, use


def text(plan: SessionPlan) -> list[str]:
    """The session in sentences, for the screen and for a page."""
    out = []
    if plan.steps:
        out.append(f"Record {len(plan.steps)} runs of {plan.duration_s:.0f} s in all (without the time to mount):")
        out += [f"  {line}" for line in words_of_steps(plan.steps)]
    elif plan.questions:
        out.append("No load within the limits separates what is open any further.")
    for _, found in plan.questions:
        out += [outcome(s, plan.limits.target_sigma) for s in found]
    if plan.sigma is not None and not plan.settles:
        out.append(
            f"Not all would be settled: the smallest separation is {plan.sigma:.1f} standard errors of "
            f"{plan.limits.target_sigma:g}. More time, load or tilt in the limits may do it."
        )
    for other in plan.others:
        if other.sigma is not None:
            name = "The standard session" if other.name == "standard" else "The next best session"
            words = ", ".join(dict.fromkeys(s.name for s in other.steps))
            out.append(f"{name} ({words}), {other.duration_s:.0f} s: {other.sigma:.1f} standard errors at the least.")
    for ids, what in plan.unanswerable:
        out.append(f"No schedule with these columns settles {' or '.join(words_of(i) for i in ids)}: {what}.")
    if not out:
        out.append("Nothing is open: no further measurement is needed to distinguish effects.")
    return out + _in_words(plan)


def _in_words(plan: SessionPlan) -> list[str]:
    """Manual steps, as sentences."""
    return [f"By hand: {step}." for step in _manual_steps(plan).values()]


def _manual_steps(plan: SessionPlan) -> dict[str, str]:
    """Manual steps, to the id that each is there for."""
    every = [*(ids for ids, _ in plan.questions), *(ids for ids, _ in plan.unanswerable)]
    return steps_of([i for ids in every for i in ids])


def _summary(plan: SessionPlan) -> dict:
    """The session as data, for `plan.json`."""
    return rounded(
        {
            "set": plan.set,
            "kind": plan.kind,
            "settles": plan.settles,
            "duration_s": plan.duration_s,
            "predicted_separation_sigma": plan.sigma,
            "steps": _steps_as_data(plan),
            "questions": questions_as_data(plan.questions, plan.limits.target_sigma),
            "others": [
                {
                    "name": other.name,
                    "duration_s": other.duration_s,
                    "predicted_separation_sigma": other.sigma,
                    "steps": _steps_as_data(other),
                    "questions": questions_as_data(other.questions, plan.limits.target_sigma),
                }
                for other in plan.others
            ],
            "not_by_loading": [{"ids": list(ids), "what_it_takes": what} for ids, what in plan.unanswerable],
            "by_hand": [{"id": i, "step": step, "predicted": None} for i, step in _manual_steps(plan).items()],
            "limits": plan.limits.model_dump(mode="json"),
        }
    )


def _steps_as_data(session: SessionForecast) -> list[dict]:
    """The steps of a session, in the order in which they are recorded."""
    return [
        {
            "run": f"step{i + 1:02d}",
            "name": s.name,
            "words": s.words,
            "duration_s": s.duration_s,
            "roll_deg": float(np.degrees(s.tilt_rad[0])),
            "pitch_deg": float(np.degrees(s.tilt_rad[1])),
        }
        for i, s in enumerate(session.steps)
    ]


def draw(plan: SessionPlan, path: Path) -> None:
    """Write the picture as PNG: the loads or speeds of the session one after the other, and the separations."""
    use()
    bench = plan.kind == "bench"
    stem = [n for n in c.REFERENCE_FORCE] if bench else [n for n in plan.table.columns if n.startswith("rotor_speed")]
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
    start = 0.0
    for i, s in enumerate(plan.steps):
        axes[0].axvline(start, color=GREY, lw=0.5, ls=":")
        axes[0].annotate(str(i + 1), (start, 1.0), xycoords=("data", "axes fraction"), va="bottom", fontsize=8)
        start += s.duration_s
    found = [s for _, own in plan.questions for s in own]
    rows = np.arange(len(found))[::-1]
    for row, s in zip(rows, found, strict=True):
        axes[1].plot(s.interval_95, [row, row], color=BLUE, lw=1.5)
        axes[1].plot(s.sigma, row, "o", color=BLUE)
        axes[1].plot(s.so_far, row, "o", color=ORANGE, mfc="none")
    axes[1].axvline(plan.limits.target_sigma, color=RED, lw=0.8)
    axes[1].set_yticks(rows, [f"{s.true} against {s.rival}".replace("_", " ") for s in found], fontsize=7)
    axes[1].set_xscale("symlog", linthresh=3)
    most = max(s.interval_95[1] for s in found)
    axes[1].set(xlabel="separation [standard errors]", ylim=(-0.6, len(found) - 0.4), xlim=(-0.3, 1.3 * most))
    axes[1].set_title("Ring: so far. Dot: with this session. Line: wanted", loc="right")
    fig.savefig(path, format="png")


def write(plan: SessionPlan, folder: Path) -> list[Path]:
    """Write everything; returns the files, the picture last. Nothing is left half written."""
    paths = [folder / n for n in ("plan.json", *(("session.csv", "plan.png") if plan.steps else ()))]
    with all_or_none(*paths) as parts:
        if plan.steps:
            first = ["run", c.TIME]
            table = plan.table[[*first, *(n for n in plan.table.columns if n not in first)]]
            table.to_csv(parts[1], index=False, float_format="%.6g", lineterminator="\n")
            draw(plan, parts[2])
        parts[0].write_text(json.dumps(_summary(plan), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return paths
