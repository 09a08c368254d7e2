"""Real recordings of other laboratories: sets, runs held out, what others found. Light: read at every start.

Each study starts from the believed rigid body of the set's `vehicle.yaml`. What is hidden is whatever nature did.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """A number that others found."""

    effect: str
    symbol: str
    value: float
    unit: str
    source: str
    times_total_speed: bool = False
    """Whether ours is per rotor speed: times the mean sum of rotor speeds it is theirs."""
    times_rotors: bool = False
    """Whether ours is per rotor and theirs for the vehicle."""


@dataclass(frozen=True)
class Study:
    """One set, with the runs held out (None: as the set or the tool chooses), and what is expected of it."""

    name: str
    set: str
    expected: tuple[str, ...]
    """Ids one of which, at least, a reader would expect."""
    about: str
    held_out: tuple[str, ...] | None = None
    published: tuple[Published, ...] = ()
    kind: str = "flight"
    """Kind of the set: `flight`, `stand` or `bench`."""


NEUROBEM_FLIGHTS = ("20210218170320seg2", "20210218171908seg2", "20210223104803seg2", "20210223114138seg3")
NEUROBEM_MODEL = (
    Published("rotor_drag", "k_d", 0.26, "N s/m", "drag of the published simulator, x and y", times_total_speed=True),
    Published("axial_inflow", "k_z", 0.30, "N s/m", "drag of the published simulator, z", times_total_speed=True),
    Published("translational_lift", "k_h", 0.015, "N s2/m2", "its induced lift", times_rotors=True),
)
STUDIES = (
    *(
        Study(
            f"neurobem-{k + 1}",
            "neurobem",
            ("rotor_drag", "axial_inflow", "translational_lift"),
            f"fast flight; flight {k + 1} held out",
            held_out=(flight,),
            published=NEUROBEM_MODEL,
        )
        for k, flight in enumerate(NEUROBEM_FLIGHTS)
    ),
    Study(
        "appius-ground-effect",
        "appius-ground-effect",
        ("ground_effect",),
        "near the ground; no accelerometer",
        held_out=("vertical_speeds",),
        published=(
            Published("ground_effect", "a", 0.114, "1", "fit of the thesis"),
            Published("ground_effect", "b", 5.388, "1/m", "fit of the thesis"),
        ),
    ),
    Study(
        "imrc-brushless",
        "imrc-brushless",
        ("motor_lag", "battery_sag", "rotor_drag"),
        "Crazyflie, brushless; commands and speeds",
        published=(
            Published("motor_lag", "tau", 0.0425, "s", "0.040 to 0.045 s per motor"),
            Published("rotor_drag", "k_d", 1.95e-6, "kg/rad", "fit of the same laboratory"),
        ),
    ),
    Study(
        "imrc-brushed",
        "imrc-brushed",
        ("motor_lag", "battery_sag", "sensor_dropout"),
        "Crazyflie, brushed; one rpm sensor drops out",
        published=(Published("motor_lag", "tau", 0.072, "s", "brushed motors of the same kind: arXiv 2404.07837"),),
    ),
    Study(
        "crazyflie-arpl-log10",
        "crazyflie-arpl-log10",
        ("motor_lag",),
        "Crazyflie, throttle only",
        published=(Published("motor_lag", "tau", 0.072, "s", "arXiv 2404.07837"),),
    ),
    Study("crazypad-normal", "crazypad-normal", (), "Crazyflie unharmed, throttle and attitude only"),
    Study("crazypad-weight", "crazypad-weight", ("payload", "com_offset"), "the same with a weight near motor 3"),
    Study("crazypad-cut", "crazypad-cut", ("unequal_rotors",), "the same with the propeller of motor 3 cut"),
    Study(
        "imrc-bench-stock",
        "imrc-bench-stock",
        ("battery_sag", "throttle_curve"),
        "Crazyflie on a scale: thrust, throttle and voltage",
        kind="stand",
    ),
    Study(
        "strawson-t5045c",
        "strawson-t5045c",
        ("battery_sag", "tare_offset", "thrust_curve"),
        "RCbenchmark bench: trained at 11.1 V, tested at 7.4 V",
        kind="stand",
    ),
)


def study(name: str) -> Study:
    """The study of that name."""
    return next(s for s in STUDIES if s.name == name)
