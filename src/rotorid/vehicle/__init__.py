"""Vehicles in motion: rigid body, rotors, mixing, simulation, controllers; exporters to other tools (`exports`)."""

OPEN = (
    "attitude",
    "batch",
    "control.pid",
    "control.swings",
    "derivatives",
    "exports",
    "exports.ardupilot_frame",
    "exports.flown",
    "exports.forms",
    "exports.gazebo_airframe",
    "exports.sih",
    "fast",
    "hover",
    "improved",
    "mass_properties",
    "mixer",
    "simulator",
    "windows",
)
"""Modules that other rooms may import; all else is this room's own."""
