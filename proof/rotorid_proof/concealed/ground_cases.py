"""Concealed cases of benches and stands: every id alone, wrong values, mixtures, confusable pairs, clean sets."""

import zlib

import numpy as np

from .ground import Cause, GroundPlan

# id: (plan's fixed settings, forms, amounts for strong, moderate, weak where noise does not set the size)
BENCH = {
    "zero_drift": ({}, ("", "settling"), None),
    "tare_offset": ({}, ("",), None),
    "creep": ({"runs": ("hold", "updown", "hold")}, ("", "chain"), None),
    "hysteresis": ({"runs": ("updown", "ramps", "updown")}, ("",), None),
    "load_nonlinearity": ({"runs": ("updown", "ramps", "random")}, ("", "cubic"), None),
    "crosstalk": ({"runs": ("mixed", "updown", "mixed")}, ("",), None),
    "compliance": ({"runs": ("updown", "ramps", "updown"), "axes": "z"}, ("",), None),
    "mount_tilt": ({"runs": ("mixed", "updown", "mixed")}, ("",), None),
    "amplifier_filter": ({"runs": ("mixed", "updown", "mixed"), "rate_hz": 100.0}, ("", "second"), (1.5, 0.5, 0.2)),
    "structural_resonance": ({"runs": ("updown", "random", "updown"), "rate_hz": 100.0}, ("",), (1.0, 1.0, 1.0)),
    "clock_skew": ({"runs": ("mixed", "ramps", "mixed")}, ("",), (1.0, 0.3, 0.1)),
    "quantisation": ({}, ("",), (2.0, 1.0, 0.75)),
}
MANY = ("stairs", "excite", "updown", "excite", "stairs")
FULL = {"runs": MANY, "columns": ("speed",)}
STAND = {
    "zero_drift": (FULL, ("", "settling"), None),
    "tare_offset": (FULL, ("",), None),
    "creep": ({**FULL, "runs": ("updown", "stairs", "updown", "stairs"), "seconds": 60.0}, ("", "chain"), None),
    "hysteresis": ({**FULL, "runs": ("updown", "stairs", "updown", "stairs")}, ("",), None),
    "load_nonlinearity": ({**FULL, "rotors": 1, "tared": True}, ("",), None),
    "crosstalk": (FULL, ("", "z"), None),
    "cable_stiffness": (FULL, ("",), None),
    "structural_resonance": ({**FULL, "rate_hz": 200.0}, ("",), (1.0, 1.0, 1.0)),
    "mount_tilt": (FULL, ("",), None),
    "quantisation": (FULL, ("",), (2.0, 1.0, 0.75)),
    "wall_interference": ({**FULL, "runs": ("updown", "stairs", "trapezoid", "stairs")}, ("",), None),
    "amplifier_filter": ({**FULL, "rate_hz": 200.0}, ("", "second"), (1.5, 0.5, 0.2)),
    "sensor_origin": (FULL, ("",), None),
    "clock_skew": (FULL, ("",), (1.0, 0.3, 0.1)),
    "com_offset": (FULL, ("",), None),
    "thrust_tilt": (FULL, ("",), None),
    "unequal_rotors": (FULL, ("",), None),
    "rotor_acceleration_torque": ({**FULL, "rate_hz": 200.0}, ("",), None),
    "thrust_curve": (FULL, ("", "constant"), None),
    "ground_effect": ({**FULL, "columns": ("speed", "height")}, ("",), None),
    "motor_lag": ({"runs": MANY, "columns": ("speed", "command"), "rate_hz": 200.0}, ("",), (2.0, 1.0, 0.4)),
    "throttle_curve": ({"runs": MANY, "columns": ("speed", "throttle", "limits")}, ("", "dead"), (2.0, 1.0, 0.4)),
    "battery_sag": ({"runs": MANY, "columns": ("throttle", "limits", "battery")}, ("",), (2.0, 1.0, 0.4)),
    "delay": ({"runs": MANY, "columns": ("speed", "command"), "rate_hz": 200.0}, ("",), (2.0, 1.0, 0.5)),
}
STRENGTHS = {"strong": (5.0, 0), "moderate": (1.5, 1), "weak": (0.5, 2)}
SAME = {
    ("bench", "compliance"): (("compliance", "load_nonlinearity"),),
    ("stand", "load_nonlinearity"): (("load_nonlinearity", "thrust_curve"),),
}


def draw(name):
    return np.random.default_rng([0, zlib.crc32(name.encode())])


def dressed(kind, rng, **fixed):
    """A plan with what is not fixed drawn at random."""
    drawn = dict(
        kind=kind,
        runs=tuple(rng.choice(["updown", "ramps", "random", "mixed"], 3)) if kind == "bench" else MANY[:4],
        seconds=float(rng.choice([30.0, 40.0])),
        rate_hz=float(rng.choice([50.0, 80.0, 100.0])),
        force_noise_n=float(np.exp(rng.uniform(np.log(0.004), np.log(0.02)))) * (1 if kind == "bench" else 3),
        moment_noise_n_m=float(rng.uniform(0.0004, 0.0015)),
        coloured_share=float(rng.choice([0.0, 0.3, 0.6])),
        memory_s=float(rng.uniform(0.02, 0.1)),
        step_share=float(rng.choice([0.02, 0.1, 0.5])),
        held_out=bool(rng.random() < 0.3),
        form=str(rng.choice(["csv", "csv.gz", "parquet"])),
    )
    settings = drawn | fixed
    if kind == "bench" and "mixed" not in settings["runs"] and settings.get("axes", "xyz") == "xyz":
        # two runs for each axis, so that one of them can be held out
        settings["runs"] = tuple(np.resize(settings["runs"], 6))
    return GroundPlan(**settings)


def plans():
    """(name, seed, plan, truth) of every case."""
    out = []
    for kind, recipes, start in (("bench", BENCH, 20000), ("stand", STAND, 21000)):
        for effect, (fixed, forms, amounts) in recipes.items():
            for strength, (size, column) in STRENGTHS.items():
                for k in range(2):
                    name = f"{kind}/single/{effect}/{strength}/{k}"
                    rng = draw(name)
                    cause = Cause(
                        effect,
                        size=None if amounts else size,
                        amount=amounts[column] if amounts else 1.0,
                        form=forms[(k + column) % len(forms)],
                    )
                    if effect == "clock_skew" or effect == "delay":
                        fixed = {**fixed, "rate_hz": 100.0 if kind == "bench" else 200.0}
                    plan = dressed(kind, rng, **fixed, hidden=(cause,), equivalent=SAME.get((kind, effect), ()))
                    if effect == "quantisation":
                        plan = GroundPlan(**{**plan.__dict__, "step_share": 0.1})
                    out.append((name, start + k, plan, (effect,)))
        out += wrong(kind, start + 400) + mixtures(kind, start + 500) + clean(kind, start + 600)
    return out


def wrong(kind, start):
    names = (
        ("reading_gain",)
        if kind == "bench"
        else (
            "thrust_coefficient_n_s2",
            "torque_coefficient_n_m_s2",
            "mass_kg",
            "arm_scale",
        )
    )
    out = []
    for value in names:
        for k, change in enumerate((0.03, 0.06, 0.10)):
            name = f"{kind}/wrong/{value}/{k}"
            rng = draw(name)
            factor = 1 + float(rng.choice([-1, 1])) * change
            plan = dressed(kind, rng, wrong=((value, factor),))
            out.append((name, start + k, plan, (value,)))
    return out


def mixtures(kind, start):
    if kind == "bench":
        mixed = {"runs": ("mixed", "updown", "mixed", "updown")}
        sets = (
            (("tare_offset", "crosstalk"), mixed),
            (("load_nonlinearity", "hysteresis"), {"runs": ("updown", "ramps", "updown", "random")}),
            (("crosstalk", "zero_drift"), mixed),
            (("compliance", "tare_offset"), {"axes": "z", "runs": ("updown", "ramps", "updown")}),
            (("creep", "tare_offset"), {"runs": ("hold", "updown", "hold"), "seconds": 60.0}),
        )
    else:
        sets = (
            (("com_offset", "unequal_rotors"), FULL),
            (("crosstalk", "zero_drift"), FULL),
            (("tare_offset", "sensor_origin"), FULL),
            (("com_offset", "thrust_tilt"), FULL),
            (("motor_lag", "com_offset"), {"runs": MANY, "columns": ("speed", "command"), "rate_hz": 200.0}),
            (("unequal_rotors", "mount_tilt"), FULL),
        )
    out = []
    for m, (effects, fixed) in enumerate(sets):
        for k in range(2):
            name = f"{kind}/mixture/{m}/{k}"
            rng = draw(name)
            causes = tuple(
                Cause(e, size=None if e == "motor_lag" else float(rng.uniform(1.0, 3.0)), amount=1.0) for e in effects
            )
            out.append((name, start + 2 * m + k, dressed(kind, rng, **fixed, hidden=causes), effects))
    return out


CLEAN_COLUMNS = (
    ("speed",),
    ("speed",),
    ("speed", "command"),
    ("throttle", "limits"),
    ("throttle", "limits", "battery"),
    ("speed", "battery", "height"),
)


def clean(kind, start, count=100):
    out = []
    for k in range(count):
        name = f"{kind}/clean/{k:03d}"
        rng = draw(name)
        if kind == "bench":
            runs = tuple(rng.choice(["updown", "ramps", "random", "mixed", "hold"], int(rng.integers(1, 5))))
            fixed = {
                "runs": runs,
                "axes": str(rng.choice(["z", "xyz"])),
                "rate_hz": float(rng.choice([20.0, 50.0, 100.0])),
            }
            fixed["seconds"] = 80.0 if len(runs) == 1 else 40.0
        else:
            runs = tuple(rng.choice(["stairs", "updown", "excite", "trapezoid"], int(rng.integers(2, 6))))
            single = bool(rng.random() < 0.25)
            fixed = {
                "runs": runs,
                "rotors": 1 if single else 4,
                "mount": str(rng.choice(["level", "tilting"])),
                "tared": bool(single or rng.random() < 0.3),
                "columns": CLEAN_COLUMNS[rng.integers(len(CLEAN_COLUMNS))],
                "rate_hz": float(rng.choice([50.0, 100.0, 200.0])),
                "seconds": 25.0,
            }
        out.append((name, start + k, dressed(kind, rng, **fixed), ()))
    return out
