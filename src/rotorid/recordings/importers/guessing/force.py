"""The accelerometer, and by it the axes of body and world."""

from __future__ import annotations

from itertools import product

import numpy as np

from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing import names as named
from rotorid.recordings.importers.guessing.draft import (
    CONFIRMED,
    Draft,
    G,
    triples_of,
)
from rotorid.recordings.importers.guessing.names import Family
from rotorid.recordings.importers.mapping import OPEN
from rotorid.recordings.importers.units import UNITS


def guess_specific_force(draft: Draft) -> None:
    triples = triples_of(draft)
    offered = [f for f in triples if named.is_named(f, "specific_force")]
    norms = {f: float(np.nanmedian(np.linalg.norm(draft.values(f.columns), axis=1))) for f in triples}
    fits = [f for f in offered if _force_unit(f, norms[f])]
    if fits:
        family = fits[0]
        unit = _force_unit(family, norms[family])
        read = norms[family] * UNITS["acceleration"][unit]
        evidence = f"by their names; the median of its norm is {norms[family]:.4g} {unit} ({read:.3g} m/s²)"
        draft.put("specific_force", family.columns, evidence, unit=unit)
    elif offered:
        family, read = offered[0], norms[offered[0]]
        evidence = f"by their names; the median of its norm is {read:.4g}"
        question = f"a median of {read:.4g} is 1 g in no unit" + (
            ": is gravity removed? Then it is no accelerometer's reading; remove the channel"
            if read < 3
            else f"; if these are counts: unit: g, scale: what one count is (about {1 / read:.4g}, or 1/{_power(read)})"
        )
        draft.put("specific_force", family.columns, evidence, question, unit=OPEN)
    else:
        near = [
            f
            for f in triples
            if not f.words & named.OTHER_THINGS and abs(norms[f] / G - 1) < 0.1 and _upright(draft, f)
        ]
        if len(near) == 1:
            evidence = f"no name says it; the median of its norm is {norms[near[0]]:.4g}, along z"
            draft.put("specific_force", near[0].columns, evidence, unit="m/s2")


def _force_unit(family: Family, norm: float) -> str:
    """The unit in which a median norm is about 1 g, empty where there is none or the names say another."""
    unit = next((u for u, f in UNITS["acceleration"].items() if 0.7 < norm * f / G < 1.6), "")
    stated = family.unit if family.unit in UNITS["acceleration"] else ""
    return unit if stated in ("", unit) else ""


def _power(counts: float) -> int:
    """The power of two next to a number, as sensors have counts to 1 g."""
    return 2 ** round(float(np.log2(counts)))


def _upright(draft: Draft, family: Family) -> bool:
    values = draft.values(family.columns)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.abs(values[:, 2]) / np.linalg.norm(values, axis=1)
    return float(np.nanmedian(share)) > 0.95


def guess_frames(draft: Draft) -> tuple[str, str]:
    """Body axes by the sign of the accelerometer's z in flight; the world's z by where the attitude turns it to."""
    force = draft.channels.get("specific_force")
    if force is None:
        return _frames_without_accelerometer(draft)
    values = draft.values(force.columns)
    size = np.linalg.norm(values, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        _, y, z = np.nanmedian(values / size[:, None], axis=0)
    body = "frd" if z < -0.8 else "flu" if z > 0.8 else "fur" if y > 0.8 else OPEN
    axis, share = ("y", y) if body == "fur" else ("z", z)
    draft.evidence["body"] = f"the accelerometer's {axis} reads {share:+.2f} of its norm in the median"
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


def axes_that_matter(draft: Draft, body: str, world: str) -> tuple[str, str]:
    """The axes of body and world; nothing is asked where no channel stands in them."""
    for key, channels, found, usual in (
        ("body", {"attitude", "angular_velocity", "specific_force", "velocity"}, body, "frd"),
        ("world", {"attitude", "velocity", "position"}, world, "ned"),
    ):
        if found == OPEN and not channels & set(draft.channels):
            draft.open.pop(key, None)
            draft.evidence[key] = f"no channel is in {key} axes: it plays no part"
            body, world = (usual, world) if key == "body" else (body, usual)
    return body, world
