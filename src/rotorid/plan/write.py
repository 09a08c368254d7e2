"""A plan as files: trajectories for the vehicle's software, a mission, a picture, and what each outcome would mean.

- `trajectory.csv` is in the project's axes (north-east-down from the place of the start, heights as −z).
- `px4_offboard.csv` holds the fields of PX4's TrajectorySetpoint, which has the same axes.
- `crazyflie.csv` is a polynomial trajectory of seventh order as the Crazyflie's high-level commander takes it: x
  forward, y left, z up, yaw against the clock.
- A mission for PX4 (a file of QGroundControl), where the plan is one. It holds waypoints; how fast the vehicle goes
  between them PX4 shapes itself. Passes to and fro, climbs, held heights and turns on the spot are waypoints. Curves
  and quick motions are not, and the trajectory flown offboard is what the separations are predicted for. Format:
  https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
- The picture shows where to fly, how high and fast, and how far apart the competing models would be.
- Steps by hand, which no trajectory and no schedule can hold: what a person does between two recordings, and what it
  shows.
"""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.effects.catalogue import catalogue
from rotorid.io.text.writing import all_or_none, rounded
from rotorid.mismatch.decide.words import capital
from rotorid.plan.candidates import Reference
from rotorid.plan.plan import BETWEEN_S, SHARE, Forecast, Handled, Plan
from rotorid.plan.separation import Questions, Separation
from rotorid.report.plots.style import BLUE, GREY, ORANGE, RED, figure, use

STEPS: dict[str, str] = {
    "unequal_rotors": (
        "swap the propellers of two rotors that turn the same way and repeat the hover: the moment of a propeller goes "
        "with it, that of an offset of the centre of mass or of a tilted rotor stays"
    ),
    "payload": (
        "weigh the vehicle, take off what it carries and repeat the flight: the moment of a payload goes with it, an "
        "offset of the empty vehicle's centre of mass stays"
    ),
    "com_offset": (
        "hang a known weight on one side, as far from the middle as a rotor, and repeat the hover: an offset of the "
        "centre of mass changes by weight times distance over the mass of both"
    ),
    "thrust_tilt": "align the motors' mounts and repeat the flight: only the force of a tilted rotor changes",
    "accelerometer_error": (
        "lay the vehicle at rest on each of its six faces, ten seconds each: the accelerometer must read gravity along "
        "one axis and nothing along the others"
    ),
    "gyro_error": "record ten seconds at rest before take-off: what the gyroscope reads then is its own error",
    "steady_wind": "repeat the flight in a hall or on a day without wind: only a wind goes away",
    "gust": "repeat the flight in a hall or on a day without wind: only a gust goes away",
    "battery_sag": "repeat the flight with a battery half empty: what the voltage makes changes with it",
    "imu_lever_arm": "measure the place of the accelerometer from the centre of mass with a ruler",
    "tare_offset": "take off every load and record ten seconds, zero the reading, and record ten seconds again",
    "mount_tilt": "lay a spirit level on the sensor, and record the weight with the motors off, level and tilted",
    "sensor_origin": "hang a known weight at two known distances from the sensor's axis",
    "cable_stiffness": "lay the cable in another loop, or tape it to the vehicle, and repeat the tilts",
    "wall_interference": "move the wall or the stand by a rotor's diameter and repeat the steps of the throttle",
    "structural_resonance": "put half a kilogram on the stand and tap it: a ring of the structure becomes slower",
    "crosstalk": "turn the sensor by a quarter about the load's axis and repeat: crosstalk turns with the sensor",
    "zero_drift": "switch the instrument on an hour earlier and repeat: a drift with warmth is gone by then",
    "load_nonlinearity": (
        "put on dead weights that were weighed, motors off: a curve of the reading shows without rotors"
    ),
    "thrust_curve": (
        "read a dead weight as heavy as the largest thrust: a curve of the thrust is not in it, one of the reading is"
    ),
}
_SHOWN_HZ = 25.0
_FILE_HZ = 100.0
_PIECES_AT_ONCE = 31
"""Pieces that the trajectory memory of a Crazyflie (4096 bytes, 132 a piece) holds."""
_FLIP = np.array([1.0, -1.0, -1.0])
"""North-east-down to forward-left-up."""


def sampled(plan: Plan, rate_hz: float = _FILE_HZ) -> pd.DataFrame:
    """The reference in the project's axes: position, velocity, acceleration, yaw and its rate."""
    reference, middle = plan.reference, plan.limits.middle_m
    t = np.arange(0.0, reference.duration_s + 1e-9, 1.0 / rate_hz)
    place = reference.position_m + np.array([middle[0], middle[1], -middle[2]])
    velocity = np.gradient(place, reference.time_s, axis=0)
    acceleration = np.gradient(velocity, reference.time_s, axis=0)
    turning = np.gradient(reference.yaw_rad, reference.time_s)
    table = {"time_s": t}
    series = {"position": ("m", place), "velocity": ("m_s", velocity), "acceleration": ("m_s2", acceleration)}
    for stem, (unit, values) in series.items():
        for i, axis in enumerate("xyz"):
            table[f"{stem}_{axis}_{unit}"] = np.interp(t, reference.time_s, values[:, i])
    table["yaw_rad"] = np.interp(t, reference.time_s, reference.yaw_rad)
    table["yaw_rate_rad_s"] = np.interp(t, reference.time_s, turning)
    return pd.DataFrame(table)


def px4_offboard(plan: Plan) -> pd.DataFrame:
    """Setpoints in the fields of PX4's TrajectorySetpoint (local north-east-down frame, yaw from −π to π)."""
    table = sampled(plan)
    names = {"time_s": "timestamp_s", "yaw_rate_rad_s": "yawspeed"}
    for stem, unit in (("position", "m"), ("velocity", "m_s"), ("acceleration", "m_s2")):
        names |= {f"{stem}_{axis}_{unit}": f"{stem}[{i}]" for i, axis in enumerate("xyz")}
    out = table.rename(columns=names | {"yaw_rad": "yaw"})
    out["yaw"] = (out["yaw"] + np.pi) % (2 * np.pi) - np.pi
    return out


def _polynomial(start: np.ndarray, stop: np.ndarray, seconds: float) -> np.ndarray:
    """Coefficients (8, k), lowest order first, that take value and three derivatives (4, k) from start to stop."""
    powers = np.arange(8)

    def row(order: int, t: float) -> np.ndarray:
        factor = np.array([np.prod(np.arange(p, p - order, -1.0)) if p >= order else 0.0 for p in powers])
        return factor * np.power(t, np.maximum(powers - order, 0))

    matrix = np.array([row(o, 0.0) for o in range(4)] + [row(o, 1.0) for o in range(4)])
    # In units of the piece's length the matrix is well conditioned.
    scale = seconds ** np.arange(4)[:, None]
    unit = np.linalg.solve(matrix, np.concatenate([start * scale, stop * scale]))
    return unit / seconds ** powers[:, None]


def crazyflie(plan: Plan) -> tuple[pd.DataFrame, float]:
    """Polynomial pieces (`duration`, `x^0` … `yaw^7`) and the largest distance to the reference, m.

    Pieces are as long as the fit allows (WORST_FIT_M, WORST_FIT_M_S2), between FINEST_S and COARSEST_S.
    """
    coarsest_s, finest_s = 2.0, 0.1
    # Quick motions are millimetres large: that the path is met does not say that the acceleration is.
    worst_fit_m, worst_fit_m_s2 = 0.01, 0.4
    reference, middle = plan.reference, plan.limits.middle_m
    t, step = reference.time_s, reference.time_s[1] - reference.time_s[0]
    place = (reference.position_m + np.array([middle[0], middle[1], -middle[2]])) * _FLIP
    every = np.column_stack([place, -reference.yaw_rad])
    derivatives = [every]
    for _ in range(3):
        derivatives.append(np.gradient(derivatives[-1], step, axis=0))
    states = np.stack(derivatives, axis=1)
    rows, worst, at = [], 0.0, 0
    while at < len(t) - 1:
        length = int(round(coarsest_s / step))
        while True:
            end = min(at + length, len(t) - 1)
            seconds = t[end] - t[at]
            fitted = _polynomial(states[at], states[end], seconds)
            powers = np.power(t[at : end + 1, None] - t[at], np.arange(8))
            off = float(np.linalg.norm((powers @ fitted - every[at : end + 1])[:, :3], axis=1).max())
            bend = powers[:, :6] @ (fitted[2:] * (np.arange(2, 8) * np.arange(1, 7))[:, None])
            pushed = float(np.linalg.norm((bend - states[at : end + 1, 2])[:, :3], axis=1).max())
            if (off <= worst_fit_m and pushed <= worst_fit_m_s2) or length <= finest_s / step:
                break
            length //= 2
        worst, at = max(worst, off), end
        rows.append([seconds, *fitted.T.ravel()])
    names = ["duration", *(f"{axis}^{p}" for axis in ("x", "y", "z", "yaw") for p in range(8))]
    return pd.DataFrame(rows, columns=names), worst


def _words_of(effect: str) -> str:
    """An id in words."""
    return catalogue()[effect].name if effect in catalogue() else {"nothing": "no further effect"}.get(effect, effect)


def _outcome(separation: Separation, target: float) -> str:
    """What it would mean if one of the models came out."""
    low, high = separation.interval_95
    sure = "would be distinguished from" if separation.sigma >= target else "would probably not be distinguished from"
    return (
        f"If {_words_of(separation.true)} is at work it {sure} its nearest rival, {_words_of(separation.rival)}: "
        f"{separation.sigma:.1f} standard errors ({low:.1f} to {high:.1f}); the recordings so far give "
        f"{separation.so_far:.1f}."
    )


def questions_as_data(questions: Questions, target: float) -> list[dict]:
    """Open questions with what each outcome would mean, for JSON; `target` is the separation that settles one."""
    return [
        {
            "ids": list(ids),
            "outcomes": [
                {
                    "true": s.true,
                    "rival": s.rival,
                    "sigma": s.sigma,
                    "interval_95": list(s.interval_95),
                    "log_odds_nats": s.log_odds,
                    "so_far_sigma": s.so_far,
                    "meaning": _outcome(s, target),
                }
                for s in found
            ],
        }
        for ids, found in questions
    ]


def forecast_as_data(forecast: Forecast, target: float, pieces: dict[str, list[dict]]) -> dict:
    """What is expected of a flight or session, for JSON, with its `pieces` by what they are called."""
    return {
        "duration_s": forecast.duration_s,
        "predicted_separation_sigma": forecast.sigma,
        **pieces,
        "questions": questions_as_data(forecast.questions, target),
    }


def _flight_as_data(flight: Forecast, target: float) -> dict:
    """A flight and what is expected of it, for JSON."""
    manoeuvres = [{"name": p.name, "words": p.words, "duration_s": p.duration_s} for p in flight.pieces]
    sizes = [[s if np.isfinite(s) else None for s in (w.before, w.after)] for w in flight.widths]
    intervals = [
        {"name": w.name, "unit": w.unit, "half_width_before": before, "half_width_after": after}
        | ({"wished": w.wished} if w.wished else {})
        for w, (before, after) in zip(flight.widths, sizes, strict=True)
    ]
    data = forecast_as_data(flight, target, {"manoeuvres": manoeuvres})
    return {"flight": flight.name, **data, "intervals": intervals}


def unanswerable_as_data(plan: Plan) -> list[dict]:
    """Classes that nothing with these columns settles, for JSON."""
    return [{"ids": list(ids), "what_it_takes": what} for ids, what in plan.unanswerable]


def _summary(plan: Plan) -> dict:
    """The plan as data, for `plan.json` and for pages."""
    return rounded(
        {
            "set": plan.set,
            "settles": plan.settles,
            **_flight_as_data(plan, plan.limits.target_sigma),
            "others": [_flight_as_data(f, plan.limits.target_sigma) for f in plan.others],
            "not_by_flying": unanswerable_as_data(plan),
            "by_hand": by_hand_as_data(plan),
            "not_testable": [{"id": i, "reason": reason} for i, reason in plan.not_testable],
            "not_flown": [{"name": t.piece.name, "reason": t.reason} for t in plan.tried if t.reason],
            "limits": plan.limits.model_dump(mode="json"),
        }
    )


def text(plan: Plan) -> list[str]:
    """The flight in sentences, for the screen and for a page."""
    return sentences(
        plan,
        begin=f"Fly for {plan.duration_s:.0f} s (without take-off and landing):",
        none=f"No manoeuvre within the limits separates what is open any further: {why_none(plan)}."
        if plan.questions and not plan.pieces
        else "",
        more="time, speed, tilt or room",
        kind="flight",
        schedule="flight",
        needed="flight",
    )


def sentences(
    plan: Plan, begin: str, none: str, more: str, kind: str, schedule: str, needed: str, standard: bool = False
) -> list[str]:
    """A plan in sentences.

    `begin`, `none`: what stands above the pieces, and what is said where questions are open and there are no pieces.
    `more`: what in the limits may settle more. `kind`, `schedule`, `needed`: the words for what is planned, for what no
    question is settled by, and for what is not needed. `standard`: whether the standard one's pieces are named as well.
    """
    out = []
    if plan.pieces:
        out += [begin, *(f"  {line}" for line in _numbered(plan))]
    elif plan.questions:
        out.append(none)
    for _, found in plan.questions:
        out += [_outcome(s, plan.limits.target_sigma) for s in found]
    if plan.sigma is not None and not plan.settles:
        out.append(
            f"Not all would be settled: the smallest separation is {plan.sigma:.1f} standard errors of "
            f"{plan.limits.target_sigma:g}. More {more} in the limits may do it."
        )
    for other in plan.others:
        if other.sigma is not None:
            name = f"The {'standard' if other.name == 'standard' else 'next best'} {kind}"
            named = standard or other.name != "standard"
            words = f" ({', '.join(dict.fromkeys(p.name for p in other.pieces))})" if named else ""
            out.append(f"{name}{words}, {other.duration_s:.0f} s: {other.sigma:.1f} standard errors at the least.")
    out += [
        f"{w.name}: {_size(w.before, w.unit)} now, {_size(w.after, w.unit)} with this flight"
        + (f" (wished: {_share(w.wished, w.unit)})" if w.wished else "")
        for w in plan.widths
        if plan.pieces or w.wished
    ]
    for ids, what in plan.unanswerable:
        out.append(f"No {schedule} with these columns settles {' or '.join(_words_of(i) for i in ids)}: {what}.")
    if not out:
        out.append(f"Nothing is open: no {needed} is needed to distinguish effects.")
    expected = {
        h.change.of: f" {_expected_by_hand(h, plan.limits.target_sigma)}" for h in plan.by_hand if h.sigma is not None
    }
    return out + [f"By hand: {step}.{expected.get(i, '')}" for i, step in _manual_steps(plan).items()]


def why_none(plan: Plan) -> str:
    """Why there is nothing to fly: what keeps the manoeuvres out, or that none of those flown helps."""
    able = [t for t in plan.tried if not t.reason]
    if not able:
        return f"none of {len(plan.tried)} keeps them ({plan.tried[0].piece.name}: {plan.tried[0].reason})"
    best = max(able, key=lambda t: t.progress)
    return (
        f"{len(able)} of {len(plan.tried)} keep them, and in each the others can take over what one of them would do "
        f"with these columns (the best, {best.piece.name}, brings {100 * max(best.progress, 0.0):.1f} % of the way)"
    )


def _manual_steps(plan: Plan) -> dict[str, str]:
    """Manual steps that set one id of an open class apart from the others, by the id that each is there for."""
    ids = [i for ids, _ in (*plan.questions, *plan.unanswerable) for i in ids]
    return {i: STEPS[i] for i in dict.fromkeys(ids) if i in STEPS}


def _expected_by_hand(step: Handled, target: float) -> str:
    """What a step by hand is expected to separate, as a sentence."""
    settles = "this settles it" if step.sigma >= target else "this alone does not settle it"
    return (
        f"{capital(step.change.words)}, and hover for {step.hover_s:.0f} s (about {step.minutes:.0f} min in all): "
        f"{step.sigma:.1f} standard errors at the least, {settles}."
    )


def by_hand_as_data(plan: Plan) -> list[dict]:
    """Manual steps, for JSON; `predicted` is null where no separation is."""
    target, found = plan.limits.target_sigma, {h.change.of: h for h in plan.by_hand}

    def predicted(step: Handled) -> dict:
        said = {"words": step.change.words, "hover_s": step.hover_s, "minutes": step.minutes}
        questions = questions_as_data(step.questions, target)
        return said | {"predicted_separation_sigma": step.sigma, "questions": questions}

    return [
        {"id": i, "step": step, "predicted": predicted(found[i]) if i in found else None}
        for i, step in _manual_steps(plan).items()
    ]


def _numbered(plan: Plan) -> list[str]:
    """The pieces in their order, one that is done several times in a row once."""
    out, at = [], 0
    for _, same in groupby(plan.pieces, key=lambda p: p.name):
        piece, *more = same
        times = 1 + len(more)
        number = str(at + 1) if times == 1 else f"{at + 1} to {at + times}"
        out.append(f"{number}. {piece.words} ({f'{times} × ' if times > 1 else ''}{piece.duration_s:.0f} s)")
        at += times
    return out


def _size(value: float, unit: str) -> str:
    """A half width, or an upper limit, in words."""
    if not np.isfinite(value):
        return "unknown"
    return f"{'at most' if unit == SHARE else '±'} {_share(value, unit)}"


def _share(value: float, unit: str) -> str:
    """A half width with its unit; relative ones and shares in percent."""
    if unit in ("relative", SHARE):
        return f"{100 * value:.2g} % {unit if unit == SHARE else ''}".rstrip()
    return f"{value:.2g} {unit if unit != '1' else ''}".rstrip()


def write(plan: Plan, folder: Path) -> list[Path]:
    """Write everything; returns the files. Nothing is left half written."""
    names = ["plan.json"]
    if plan.pieces:
        names += ["trajectory.csv", "px4_offboard.csv", "crazyflie.csv", "plan.png"]
    why = not_a_mission(plan)
    if plan.pieces and not why:
        names.append("px4_mission.plan")
    paths = [folder / name for name in names]
    with all_or_none(*paths) as parts:
        content = _summary(plan)
        if plan.pieces:
            sampled(plan).to_csv(parts[1], index=False, float_format="%.6g", lineterminator="\n")
            px4_offboard(plan).to_csv(parts[2], index=False, float_format="%.6g", lineterminator="\n")
            table, worst = crazyflie(plan)
            table.to_csv(parts[3], index=False, float_format="%.9g", lineterminator="\n")
            content["crazyflie"] = rounded(
                {"pieces": len(table), "uploads": -(-len(table) // _PIECES_AT_ONCE), "worst_fit_m": worst}
            )
            _draw(plan, parts[4])
            content["px4_mission"] = why or "px4_mission.plan"
            if not why:
                parts[5].write_text(json.dumps(mission(plan), indent=1) + "\n", encoding="utf-8")
        parts[0].write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return paths


def _draw(plan: Plan, path: Path) -> None:
    """Write the picture as PNG."""
    use()
    flight = plan.flight
    motion = flight.motion
    every = max(1, int(round(1.0 / (_SHOWN_HZ * (motion.time_s[1] - motion.time_s[0])))))
    t, place = motion.time_s[::every], motion.position[::every]
    fig, axes = figure(6.4, 3, 2, width_ratios=(1.0, 1.25))
    top, reference = axes[0, 0], plan.reference.position_m + np.array([*plan.limits.middle_m[:2], 0.0])
    x, y = plan.limits.x_m, plan.limits.y_m
    top.plot([y[0], y[1], y[1], y[0], y[0]], [x[0], x[0], x[1], x[1], x[0]], color=GREY, lw=0.8)
    top.plot(reference[::every, 1], reference[::every, 0], color=ORANGE, lw=0.7, label="asked")
    top.plot(place[:, 1], place[:, 0], color=BLUE, label="flown")
    top.set(xlabel="east of the start [m]", ylabel="north [m]", title="From above, and the volume", aspect="equal")
    top.legend(loc="upper right")
    series = (
        (axes[0, 1], motion.height[::every], "height [m]"),
        (axes[1, 0], np.linalg.norm(flight.world_velocity[::every, :2], axis=1), "speed over ground [m/s]"),
        (axes[1, 1], np.degrees(np.arccos(np.clip(motion.rotation[::every, 2, 2], -1, 1))), "tilt [°]"),
        (axes[2, 0], np.degrees(plan.reference.yaw_rad[::every]), "yaw asked [°]"),
    )
    starts = np.cumsum([BETWEEN_S] + [p.duration_s + BETWEEN_S for p in plan.pieces])
    for ax, values, label in series:
        ax.plot(t, values[: len(t)], color=BLUE)
        ax.set(xlabel="time [s]", ylabel=label, xlim=(0, t[-1]))
        draw_starts(ax, starts[:-1], numbered=ax is axes[0, 1])
    ax = axes[2, 1]
    if any(own for _, own in plan.questions):
        draw_separations(ax, plan, "flight")
        ax.tick_params(axis="x", which="minor", bottom=False)
    else:
        ax.set_axis_off()
    fig.savefig(path, format="png")


def draw_starts(ax, starts_s: np.ndarray, numbered: bool) -> None:
    """Draw where each piece begins, with its number where they are `numbered`."""
    for i, start in enumerate(starts_s):
        ax.axvline(start, color=GREY, lw=0.5, ls=":")
        if numbered:
            ax.annotate(str(i + 1), (start, 1.0), xycoords=("data", "axes fraction"), va="bottom", fontsize=8)


def draw_separations(ax, plan: Plan, kind: str) -> None:
    """Draw how far apart the competing models are so far, and with the flight or session."""
    found = [s for _, own in plan.questions for s in own]
    rows = np.arange(len(found))[::-1]
    for row, s in zip(rows, found, strict=True):
        ax.plot(s.interval_95, [row, row], color=BLUE, lw=1.5)
        ax.plot(s.sigma, row, "o", color=BLUE)
        ax.plot(s.so_far, row, "o", color=ORANGE, mfc="none")
    ax.axvline(plan.limits.target_sigma, color=RED, lw=0.8)
    ax.set_yticks(rows, [f"{s.true} against {s.rival}".replace("_", " ") for s in found], fontsize=7)
    ax.set_xscale("symlog", linthresh=3)
    most = max(s.interval_95[1] for s in found)
    ax.set(xlabel="separation [standard errors]", ylim=(-0.6, len(found) - 0.4), xlim=(-0.3, 1.3 * most))
    ax.set_title(f"Ring: so far. Dot: with this {kind}. Line: wanted", loc="right")


EARTH_M = 6378137.0
_STRAIGHT = ("hover", "ladder", "pass", "climb", "face")
"""First words of the manoeuvres that are waypoints."""
_STILL = 0.03
"""Share of the largest speed below which the vehicle turns round or waits."""
TAKE_OFF, WAYPOINT, SPEED, RETURN = 22, 16, 178, 20
_RELATIVE = 3
"""MAVLink frame: latitude, longitude, height above home."""


def not_a_mission(plan: Plan) -> str:
    """Why a plan is no mission; empty where it is one."""
    others = [p.name for p in plan.pieces if p.name.split()[0] not in _STRAIGHT]
    if others:
        return f"no mission: {', '.join(dict.fromkeys(others))} cannot be given as waypoints; fly px4_offboard.csv"
    if plan.limits.home_deg is None:
        return "no mission: limits state no home_deg (latitude and longitude of the start)"
    return ""


def _stops(reference: Reference) -> list[tuple[np.ndarray, float, float, float]]:
    """Where a reference turns round or rests, in order.

    The place (north, east, down from the volume's middle), m, the yaw, rad, how long to stay, s, and how fast to get
    there, m/s.
    """
    held_s = 0.5  # Shorter rests are turns, not waits.
    t = reference.time_s
    speed = np.linalg.norm(np.gradient(reference.position_m, t, axis=0), axis=1)
    turning = np.abs(np.gradient(reference.yaw_rad, t))
    still = (speed <= _STILL * max(speed.max(), 1e-9)) & (turning <= _STILL * max(turning.max(), 1e-9))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]]))).reshape(-1, 2)
    out, last = [], 0
    for start, stop in edges:
        middle, wait = (start + stop - 1) // 2, float(t[stop - 1] - t[start])
        way, held = float(speed[last : start + 1].max()), wait if wait > held_s else 0.0
        out.append((reference.position_m[middle], float(reference.yaw_rad[middle]), held, way))
        last = stop
    return out


def mission(plan: Plan) -> dict:
    """The plan in the format of a QGroundControl plan file: take-off, waypoints with their speeds, return."""
    home, middle = plan.limits.home_deg, plan.limits.middle_m
    items: list[dict] = []

    def add(command: int, params: list, frame: int = _RELATIVE) -> None:
        item = {"type": "SimpleItem", "autoContinue": True, "command": command, "doJumpId": len(items) + 1}
        height = {"Altitude": params[6], "AltitudeMode": 1, "AMSLAltAboveTerrain": None} if command == WAYPOINT else {}
        items.append(item | {"frame": frame, "params": params} | height)

    def place(at: np.ndarray) -> list[float]:
        north, east, height = at[0] + middle[0], at[1] + middle[1], middle[2] - at[2]
        latitude = home[0] + np.degrees(north / EARTH_M)
        longitude = home[1] + np.degrees(east / (EARTH_M * np.cos(np.radians(home[0]))))
        return [round(float(latitude), 8), round(float(longitude), 8), round(float(height), 2)]

    add(TAKE_OFF, [0, 0, 0, 0, *place(np.zeros(3))])
    fastest = 0.0
    for at, yaw_rad, wait_s, speed_m_s in _stops(plan.reference):
        if speed_m_s > 0.1 and abs(speed_m_s - fastest) > 0.05:
            fastest = speed_m_s
            add(SPEED, [1, round(fastest, 2), -1, 0, 0, 0, 0], frame=2)
        add(WAYPOINT, [round(wait_s, 1), 0, 0, round(float(np.degrees(yaw_rad)) % 360, 1), *place(at)])
    add(RETURN, [0, 0, 0, 0, 0, 0, 0], frame=2)
    return {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": 12,
            "vehicleType": 2,
            "cruiseSpeed": plan.limits.speed_m_s,
            "hoverSpeed": plan.limits.speed_m_s,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [*home, 0.0],
            "items": items,
        },
    }
