"""The accelerometer, and by it the axes of body and world."""

from __future__ import annotations

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
            ": is gravity removed? Then it is no accelerometer's reading; remove the channel" if read < 3 else ""
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
        share = float(np.nanmedian(values[:, 2] / size))
    body = "frd" if share < -0.8 else "flu" if share > 0.8 else OPEN
    draft.evidence["body"] = f"the accelerometer's z reads {share:+.2f} of its norm in the median"
    if body == OPEN:
        draft.open["body"] = "frd reads -1, flu +1 in level flight"
    if draft.wxyz is None or draft.time_s is None:
        draft.open["world"] = "ned, enu or nwu: without an attitude of known order nothing shows which way z points"
        return body, OPEN
    turned = by.into_world(draft.time_s, draft.wxyz, values)
    up = float(np.nanmedian(turned[:, 2] / np.linalg.norm(turned, axis=1)))
    return body, _world(draft, up, "the accelerometer turned by the attitude")


def _world(draft: Draft, up: float, what: str) -> str:
    """World axes by the share of the upward direction along the world's z."""
    draft.evidence["world"] = f"{what} points to {up:+.2f} along the world's z in the median"
    if abs(up) < 0.8:
        draft.open["world"] = "up should be -1 (ned) or +1 (enu, nwu): does the attitude turn the body into the world?"
        return OPEN
    if up < 0:
        return "ned"
    draft.evidence["world"] += ", so z is up; nwu is the same but for what is called north, which no verdict rests on"
    return "enu"


def _frames_without_accelerometer(draft: Draft) -> tuple[str, str]:
    """Frames by where a vehicle that tilts is accelerated to: its thrust is along -z (FRD) or +z (FLU)."""
    speeds = [f for f in triples_of(draft) if named.is_named(f, "velocity")]
    places = [f for f in triples_of(draft) if named.is_named(f, "position")]
    question = "frd or flu: neither an accelerometer nor velocity and attitude show which"
    if draft.wxyz is not None and draft.instants is not None and (speeds or places):
        axis = np.tile([0.0, 0.0, 1.0], (len(draft.time_s), 1))
        z = by.into_world(draft.time_s, draft.wxyz, axis)
        pull = np.column_stack([z[:, :2] / z[:, [2]], np.zeros(len(z))]) * 9.81
        gained = draft.integrated(pull)
        values = draft.values((speeds or places)[0].columns)
        if speeds:
            seen = by.compare(draft.changes(values) * [1, 1, 0], gained)
        else:
            seen = by.compare(np.diff(draft.changes(values), axis=0) * [1, 1, 0] / by.STEP_S, gained[1:])
        if abs(seen.correlation) > CONFIRMED:
            body = "frd" if seen.correlation < 0 else "flu"
            draft.evidence["body"] = (
                f"tilt and acceleration agree with thrust along {'-' if body == 'frd' else '+'}z ({seen.in_words})"
            )
            up = float(np.nanmedian(z[:, 2])) * (-1 if body == "frd" else 1)
            return body, _world(draft, up, "the thrust turned by the attitude")
    draft.open["body"] = question
    draft.open["world"] = "ned, enu or nwu: nothing shows which way z points"
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
