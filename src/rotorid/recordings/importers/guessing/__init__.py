"""What the columns of a table are, proposed from their names and confirmed or refused by their numbers.

Each guess has its evidence. Names propose. Numbers decide what names leave open and refuse what they contradict: a
gyroscope integrates to the attitude, an accelerometer turned by the attitude to the velocity, a velocity to the
position; an accelerometer reads 9.8 m/s² in hover, a quaternion has length 1. What neither settles is left open as `?`.

Here: the clock of a table, battery and temperature, and the accelerometer with the axes of body and world.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
import yaml

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings.importers.faults import alive_s, goes_on, in_order, join_rows
from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.agreement import CONFIRMED, RATES_HZ, Draft, triples_of
from rotorid.recordings.importers.guessing.motion import (
    guess_attitude_and_rates,
    guess_height,
    guess_position,
    guess_velocity,
)
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.guessing.rotors import guess_rotors, guess_stand, six_axes
from rotorid.recordings.importers.mapping import BODY, CHANNELS, OPEN, UNITS, WORLD, G, Mapping, converted, stated
from rotorid.recordings.tables import numbers

_USUAL = {"voltage": (60.0, 2.5, 60.0), "current": (60.0, 0.0, 150.0), "temperature": (60.0, -30.0, 130.0)}
"""To a kind the largest median that is plainly in the contract's unit, and between what limits it lies, V, A, °C."""

_USUAL_ACCELERATIONS = ("m/s2", "g", "mg")
"""Units of accelerometers that names need not state; counts can be as large as others."""


def guess(table: pd.DataFrame) -> Draft:
    """A mapping proposed for a table of any columns; those with a cell that is no number take no part."""
    layout = table.attrs.get("layout")
    kept, left_out = {}, []
    if layout and layout.above:
        first = layout.above[0][:150]
        left_out.append(f"left out: {len(layout.above)} lines above the heading, the first of them: {first}")
    for name in table.columns:
        try:
            kept[name] = numbers(table[[name]], "left out")[name]
        except InputError as error:
            left_out.append(str(error))
    draft = Draft(pd.DataFrame(kept), left_out=left_out)
    _guess_time(draft)
    for name in ("battery_voltage", "battery_current", "temperature"):
        _guess_scalar(draft, name)
    guess_attitude_and_rates(draft)
    _guess_specific_force(draft)
    body, draft.world = _guess_frames(draft)
    guess_velocity(draft)
    guess_position(draft)
    guess_height(draft)
    for name in ("rotor_command", "rotor_speed", "throttle"):
        guess_rotors(draft, name)
    guess_stand(draft)
    body, world = _axes_that_matter(draft, body, draft.world)
    draft.mapping = Mapping(body=body, world=world, channels=draft.channels, keep=tuple(draft.free()))
    return draft


def as_text(found: Draft, source: str) -> str:
    """A mapping file in which each line has its evidence, and what is open is marked."""
    mapping, source = found.mapping, printable(source)
    lines = [f"# What the columns of {source} are, proposed by rotorid from names and numbers. Look through it, then:"]
    lines += [f"#   rotorid import {source} --mapping THIS_FILE --mass-kg … --like …"]
    if found.open:
        said = f"# Nothing is imported while a {OPEN!r} is left: write the answer in its place, or remove the channel."
        lines.append(said)
    lines += [f"# {printable(sentence)}" for sentence in found.left_out]
    for key, words in (("body", " | ".join(BODY)), ("world", " | ".join(WORLD))):
        lines += _comment(found, key, "")
        value = getattr(mapping, key)
        lines.append(f"{key}: {value if value != OPEN else repr(OPEN)}   # {words}")
    lines.append("channels:")
    for name, channel in mapping.channels.items():
        content = channel.model_dump(exclude_defaults=True)
        if name == "attitude":
            content["form"] = channel.form
        if name == "velocity":
            content["axes"] = channel.axes
        content = {k: list(v) if isinstance(v, tuple) else v for k, v in content.items()}
        lines += _comment(found, name, "  ")
        lines.append(f"  {name}: {_in_one_line(content)}")
    kept = _in_one_line(list(mapping.keep))
    lines.append(f"keep: {kept}   # other columns, kept as candidates for what an error depends on")
    return "\n".join(lines) + "\n"


def _in_one_line(content: dict | list) -> str:
    return yaml.safe_dump(content, default_flow_style=True, width=10**6, sort_keys=False, allow_unicode=True).strip()


def _comment(found: Draft, key: str, indent: str) -> list[str]:
    lines = [f"{indent}# {printable(found.evidence[key])}"] if found.evidence.get(key) else []
    return lines + ([f"{indent}# OPEN: {printable(found.open[key])}"] if key in found.open else [])


def _guess_time(draft: Draft) -> None:
    slowest_stand_hz = 0.05  # Steady points of a stand may come so seldom.
    moves_on = 0.5  # Share of the rows in which a clock moves on at least.
    name = named.scalar(draft.table.columns, "time")
    if name is None:
        question = "no column is named as a time, and without one nothing can be imported"
        if frame := next((str(n) for n in draft.table if str(n).lower() == "frame"), ""):
            question += f" (columns: [{frame}], unit: s, scale: 0.01 where 100 frames come in a second)"
        draft.put("time", [OPEN], "", question, unit=OPEN)
        return
    draft.table = join_rows(in_order(draft.table, name)[0], name)
    values = draft.table[name].to_numpy(float)
    steps = np.diff(values[np.isfinite(values)])
    moves = float((steps > 0).mean()) if len(steps) else 0.0
    steps = steps[steps > 0]
    usual = float(np.median(steps)) if len(steps) else np.nan
    stand = any(named.scalar(draft.table.columns, quantity) for quantity in ("thrust", "torque")) or six_axes(draft)
    slowest = slowest_stand_hz if stand else RATES_HZ[0]
    fits = [u for u, f in UNITS["time"].items() if slowest <= 1 / (usual * f) <= RATES_HZ[1]] if usual > 0 else []
    stated = named.time_unit(name)
    seen = f"its usual step is {usual:.6g}"
    if stated and (stated in fits or not fits):
        unit, evidence, question = stated, f"by its name; {seen}", ""
    elif not stated and len(fits) == 1:
        unit, evidence, question = fits[0], f"by its name; {seen}, which in {fits[0]} is a rate of recording", ""
    else:
        unit, evidence = OPEN, f"by its name; {seen}"
        question = f"its name says {stated}, its step {' or '.join(fits)}" if stated else "its unit is not clear"
    if moves < moves_on:
        unit, question = OPEN, f"it moves on in {moves:.0%} of the rows: is its fraction in another column?"
    draft.put("time", [name], evidence, question, unit=unit)
    if unit != OPEN and len(steps):
        _set_clock(draft, values * UNITS["time"][unit])


def _set_clock(draft: Draft, time_s: np.ndarray) -> None:
    """Keep the rows in which the clock moves on; no comparison is made without enough of them."""
    latest = np.maximum.accumulate(np.where(np.isfinite(time_s), time_s, -np.inf))
    on = np.isfinite(time_s) & (np.concatenate([[-np.inf], latest[:-1]]) < time_s)
    if on.sum() < 20:
        return
    draft.table, draft.time_s = draft.table[on].reset_index(drop=True), time_s[on]
    span, usual = draft.time_s[-1] - draft.time_s[0], float(np.median(np.diff(draft.time_s)))
    if span > 1e4 * max(by.STEP_S, usual):  # hours, or a clock that jumps
        draft.time_s = None
        return
    draft.instants = by.steps_of(draft.time_s)


def _guess_scalar(draft: Draft, quantity: str) -> None:
    name = named.scalar(draft.free(), quantity)
    if name is None:
        return
    values = draft.table[name].to_numpy(float)
    if not np.isfinite(values).any():
        return
    middle = float(np.nanmedian(values if quantity == "temperature" else np.abs(values)))
    kind = CHANNELS[quantity][0]
    said, fits = stated(name, kind), _fitting(kind, middle)
    evidence, question = f"by its name; its median is {middle:.4g}", ""
    if said and (said in fits or not fits):
        unit = said
    elif said:
        unit, question = OPEN, f"its name says {said}, its median of {middle:.4g} {' or '.join(fits)}"
    elif len(fits) == 1:
        unit = fits[0]
    else:
        unit = OPEN
        question = f"its unit is not clear: a median of {middle:.4g} can be {' or '.join(fits or UNITS[kind])}"
    draft.put(quantity, [name], evidence, question, unit=unit)


def _fitting(kind: str, middle: float) -> list[str]:
    """Units in which a median is what batteries and vehicles have; the contract's own where it is plainly that."""
    plain, low, high = _USUAL[kind]
    if low <= middle <= plain:
        return [next(iter(UNITS[kind]))]
    return [u for u in UNITS[kind] if low <= float(converted(np.array(middle), kind, u)) <= high]


def _guess_specific_force(draft: Draft) -> None:
    triples = triples_of(draft)
    of_stand = set(six_axes(draft).values())
    offered = [f for f in triples if named.is_named(f, "specific_force") and f not in of_stand]
    norms = {f: float(np.nanmedian(np.linalg.norm(draft.values(f.columns), axis=1))) for f in triples}
    fits = [f for f in offered if _force_unit(f, norms[f])]
    if fits:
        family, stuck = _first_that_goes_on(draft, fits)
        unit = _force_unit(family, norms[family])
        read = norms[family] * UNITS["acceleration"][unit]
        evidence = f"by their names; the median of its norm is {norms[family]:.4g} {unit} ({read:.3g} m/s²){stuck}"
        draft.put("specific_force", family.columns, evidence, unit=unit)
    elif offered:
        family, read = offered[0], norms[offered[0]]
        evidence = f"by their names; the median of its norm is {read:.4g}"
        power = 2 ** round(float(np.log2(read))) if read >= 3 else 0  # as sensors have counts to 1 g
        question = f"a median of {read:.4g} is 1 g in no unit" + (
            ": is gravity removed? Then it is no accelerometer's reading; remove the channel"
            if read < 3
            else f"; if these are counts: unit: g, scale: what one count is (about {1 / read:.4g}, or 1/{power})"
        )
        draft.put("specific_force", family.columns, evidence, question, unit=OPEN)
    else:
        offered = (f for f in triples if not f.words & named.OTHER_THINGS and abs(norms[f] / G - 1) < 0.1)
        near = [f for f in offered if _upright(draft, f)]
        if len(near) == 1:
            evidence = f"no name says it; the median of its norm is {norms[near[0]]:.4g}, along z"
            draft.put("specific_force", near[0].columns, evidence, unit="m/s2")


def _first_that_goes_on(draft: Draft, families: list[Family]) -> tuple[Family, str]:
    """Of several sensors the first that goes on changing as long as any, and in words which one does not."""
    alive, rows = {}, np.arange(len(draft.table), dtype=float)
    for number, family in enumerate(families):
        values = draft.values(family.columns)
        known = np.isfinite(values).all(axis=1)
        alive[number] = alive_s((rows if draft.time_s is None else draft.time_s)[known], values[known])
    taken, faults = goes_on(alive, "sensor")
    return families[taken], f"; {families[0].columns[0]} and its like stand still or end early" if faults else ""


def _force_unit(family: Family, norm: float) -> str:
    """The unit in which a median norm is about 1 g, empty where there is none or the names say another."""
    among = [family.unit] if family.unit in UNITS["acceleration"] else _USUAL_ACCELERATIONS
    return next((u for u in among if 0.7 < norm * UNITS["acceleration"][u] / G < 1.6), "")


def _upright(draft: Draft, family: Family) -> bool:
    values = draft.values(family.columns)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.abs(values[:, 2]) / np.linalg.norm(values, axis=1)
    return float(np.nanmedian(share)) > 0.95


def _guess_frames(draft: Draft) -> tuple[str, str]:
    """Body axes by the sign of the accelerometer's z in flight; the world's z by where the attitude turns it to."""
    stand = six_axes(draft).get("force")
    force = stand or draft.channels.get("specific_force")
    if force is None:
        return _frames_without_accelerometer(draft)
    values = draft.values(force.columns)
    size = np.linalg.norm(values, axis=1)
    strong = size > 0.5 * np.nanmax(size) if stand else np.full(len(size), True)
    with np.errstate(invalid="ignore", divide="ignore"):
        _, y, z = np.nanmedian((values / size[:, None])[strong], axis=0)
    body = "frd" if z < -0.8 else "flu" if z > 0.8 else "fur" if y > 0.8 else OPEN
    axis, share = ("y", y) if body == "fur" else ("z", z)
    draft.evidence["body"] = (
        f"the {'force' if stand else 'accelerometer'}'s {axis} reads {share:+.2f} of its norm in the median"
    )
    if body == OPEN:
        draft.open["body"] = "frd reads -1 along z, flu +1, fur +1 along y in level flight"
    if draft.wxyz is None or draft.time_s is None:
        draft.open["world"] = "ned, enu or nwu: without an attitude of known order nothing shows which way z points"
        return body, OPEN
    turned = by.into_world(draft.time_s, draft.wxyz, values)
    up = np.nanmedian(turned / np.linalg.norm(turned, axis=1, keepdims=True), axis=0)
    return body, _world(draft, up, "the accelerometer turned by the attitude")


def _world(draft: Draft, up: np.ndarray, what: str) -> str:
    """World axes by the upward direction (3,) along them."""
    axis = "y" if up[1] > 0.8 else "z"
    draft.evidence["world"] = f"{what} points to {up['xyz'.index(axis)]:+.2f} along the world's {axis} in the median"
    if axis == "y":
        return "nue"
    if abs(up[2]) < 0.8:
        draft.open["world"] = (
            "up should be -1 (ned) or +1 (enu, nwu) along z, or +1 along y (nue): does the attitude turn the body into "
            "the world?"
        )
        return OPEN
    if up[2] < 0:
        return "ned"
    if draft.compass:
        draft.evidence["world"] += ", so z is up, and the heading counts from north"
        return "nwu"
    draft.evidence["world"] += ", so z is up; nwu is the same but for what is called north, which no verdict rests on"
    return "enu"


def _frames_without_accelerometer(draft: Draft) -> tuple[str, str]:
    """Frames by where a vehicle that tilts is accelerated to: its thrust is along -z (FRD) or +z (FLU)."""
    speeds = [f for f in triples_of(draft) if named.is_named(f, "velocity")]
    places = [f for f in triples_of(draft) if named.is_named(f, "position")]
    if draft.wxyz is not None and draft.instants is not None and (speeds or places):
        values = draft.changes(draft.values((speeds or places)[0].columns))
        found = {}
        for own, upward in product((2, 1), (2, 1)):
            thrust = by.into_world(draft.time_s, draft.wxyz, np.tile(np.eye(3)[own], (len(draft.time_s), 1)))
            level = 1 - np.eye(3)[upward]
            with np.errstate(invalid="ignore", divide="ignore"):
                gained = draft.integrated(thrust / thrust[:, [upward]] * level * G)
            if speeds:
                seen = by.compare(values * level, gained)
            else:
                seen = by.compare(np.diff(values, axis=0) * level / by.STEP_S, gained[1:])
            found[own, upward] = seen, np.nanmedian(thrust, axis=0)
        (own, upward), (seen, thrust) = max(found.items(), key=lambda item: abs(item[1][0].correlation))
        if abs(seen.correlation) > CONFIRMED and (own == 2 or seen.correlation > 0):
            body = "fur" if own == 1 else "frd" if seen.correlation < 0 else "flu"
            axis = {"frd": "-z", "flu": "+z", "fur": "+y"}[body]
            draft.evidence["body"] = f"tilt and acceleration agree with thrust along {axis} ({seen.in_words})"
            return body, _world(draft, -thrust if body == "frd" else thrust, "the thrust turned by the attitude")
    draft.open["body"] = "frd, flu or fur: neither an accelerometer nor velocity and attitude show which"
    draft.open["world"] = "ned, enu, nwu or nue: nothing shows which way up is"
    return OPEN, OPEN


def _axes_that_matter(draft: Draft, body: str, world: str) -> tuple[str, str]:
    """The axes of body and world; nothing is asked where no channel stands in them."""
    for key, channels, found, usual in (
        ("body", {"attitude", "angular_velocity", "specific_force", "velocity", "force", "moment"}, body, "frd"),
        ("world", {"attitude", "velocity", "position"}, world, "ned"),
    ):
        if found == OPEN and not channels & set(draft.channels):
            draft.open.pop(key, None)
            draft.evidence[key] = f"no channel is in {key} axes: it plays no part"
            body, world = (usual, world) if key == "body" else (body, usual)
    return body, world
