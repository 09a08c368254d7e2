"""Velocity, position and height."""

from __future__ import annotations

import numpy as np

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import Agreement
from rotorid.recordings.importers.guessing.draft import (
    BY_NUMBERS_ALONE,
    CONFIRMED,
    CONTRADICTED,
    FACTOR_OFF,
    Draft,
    in_words,
    is_clear,
    triples_of,
    unit_by_factor,
)
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import OPEN, TRAVEL
from rotorid.recordings.importers.units import UNITS


def _gained(draft: Draft) -> np.ndarray | None:
    """Changes of velocity by accelerometer and attitude in the axes of the recorded world, m/s; None without both."""
    force = draft.channels.get("specific_force")
    if force is None or force.unit == OPEN or draft.wxyz is None or draft.instants is None:
        return None
    values = draft.values(force.columns) * UNITS["acceleration"][force.unit]
    return draft.integrated(by.into_world(draft.time_s, draft.wxyz, values))


def guess_velocity(draft: Draft) -> None:
    triples = triples_of(draft)
    offered = [f for f in triples if named.is_named(f, "velocity")]
    gained = _gained(draft)
    candidates = offered or [
        f for f in triples if not f.words & named.OTHER_THINGS and not named.is_named(f, "position")
    ]
    found: dict[tuple[str, Family], Agreement] = {}
    others: dict[Family, tuple[str, str]] = {}
    if gained is not None:
        for family in candidates:
            values = draft.values(family.columns)
            found["world", family], others[family] = _in_any_axes(draft.changes(values), gained, draft.world)
            found["body", family] = by.compare(draft.changes(by.into_world(draft.time_s, draft.wxyz, values)), gained)
    best = max(found, key=lambda key: found[key].correlation, default=None)
    enough = CONFIRMED if offered else BY_NUMBERS_ALONE
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
            turned = min(same.by_axis) < -CONTRADICTED and min(seen.by_axis) > CONTRADICTED
            if (is_clear(seen, same) or turned) and seen.correlation > best.correlation:
                best, axes = seen, (attitude, own)
    return best, axes


def _own_axes(draft: Draft, axes: tuple[str, str]) -> tuple[dict[str, str], str]:
    """What a mapping states where a channel has other axes than the attitude, and the same in words."""
    attitude, own = axes
    if own == attitude:
        return {}, ""
    draft.world = attitude
    return {"world": own}, f", its axes are {own} where those of the attitude are {attitude}"


def _velocity_confirmed(
    draft: Draft, best: tuple[str, Family], found: dict, own_axes: tuple[str, str], by_name: bool
) -> None:
    axes, family = best
    agreed = found[best]
    other = found["body" if axes == "world" else "world", family]
    unit = next((u for u, f in UNITS["velocity"].items() if abs(1 / agreed.slope / f - 1) < 2 * FACTOR_OFF), None)
    said = (
        f"{'by their names' if by_name else 'no name says it'}; follows accelerometer and attitude ({agreed.in_words}"
    )
    said += f"; in {'body' if axes == 'world' else 'world'} axes {other.correlation:.2f})"
    question = ""
    more = {"unit": unit or OPEN, "axes": axes}
    if axes == "world":
        other_axes, words = _own_axes(draft, own_axes)
        more, said = more | other_axes, said + words
    if unit is None or (family.unit in UNITS["velocity"] and family.unit != unit):
        question = f"the accelerometer asks for {1 / agreed.slope:.3g} m/s a unit"
        more["unit"] = OPEN
    if not is_clear(agreed, other):
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
        said.append(in_words(agreed, "velocity", "accelerometer and attitude"))
        if said[0].startswith("does not"):
            questions.append("is it a velocity? It does not follow accelerometer and attitude")
            unit = OPEN
    readings = _moved_by(draft, draft.values(family.columns))
    place = next((f for f in triples_of(draft) if named.is_named(f, "position") and f != family), None)
    if place is not None and readings and not questions:
        moved = draft.changes(draft.values(place.columns))
        seen = {name: by.compare(moved, values) for name, values in readings.items()}
        better = max(seen, key=lambda name: seen[name].correlation)
        if seen[better].correlation > CONFIRMED:
            said.append(f"integrates to the position in {better} axes ({seen[better].in_words})")
            others = [a for name, a in seen.items() if name != better]
            axes = better if all(is_clear(seen[better], a) for a in others) or axes == better else OPEN
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
    triples = triples_of(draft)
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
    if best is not None and found[best].correlation >= (CONFIRMED if offered else BY_NUMBERS_ALONE):
        agreed = found[best]
        unit = unit_by_factor("length", 1 / agreed.slope)
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
        off = family in found and found[family].correlation < CONTRADICTED
        seen = f"the velocity does not integrate to it ({found[family].in_words})" if off else "no velocity confirms it"
        unit = family.unit if family.unit in UNITS["length"] and not off else OPEN
        question = "is it a position? The velocity does not integrate to it" if off else "in which unit?"
        questions, more = [question] if unit == OPEN else [], {}
        if draft.world == "ned" and _is_up(draft.values(family.columns)[:, 2]):
            more = {"world": OPEN}
            questions.append(
                "z is never below its start: does it point up (neu) although that of the attitude is down?"
            )
        draft.put("position", family.columns, f"by their names; {seen}", " ".join(questions), unit=unit, **more)


def _is_up(z: np.ndarray) -> bool:
    """Whether a vertical place (n,) begins at its lowest and rises by many times what it ever falls below."""
    known = z[np.isfinite(z)]
    return len(known) > 1 and known.max() > 0 and known.max() - known[0] > 10 * max(known[0] - known.min(), 0.0)


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
        unit = unit_by_factor("length", abs(agreed.slope)) if agreed.slope else None
        if abs(agreed.correlation) > CONFIRMED and unit:
            draft.put("height", [name], f"by its name; changes as the position's z does ({agreed.in_words})", unit=unit)
            return
    if stated in UNITS["length"]:
        draft.put("height", [name], f"by its name; its median is {middle:.4g}", unit=stated)
    else:
        question = f"a height above ground, and in m, cm or mm? Its median is {middle:.4g}"
        draft.put("height", [name], "by its name", question, unit=OPEN)
