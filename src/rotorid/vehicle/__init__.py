"""Vehicles in motion: rigid body, rotors, mixing, simulation, controllers; exporters to other tools (`exports`)."""

OPEN = (
    "attitude",
    "control",
    "derivatives",
    "exports",
    "exports.autopilots",
    "exports.flown",
    "exports.forms",
    "fast",
    "improved",
    "mixer",
    "simulator",
    "windows",
)
"""Modules that other rooms may import; all else is this room's own."""
