"""Attitude and gyroscope, which integrate to each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import Agreement
from rotorid.recordings.importers.guessing.draft import (
    BY_NUMBERS_ALONE,
    CONFIRMED,
    FACTOR_OFF,
    FASTEST_GYRO_RAD_S,
    MOVES,
    Draft,
    in_words,
    is_clear,
    signed_continuous,
    triples_of,
    unit_by_factor,
)
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import EULER, OPEN, from_angles
from rotorid.recordings.importers.units import UNITS

_MOST_RAD, _MOST_DEG = 7.0, 400.0
"""Largest angle in rad, and in degrees."""
_SAME_ORDER_RAD = np.radians(2.0)
"""Where the two orders of roll, pitch and yaw are no farther apart, the usual one is taken without a question."""


@dataclass(frozen=True)
class _Turn:
    """One reading of columns as an attitude."""

    columns: tuple[str, ...]
    form: str
    wxyz: np.ndarray
    unit: str = ""
    inverse: bool = False


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
    found = named.angles(free)
    if found is None or not np.isfinite(values := draft.values(found[0])).all(axis=1).any():
        return [], ""
    columns, stated = found
    top = float(np.nanmax(np.abs(values)))
    by_size = ["rad", "deg"] if top < _MOST_RAD else ["deg"] if top < _MOST_DEG else ["cdeg", "mrad"]
    units = [stated] if stated in UNITS["angle"] else by_size
    turns = []
    known = np.isfinite(values).all(axis=1)
    for unit_, form in product(units, EULER):
        wxyz = np.full((len(values), 4), np.nan)
        if known.any():
            wxyz[known] = from_angles(values[known] * UNITS["angle"][unit_], form).as_quat()[:, [3, 0, 1, 2]]
        turns.append(_Turn(columns, form, wxyz, unit_))
    return turns, "roll, pitch, yaw by their names"


def guess_attitude_and_rates(draft: Draft) -> None:
    turns, why = _attitudes(draft)
    triples = triples_of(draft)
    rates = {"rad": "rad/s", "deg": "deg/s", "mrad": "mrad/s"}  # `gyro_rad` of PX4
    offered = [replace(f, unit=rates.get(f.unit, f.unit)) for f in triples if named.is_named(f, "angular_velocity")]
    found: dict[tuple[int, Family], Agreement] = {}
    if draft.instants is not None:
        for k, turn in enumerate(turns):
            moved = by.turned(draft.instants, draft.time_s, signed_continuous(turn.wxyz))
            for family in offered or triples:
                found[k, family] = by.compare(moved, draft.integrated(draft.values(family.columns)))
    best = max(found, key=lambda key: _rank(found[key], turns[key[0]]), default=None)
    if best is not None:
        agreed, family = found[best], best[1]
        enough = CONFIRMED if offered else BY_NUMBERS_ALONE
        if agreed.correlation >= enough and agreed.size > MOVES["angle"]:
            _confirmed(draft, turns, found, best, why, bool(offered))
            return
        if offered:
            _rates_alone(draft, offered[0], in_words(agreed, "angle", "the attitude"), _mirrored(draft, turns, family))
    elif offered:
        _rates_alone(draft, offered[0], "", "")
    if turns:
        _attitude_alone(draft, turns, why)


def _rank(agreed: Agreement, turn: _Turn) -> float:
    """Correlation of a reading; a factor that no unit has, and an attitude that must be inverted, rank lower."""
    fits = any(abs(agreed.slope / f - 1) < FACTOR_OFF for f in UNITS["rate"].values())
    return agreed.correlation - (0.0 if fits else 0.05) - (0.02 if turn.inverse else 0.0)


def _confirmed(draft: Draft, turns: list[_Turn], found: dict, best: tuple[int, Family], why: str, by_name: bool):
    """Attitude and gyroscope that integrate to each other."""
    agreed, turn, family = found[best], turns[best[0]], best[1]
    unit = unit_by_factor("rate", agreed.slope)
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
    others = [a for (k, f), a in found.items() if f == family and turns[k].form != turn.form]
    runner_up = max(others, key=lambda a: a.correlation, default=Agreement())
    more = {"unit": turn.unit} if turn.unit else {}
    question, form = "", turn.form
    if turn.inverse:
        question, form = "it turns the world into the body: change the signs of x, y, z (or that of w)", OPEN
    elif not is_clear(agreed, runner_up) and form in EULER:
        apart = _apart(turns, turn.unit)
        form, question = ("euler", "") if apart < _SAME_ORDER_RAD else (OPEN, _which_order(apart))
        why += f", {np.degrees(apart):.2g}° apart at most in the two orders"
    elif not is_clear(agreed, runner_up):
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
        draft.wxyz = signed_continuous(next(t for t in turns if (t.form, t.unit) == (form, turn.unit)).wxyz)


def _apart(turns: list[_Turn], unit: str) -> float:
    """How far the readings of roll, pitch and yaw in the two orders are apart in nearly all of a table, rad."""
    first, second = (by.rotations(t.wxyz) for t in turns if t.unit == unit)
    if first is None or second is None:
        return 0.0
    return float(np.quantile((first[0].inv() * second[0]).magnitude(), 0.95))


def _which_order(apart: float) -> str:
    return (
        "euler (yaw, then pitch, then roll: z-y'-x'') or euler_xyz (roll first: x-y'-z'', usual in motion captures)? "
        f"The two are {np.degrees(apart):.2g}° apart here, and no gyroscope shows which"
    )


def _mirrored(draft: Draft, turns: list[_Turn], family: Family) -> str:
    """A question where the gyroscope follows the attitude with two axes reversed: other body axes; else empty."""
    reversed_ = draft.integrated(draft.values(family.columns) * [1, -1, -1])
    for turn in turns:
        moved = by.turned(draft.instants, draft.time_s, signed_continuous(turn.wxyz))
        agreed = by.compare(moved, reversed_)
        if not turn.inverse and agreed.correlation > CONFIRMED and agreed.size > MOVES["angle"]:
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
        which = "deg/s, mrad/s or counts (then with a scale)" if top > FASTEST_GYRO_RAD_S else "rad/s or deg/s"
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
        draft.wxyz = signed_continuous(first.wxyz)
        return
    ranked = sorted(straight, key=lambda k: -level[k])
    said = ", ".join(f"{turns[k].form or turns[k].unit} {level[k]:.2f}" for k in straight)
    chosen = turns[ranked[0]]
    if first.form not in EULER and level[ranked[0]] > 0.95 and level[ranked[1]] < 0.8:
        evidence = f"{why}; level most of the time in this order (cosine of the tilt: {said})"
        draft.put("attitude", chosen.columns, evidence, form=chosen.form)
        draft.wxyz = signed_continuous(chosen.wxyz)
    elif first.form in EULER:
        units = list(dict.fromkeys(t.unit for t in straight_turns))
        unit = units[0] if len(units) == 1 else OPEN
        apart = max(_apart(straight_turns, u) for u in units)
        form = "euler" if apart < _SAME_ORDER_RAD else OPEN
        asked = ["rad or deg: no gyroscope shows which"] * (unit == OPEN) + [_which_order(apart)] * (form == OPEN)
        draft.put("attitude", first.columns, why, "; ".join(asked), form=form, unit=unit)
        if not asked:
            draft.wxyz = signed_continuous(first.wxyz)
    else:
        question = f"wxyz or xyzw: no gyroscope shows which (cosine of the tilt: {said})"
        draft.put("attitude", first.columns, why, question, form=OPEN)
