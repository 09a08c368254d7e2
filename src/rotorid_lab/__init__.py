"""The laboratory's chapters: bench, stands, rotors, networks, finite elements, public recordings, figures, typesetting.

It imports `rotorid` through its open modules, and of `rotorid_acquire` how raw logs are read. Neither imports it.
"""

OPEN = (
    "batch",
    "bench",
    "bench_tests",
    "black_box",
    "clocks",
    "config",
    "fem.bench",
    "fem.placement",
    "fem.studies",
    "grey_box",
    "inertias",
    "loadcell",
    "log",
    "networks",
    "plots.*",
    "public_list",
    "public_sets",
    "rigid_body_residuals",
    "rotor",
    "stand",
    "typeset",
)
"""Modules that the workflow and the proof may import; all else is this package's own."""
