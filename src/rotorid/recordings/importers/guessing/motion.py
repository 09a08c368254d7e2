"""Motion: attitude and gyroscope, which integrate to each other; velocity, position and height."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import Agreement, Draft
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import EULER, OPEN, THREE, TRAVEL, UNITS, from_angles

_MOST_RAD, _MOST_DEG = 7.0, 400.0
"""Largest angle in rad, and in degrees."""
_SAME_ORDER_RAD = np.radians(2.0)
"""Where the two orders of roll, pitch and yaw are no farther apart, the usual one is taken without a question."""


def guess_velocity(draft: Draft) -> None:
    triples = by.triples_of(draft)
    offered = [f for f in triples if named.is_named(f, "velocity")]
    force = draft.channels.get("specific_force")
    candidates = offered or [
        f for f in triples if not f.words & named.OTHER_THINGS and not named.is_named(f, "position")
    ]
    found: dict[tuple[str, Family], Agreement] = {}
    others: dict[Family, tuple[str, str]] = {}
    if force is not None and force.unit != OPEN and draft.wxyz is not None and draft.instants is not None:
        # Changes of velocity by accelerometer and attitude in the axes of the recorded world, m/s.
        felt = draft.values(force.columns) * UNITS["acceleration"][force.unit]
        gained = draft.integrated(by.into_world(draft.time_s, draft.wxyz, felt))
        for family in candidates:
            values = draft.values(family.columns)
            found["world", family], others[family] = _in_any_axes(draft.changes(values), gained, draft.world)
            found["body", family] = by.compare(draft.changes(by.into_world(draft.time_s, draft.wxyz, values)), gained)
    best = max(found, key=lambda key: found[key].correlation, default=None)
    enough = by.CONFIRMED if offered else by.BY_NUMBERS_ALONE
    if best is not None and found[best].correlation >= enough:
        _velocity_confirmed(draft, best, found, others[best[1]], bool(offered))
    elif offered:
        _velocity_alone(draft, offered[0], found)


def _in_any_axes(changes: np.ndarray, gained: np.ndarray, world: str) -> tuple[Agreement, tuple[str, str]]:
    """How changes (n, 3) follow those gained in the axes of the attitude's world, in whatever axes they agree best.

    Returns the agreement, and the world of the attitude and of the changes: the same one unless another leaves clearly
    less unexplained. An attitude whose world has z up may refer to any north, so that both such worlds are tried.
    """
    same = by.compare(changes, gained)
    if world == OPEN:
        return same, (world, world)
    best, axes = same, (world, world)
    for attitude in ("enu", "nwu") if world == "enu" else (world,):
        for own in TRAVEL:
            seen = by.compare(changes @ TRAVEL[own].T @ TRAVEL[attitude], gained)
            turned = min(same.by_axis) < -by.CONTRADICTED and min(seen.by_axis) > by.CONTRADICTED
            if (by.is_clear(seen, same) or turned) and seen.correlation > best.correlation:
                best, axes = seen, (attitude, own)
    return best, axes


def _velocity_confirmed(
    draft: Draft, best: tuple[str, Family], found: dict, own_axes: tuple[str, str], by_name: bool
) -> None:
    axes, family = best
    agreed = found[best]
    other = found["body" if axes == "world" else "world", family]
    unit = next((u for u, f in UNITS["velocity"].items() if abs(1 / agreed.slope / f - 1) < 2 * by.FACTOR_OFF), None)
    said = (
        f"{'by their names' if by_name else 'no name says it'}; follows accelerometer and attitude ({agreed.in_words}"
    )
    said += f"; in {'body' if axes == 'world' else 'world'} axes {other.correlation:.2f})"
    question, more = "", {"unit": unit or OPEN, "axes": axes}
    attitude, own = own_axes
    if axes == "world" and own != attitude:
        draft.world, more["world"] = attitude, own
        said += f", its axes are {own} where those of the attitude are {attitude}"
    if unit is None or (family.unit in UNITS["velocity"] and family.unit != unit):
        question = f"the accelerometer asks for {1 / agreed.slope:.3g} m/s a unit"
        more["unit"] = OPEN
    if not by.is_clear(agreed, other):
        more["axes"] = _stated_axes(family)
        if more["axes"] == OPEN:
            question = " ".join(filter(None, (question, "in world or body axes? The flight hardly distinguishes them")))
    draft.put("velocity", family.columns, said, question, **more)


def _stated_axes(family: Family) -> str:
    """Axes that the names state."""
    return "body" if family.in_body else "world" if family.axes in ("ned", "enu") else OPEN


def _velocity_alone(draft: Draft, family: Family, found: dict) -> None:
    """A velocity by its names that accelerometer and attitude do not confirm; the position is looked at."""
    axes = _stated_axes(family)
    unit = family.unit if family.unit in UNITS["velocity"] else OPEN
    said, questions = [], []
    if found:
        agreed = max(found["world", family], found["body", family], key=lambda a: a.correlation)
        said.append(by.in_words(agreed, "velocity", "accelerometer and attitude"))
        if said[0].startswith("does not"):
            questions.append("is it a velocity? It does not follow accelerometer and attitude")
            unit = OPEN
    readings = _moved_by(draft, draft.values(family.columns))
    place = next((f for f in by.triples_of(draft) if named.is_named(f, "position") and f != family), None)
    if place is not None and readings and not questions:
        moved = draft.changes(draft.values(place.columns))
        seen = {name: by.compare(moved, values) for name, values in readings.items()}
        better = max(seen, key=lambda name: seen[name].correlation)
        if seen[better].correlation > by.CONFIRMED:
            said.append(f"integrates to the position in {better} axes ({seen[better].in_words})")
            others = [a for name, a in seen.items() if name != better]
            axes = better if all(by.is_clear(seen[better], a) for a in others) or axes == better else OPEN
    if axes == OPEN:
        questions.append("in world or body axes? Nothing in the table shows which")
    if unit == OPEN and len(questions) < 2:
        questions.append("in which unit?")
    draft.put(
        "velocity", family.columns, "; ".join(["by their names", *said]), " ".join(questions), unit=unit, axes=axes
    )


def _moved_by(draft: Draft, velocity: np.ndarray) -> dict[str, np.ndarray]:
    """Changes of place by a velocity (n, 3), by the axes that it may have; empty without a clock."""
    if draft.instants is None:
        return {}
    readings = {"world": draft.integrated(velocity)}
    if draft.wxyz is not None:
        readings["body"] = draft.integrated(by.into_world(draft.time_s, draft.wxyz, velocity))
    return readings


def guess_position(draft: Draft) -> None:
    triples = by.triples_of(draft)
    offered = [f for f in triples if named.is_named(f, "position")]
    candidates = offered or [f for f in triples if not f.words & named.OTHER_THINGS]
    speed = draft.channels.get("velocity")
    found: dict[Family, Agreement] = {}
    own_axes: dict[Family, tuple[str, str]] = {}
    if speed is not None and speed.unit != OPEN:
        readings = _moved_by(draft, draft.values(speed.columns) * UNITS["velocity"][speed.unit])
        readings = {name: moved for name, moved in readings.items() if speed.axes in (OPEN, name)}
        for family in candidates:
            changes = draft.changes(draft.values(family.columns)) if readings else None
            for moved in readings.values():
                agreed, axes = _in_any_axes(changes, moved, speed.world or draft.world)
                if agreed.correlation > found.get(family, Agreement()).correlation or family not in found:
                    found[family], own_axes[family] = agreed, axes
    best = max(found, key=lambda f: found[f].correlation, default=None)
    if best is not None and found[best].correlation >= (by.CONFIRMED if offered else by.BY_NUMBERS_ALONE):
        agreed = found[best]
        unit = by.unit_by_factor("length", 1 / agreed.slope)
        how = "by their names" if offered else "no name says it"
        evidence = f"{how}; the velocity integrates to it ({agreed.in_words})"
        question = "" if unit else f"the velocity asks for {1 / agreed.slope:.3g} m a unit"
        own = own_axes[best][1] if own_axes[best][1] != own_axes[best][0] else speed.world
        more = {"world": own} if own not in (None, draft.world, OPEN) else {}
        evidence += f", its axes are {own}" if more else ""
        draft.put("position", best.columns, evidence, question, unit=unit or OPEN, **more)
    elif offered:
        family = offered[0]
        # The unit of the changes is not known: only the correlation is looked at.
        off = family in found and found[family].correlation < by.CONTRADICTED
        seen = f"the velocity does not integrate to it ({found[family].in_words})" if off else "no velocity confirms it"
        unit = family.unit if family.unit in UNITS["length"] and not off else OPEN
        question = "is it a position? The velocity does not integrate to it" if off else "in which unit?"
        questions, more = [question] if unit == OPEN else [], {}
        z = draft.values(family.columns)[:, 2]
        z = z[np.isfinite(z)]
        # It begins at its lowest and rises by many times what it ever falls below.
        upward = len(z) > 1 and z.max() > 0 and z.max() - z[0] > 10 * max(z[0] - z.min(), 0.0)
        if draft.world == "ned" and upward:
            more = {"world": OPEN}
            questions.append(
                "z is never below its start: does it point up (neu) although that of the attitude is down?"
            )
        draft.put("position", family.columns, f"by their names; {seen}", " ".join(questions), unit=unit, **more)


def guess_height(draft: Draft) -> None:
    name = named.scalar(draft.free(), "height")
    if name is None:
        return
    values = draft.table[[name]].to_numpy(float)
    if not np.isfinite(values).any():
        return
    place = draft.channels.get("position")
    middle = float(np.nanmedian(np.abs(values)))
    stated = named.unit_of(name)
    if place is not None and place.unit != OPEN and draft.instants is not None:
        z = draft.values(place.columns)[:, [2]] * UNITS["length"][place.unit]
        agreed = by.compare(draft.changes(z), draft.changes(values))
        unit = by.unit_by_factor("length", abs(agreed.slope)) if agreed.slope else None
        if abs(agreed.correlation) > by.CONFIRMED and unit:
            draft.put("height", [name], f"by its name; changes as the position's z does ({agreed.in_words})", unit=unit)
            return
    if stated in UNITS["length"]:
        draft.put("height", [name], f"by its name; its median is {middle:.4g}", unit=stated)
    else:
        question = f"a height above ground, and in m, cm or mm? Its median is {middle:.4g}"
        draft.put("height", [name], "by its name", question, unit=OPEN)


@dataclass(frozen=True)
class _Turn:
    """One reading of columns as an attitude."""

    columns: tuple[str, ...]
    form: str
    wxyz: np.ndarray
    unit: str = ""
    inverse: bool = False
    signs: tuple[int, ...] | None = None
    """Of angles that are not all positive about the axes of the body."""


def _attitudes(draft: Draft) -> tuple[list[_Turn], str]:
    """Every reading of the columns that can be the attitude, and why they can."""
    free = draft.free()
    more = {n for f in named.numbered(free) if len(f.columns) > 4 for n in f.columns}  # nine are a matrix
    fours = [f for axes in named.FOURS for f in named.families(free, axes) if axes.isalpha() or not more & {*f.columns}]
    lengths = {f: np.linalg.norm(draft.values(f.columns), axis=1) for f in fours}
    unit = [f for f in fours if np.isfinite(lengths[f]).any() and abs(np.nanmedian(lengths[f]) - 1) < 0.02]
    offered = [f for f in unit if named.is_quaternion(f)] or [f for f in unit if not f.words & named.OTHER_THINGS]
    if offered:
        chosen = offered[0]
        values, turns = draft.values(chosen.columns), []
        how = "by their names" if named.is_quaternion(chosen) else "four columns"
        if chosen.axes == "wxyz":
            in_file = [n for n in draft.table.columns if n in chosen.columns]
            first = chosen.columns if in_file[0] == chosen.columns[0] else (*chosen.columns[1:], chosen.columns[0])
            form = "wxyz" if first == chosen.columns else "xyzw"
            turns = [_Turn(first, form, values)]
        else:
            turns = [_Turn(chosen.columns, "wxyz", values), _Turn(chosen.columns, "xyzw", values[:, [3, 0, 1, 2]])]
        inverse = [_Turn(t.columns, t.form, t.wxyz * [1, -1, -1, -1], inverse=True) for t in turns]
        return turns + inverse, f"{how}, of length {np.nanmedian(lengths[chosen]):.4g}"
    found, forms, why = named.angles(free), tuple(EULER), "roll, pitch, yaw by their names"
    if found is None:
        found, forms, why = named.rotation_vector(free), ("rotvec", "euler_xyz"), "three angles as Vicon names them"
    if found is None or not np.isfinite(values := draft.values(found[0])).all(axis=1).any():
        return [], ""
    columns, stated = found
    top = float(np.nanmax(np.abs(values)))
    by_size = ["rad", "deg"] if top < _MOST_RAD else ["deg"] if top < _MOST_DEG else ["ddeg", "cdeg", "mrad"]
    units = [stated] if stated in UNITS["angle"] else by_size
    turns = [_of_angles(columns, values, form, unit_) for unit_, form in product(units, forms)]
    return turns, why


def _of_angles(columns: tuple[str, ...], values: np.ndarray, form: str, unit: str, signs=None) -> _Turn:
    """Roll, pitch and yaw (n, 3) as an attitude, each times its sign."""
    known, wxyz = np.isfinite(values).all(axis=1), np.full((len(values), 4), np.nan)
    if known.any():
        angles = values[known] * UNITS["angle"][unit] * (signs or (1, 1, 1))
        wxyz[known] = from_angles(angles, form).as_quat()[:, [3, 0, 1, 2]]
    return _Turn(columns, form, wxyz, unit, signs=signs)


def guess_attitude_and_rates(draft: Draft) -> None:
    turns, why = _attitudes(draft)
    triples = by.triples_of(draft)
    rates = {"rad": "rad/s", "deg": "deg/s", "mrad": "mrad/s"}  # `gyro_rad` of PX4
    offered = [replace(f, unit=rates.get(f.unit, f.unit)) for f in triples if named.is_named(f, "angular_velocity")]
    found: dict[tuple[int, Family], Agreement] = {}

    def look(first: int) -> None:
        for k, turn in enumerate(turns[first:], first):
            moved = by.turned(draft.instants, draft.time_s, by.signed_continuous(turn.wxyz))
            for family in offered or triples:
                found[k, family] = by.compare(moved, draft.integrated(draft.values(family.columns)))

    if draft.instants is not None:
        look(0)
        best = max(found, key=lambda key: _rank(found[key], turns[key[0]]), default=None)
        # Whether no reading of angles as they are agrees about each axis.
        other_signs = best is not None and (
            found[best].correlation < by.CONFIRMED or min(found[best].by_axis) < -by.CONTRADICTED
        )
        if turns and turns[0].form in EULER and offered and other_signs:
            # Pitch may be positive nose down and yaw a heading, whatever the axes of the gyroscope.
            count, values = len(turns), draft.values(turns[0].columns)
            signs = list(product((1, -1), repeat=3))[1:]
            turns += [_of_angles(t.columns, values, t.form, t.unit, own) for t in turns[:count] for own in signs]
            look(count)
    best = max(found, key=lambda key: _rank(found[key], turns[key[0]]), default=None)
    if best is not None:
        agreed, family = found[best], best[1]
        enough = by.CONFIRMED if offered else by.BY_NUMBERS_ALONE
        if agreed.correlation >= enough and agreed.size > by.MOVES["angle"]:
            _confirmed(draft, turns, found, best, why, bool(offered))
            return
        turns = [t for t in turns if t.signs is None]
        if offered:
            _rates_alone(
                draft, offered[0], by.in_words(agreed, "angle", "the attitude"), _mirrored(draft, turns, family)
            )
    elif offered:
        _rates_alone(draft, offered[0], "", "")
    if turns:
        _attitude_alone(draft, turns, why)


def _rank(agreed: Agreement, turn: _Turn) -> float:
    """Correlation of a reading; a factor that no unit has, and an attitude that must be inverted, rank lower."""
    fits = any(abs(agreed.slope / f - 1) < by.FACTOR_OFF for f in UNITS["rate"].values())
    straight = not turn.inverse and turn.signs is None
    return agreed.correlation - (0.0 if fits else 0.05) - (0.0 if straight else 0.02)


def _confirmed(draft: Draft, turns: list[_Turn], found: dict, best: tuple[int, Family], why: str, by_name: bool):
    """Attitude and gyroscope that integrate to each other."""
    agreed, turn, family = found[best], turns[best[0]], best[1]
    unit = by.unit_by_factor("rate", agreed.slope)
    question = ""
    if unit is None:
        unit = OPEN
        question = (
            f"its integral is {1 / agreed.slope:.3g} times the attitude's change, which fits no unit (if these are "
            f"counts: unit: rad/s, scale: {agreed.slope:.4g})"
        )
    elif family.unit and family.unit != unit:
        question, unit = f"its names say {family.unit}, the attitude {unit}", OPEN
    how = "by their names" if by_name else "no name says it"
    draft.put(
        "angular_velocity",
        family.columns,
        f"{how}; integrates to the attitude ({agreed.in_words})",
        question,
        unit=unit,
    )
    alike = {k for k, t in enumerate(turns) if (t.unit, t.signs) == (turn.unit, turn.signs)}
    others = [a for (k, f), a in found.items() if k in alike and f == family and turns[k].form != turn.form]
    runner_up = max(others, key=lambda a: a.correlation, default=Agreement())
    more = ({"unit": turn.unit} if turn.unit else {}) | ({"signs": turn.signs} if turn.signs else {})
    draft.compass = turn.signs is not None and turn.signs[2] < 0
    question, form = "", turn.form
    if turn.inverse:
        question, form = "it turns the world into the body: change the signs of x, y, z (or that of w)", OPEN
    elif not by.is_clear(agreed, runner_up) and form in THREE:
        apart = _apart([turns[k] for k in alike], turn.unit)
        form, question = (turns[0].form, "") if apart < _SAME_ORDER_RAD else (OPEN, _which_order(apart, turns[0].form))
        why += f", {np.degrees(apart):.2g}° apart at most in the two orders"
    elif not by.is_clear(agreed, runner_up):
        question, form = f"the gyroscope hardly decides the order ({runner_up.correlation:.2f} for the other)", OPEN
    draft.put(
        "attitude",
        turn.columns,
        f"{why}; follows the gyroscope ({agreed.in_words}"
        + (f", in the other order {runner_up.correlation:.2f})" if others else ")"),
        question,
        form=form,
        **more,
    )
    if form != OPEN:
        own = (form, turn.unit, turn.signs)
        draft.wxyz = by.signed_continuous(next(t for t in turns if (t.form, t.unit, t.signs) == own).wxyz)


def _apart(turns: list[_Turn], unit: str) -> float:
    """How far the readings of roll, pitch and yaw in the two orders are apart in nearly all of a table, rad."""
    first, second = (by.rotations(t.wxyz) for t in turns if t.unit == unit)
    if first is None or second is None:
        return 0.0
    return float(np.quantile((first[0].inv() * second[0]).magnitude(), 0.95))


def _which_order(apart: float, first: str) -> str:
    """The question of the form of three angles, the first of which is `first`."""
    what = "one turn about an axis" if first == "rotvec" else "yaw, then pitch, then roll: z-y'-x''"
    return (
        f"{first} ({what}) or euler_xyz (roll first: x-y'-z'', usual in motion captures)? "
        f"The two are {np.degrees(apart):.2g}° apart here, and no gyroscope shows which"
    )


def _mirrored(draft: Draft, turns: list[_Turn], family: Family) -> str:
    """A question where the gyroscope follows the attitude with two axes reversed: other body axes; else empty."""
    reversed_ = draft.integrated(draft.values(family.columns) * [1, -1, -1])
    for turn in turns:
        moved = by.turned(draft.instants, draft.time_s, by.signed_continuous(turn.wxyz))
        agreed = by.compare(moved, reversed_)
        if not turn.inverse and agreed.correlation > by.CONFIRMED and agreed.size > by.MOVES["angle"]:
            return (
                f"with y and z reversed it integrates to the attitude ({agreed.in_words}): the two have different "
                "body axes; write a table in which they have the same"
            )
    return ""


def _rates_alone(draft: Draft, family: Family, seen: str, mirrored: str) -> None:
    """A gyroscope that is named so and that the attitude does not confirm."""
    size = np.linalg.norm(draft.values(family.columns), axis=1)
    top = float(np.nanquantile(size, 0.99))
    evidence = f"by their names; 99 % of the rates are below {top:.3g}" + (f"; {seen}" if seen else "")
    if mirrored or seen.startswith("does not"):
        draft.put("angular_velocity", family.columns, evidence, mirrored or seen, unit=OPEN)
    elif family.unit in UNITS["rate"]:
        draft.put("angular_velocity", family.columns, evidence, unit=family.unit)
    else:
        which = "deg/s, mrad/s or counts (then with a scale)" if top > by.FASTEST_GYRO_RAD_S else "rad/s or deg/s"
        question = f"{which}: neither the names nor an attitude show which"
        draft.put("angular_velocity", family.columns, evidence, question, unit=OPEN)


def _attitude_alone(draft: Draft, turns: list[_Turn], why: str) -> None:
    """An attitude that no gyroscope confirms: a usual flight is level most of the time."""
    level = []
    for turn in turns:
        norm = np.linalg.norm(turn.wxyz, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            upright = 1 - 2 * (turn.wxyz[:, 1] ** 2 + turn.wxyz[:, 2] ** 2) / norm**2
        level.append(float(np.nanmedian(np.abs(upright))) if np.isfinite(upright).any() else 0.0)
    straight = [k for k, t in enumerate(turns) if not t.inverse]
    straight_turns = [turns[k] for k in straight]
    first = straight_turns[0]
    if len({(t.form, t.unit) for t in turns if not t.inverse}) == 1:
        more = {"unit": first.unit} if first.unit else {}
        draft.put("attitude", first.columns, why, form=first.form, **more)
        draft.wxyz = by.signed_continuous(first.wxyz)
        return
    ranked = sorted(straight, key=lambda k: -level[k])
    said = ", ".join(f"{turns[k].form or turns[k].unit} {level[k]:.2f}" for k in straight)
    chosen = turns[ranked[0]]
    if first.form not in THREE and level[ranked[0]] > 0.95 and level[ranked[1]] < 0.8:
        evidence = f"{why}; level most of the time in this order (cosine of the tilt: {said})"
        draft.put("attitude", chosen.columns, evidence, form=chosen.form)
        draft.wxyz = by.signed_continuous(chosen.wxyz)
    elif first.form in THREE:
        units = list(dict.fromkeys(t.unit for t in straight_turns))
        unit = units[0] if len(units) == 1 else OPEN
        apart = max(_apart(straight_turns, u) for u in units)
        form = first.form if apart < _SAME_ORDER_RAD else OPEN
        asked = [f"{' or '.join(units)}: no gyroscope shows which"] * (unit == OPEN)
        asked += [_which_order(apart, first.form)] * (form == OPEN)
        signs = {} if np.nanmax(np.abs(draft.values(first.columns))) < _MOST_DEG else {"signs": OPEN}
        if signs:  # as firmwares write them that have axes of their own
            asked.append(
                "signs of roll, pitch and yaw as the body's axes want them ([1, -1, 1] where nose down counts)"
            )
        draft.put("attitude", first.columns, why, "; ".join(asked), form=form, unit=unit, **signs)
        if not asked:
            draft.wxyz = by.signed_continuous(first.wxyz)
    else:
        question = f"wxyz or xyzw: no gyroscope shows which (cosine of the tilt: {said})"
        draft.put("attitude", first.columns, why, question, form=OPEN)
