"""Recording sets: what goes into the mismatch stage (the recording contract)."""

from rotorid.recordings.files import list_sets, read_run, read_set, read_vehicle, vehicle_of, write_set, write_vehicle
from rotorid.recordings.run import RecordingSet, Run, Split
from rotorid.recordings.vehicle import Inertia, Rotor, Vehicle

__all__ = [
    "Inertia",
    "RecordingSet",
    "Rotor",
    "Run",
    "Split",
    "Vehicle",
    "list_sets",
    "read_run",
    "read_set",
    "read_vehicle",
    "vehicle_of",
    "write_set",
    "write_vehicle",
]

OPEN = (
    "body",
    "check",
    "columns",
    "files",
    "held",
    "importers.faults",
    "importers.guessing",
    "importers.logfile",
    "importers.mapping",
    "importers.neurobem",
    "importers.crazyflie",
    "importers.rcbenchmark",
    "mended",
    "run",
    "settings",
    "signal",
    "signal.*",
    "sufficient",
    "tables",
    "templates",
    "vehicle",
)
"""Modules that other rooms may import; all else is this room's own."""
