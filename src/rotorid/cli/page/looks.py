"""What logs hold, said before anything is computed: flights, rates, what can be asked, what must be known, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rotorid.cli.sets import Stated
from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Vehicle, templates
from rotorid.recordings import columns as c
from rotorid.recordings.check import check_set
from rotorid.recordings.sufficient import sufficient

_USUAL = "x500"
"""Template with which logs that say nothing of their vehicle are looked at; the visitor must choose one."""


@dataclass(frozen=True)
class Wishes:
    """What a visitor says of logs; what is empty is proposed."""

    mass_kg: float | None = None
    like: str = ""
    """A template vehicle."""
    vehicle: str = ""
    """Text of a `vehicle.yaml`, in place of mass and template."""
    mapping: str = ""
    """Text of a mapping of a table's columns."""

    @classmethod
    def of(cls, said: Any) -> Wishes:
        """Of what the form sent; InputError where it is none of this."""
        if not isinstance(said, dict):
            raise InputError("the form sent no values")
        mass = said.get("mass_kg")
        if mass is not None and (not isinstance(mass, int | float) or isinstance(mass, bool) or not 1e-3 < mass < 1e4):
            raise InputError("the mass is expected in kg, a number of more than 0.001")
        texts = {name: said.get(name) or "" for name in ("like", "vehicle", "mapping")}
        if wrong := [name for name, text in texts.items() if not isinstance(text, str)]:
            raise InputError(f"{wrong[0]} is expected as text")
        return cls(mass, **texts)

    def stated(self, folder: Path) -> Stated:
        """The same as the commands take it; the texts are written into a folder."""
        paths: dict[str, Path | None] = {}
        for name, text in (("vehicle", self.vehicle), ("mapping", self.mapping)):
            path = folder / f"stated_{name}.yaml"
            if text.strip():
                path.write_text(text, encoding="utf-8")
            else:
                path.unlink(missing_ok=True)
            paths[name] = path if text.strip() else None
        return Stated(**paths) if paths["vehicle"] else Stated(self.mass_kg, self.like or None, **paths)


def look(folder: Path, logs: Sequence[Path], wishes: Wishes) -> dict[str, Any]:
    """What `logs` hold, as the page shows it; texts that the wishes state are written into `folder`.

    InputError in one sentence where they cannot be read. Of a table whose columns nobody knows the answer has a
    proposal of what they are (`mapping`, `evidence`, `open`) and no flights.
    """
    from rotorid.recordings.importers.logfile import importer_of, set_of_logs

    stated, formats = wishes.stated(folder), [importer_of(path) for path in logs]
    if stated.mapping is None and formats[0].name == "table" and (guessed := _guessed(logs[0])):
        return guessed | {"format": formats[0].title, "templates": known_templates()}
    unknown = stated.like is None and stated.vehicle is None and not formats[0].template
    name, like = logs[0].name.split(".")[0], _USUAL if unknown else stated.like
    found = set_of_logs(logs, name, stated.mass_kg, like, stated.vehicle, stated.columns())
    recordings, refused = found.recordings(), ""
    believed = recordings.vehicle
    try:
        sufficient(recordings)
    except InputError as error:
        refused = str(error)
    checked = check_set(recordings)
    mass_why = next((r for r in found.remarks if r.startswith("the mass is")), "as you stated it")
    return {
        "format": ", ".join(dict.fromkeys(known.title for known in formats)),
        "runs": [asdict(run) for run in checked.runs],
        "can": _can(recordings, checked.columns),
        "cannot": list(checked.lacks),
        "doubts": [{"sentence": str(d), "stops": d.stops} for d in checked.doubts],
        "found": list(found.sentences),
        "refused": refused,
        "unknown_vehicle": unknown,
        "mass_kg": believed.mass_kg,
        "mass_why": mass_why.replace(" and give --mass-kg", ""),
        "remarks": [r for r in found.remarks if r != mass_why],
        "like": stated.like or ("" if unknown else _template_of(found.remarks)),
        "templates": known_templates(),
        "vehicle": found.vehicle_text,
        "mapping": wishes.mapping,
        "rotors": [r.model_dump() for r in believed.rotors or ()],
        "kind": believed.kind,
    }


def _template_of(remarks: Sequence[str]) -> str:
    """The template that the proposal took; the remarks name it."""
    return next((name for name in sorted(templates.names(), key=len, reverse=True) if name in " ".join(remarks)), "")


@cache
def known_templates() -> list[dict[str, Any]]:
    """Name and description of each template of a vehicle that flies."""
    known = {name: templates.read(name) for name in templates.names()}
    return [{"name": n, "says": f"{v.name}, {v.mass_kg:g} kg"} for n, v in known.items() if v.kind == "flight"]


def _guessed(path: Path) -> dict[str, Any] | None:
    """What the columns of a table seem to be; None where they have the contract's names."""
    from rotorid.recordings.importers.guessing import as_text, guess
    from rotorid.recordings.importers.mapping import read_columns

    raw = read_columns(path)
    if c.TIME in raw.columns and sum(c.is_known(name) for name in raw.columns) > 1:
        return None
    found = guess(raw)
    return {
        "mapping": as_text(found, path.name),
        "evidence": [f"{name}: {why}" for name, why in found.evidence.items()],
        "open": [f"{name}: {question}" for name, question in found.open.items()],
        "left_out": list(found.left_out),
    }


def _can(recordings: RecordingSet, columns: Sequence[str]) -> list[str]:
    """What the columns allow to be asked, one sentence each."""
    vehicle: Vehicle = recordings.vehicle
    if vehicle.kind != "flight":
        return ["Thrust and torque of the rotors against what the stand read."]

    def has(*names: str) -> bool:
        return set(names) <= set(columns)

    speeds, throttles, commands = (
        has(*c.rotor_columns(name, vehicle.rotor_count)) for name in ("rotor_speed", "throttle", "rotor_command")
    )
    answers = {
        "Rotor speeds are recorded: thrust, mass, battery and differences between rotors can be distinguished.": speeds,
        "Commands are recorded: how thrust follows them (curve, lag, delay) can be asked.": throttles or commands,
        "The accelerometer is there: forces are compared with those that the model expects.": has(*c.SPECIFIC_FORCE),
        "The gyroscope is there: moments, the inertia and the places of rotors and weights can be asked.": has(
            *c.ANGULAR_VELOCITY
        ),
        "Velocity is there: drag of rotors and frame, and wind, can be asked.": has(*c.VELOCITY) or has(*c.POSITION),
        "The battery's voltage is there: how thrust falls with it can be asked.": has(c.BATTERY_VOLTAGE),
    }
    return [sentence for sentence, known in answers.items() if known]
