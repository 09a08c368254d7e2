"""The calibration weights and their eight combinations (thesis tables 2.6 and 2.7), in gf."""

WEIGHTS_GF = {
    "Carbon Fiber 1": 35.715,
    "Carbon Fiber 2": 36.615,
    "Carbon Fiber 3": 36.15,
    "Carbon Fiber Tube": 343.445,
    "Aluminum 1": 249.525,
    "Aluminum 2": 250.955,
    "Aluminum 3": 250.5525,
    "Aluminum 4": 255.07,
}

COMBINATIONS: tuple[tuple[str, ...], ...] = (
    ("Carbon Fiber 1",),
    ("Carbon Fiber 1", "Carbon Fiber 2"),
    ("Carbon Fiber 1", "Carbon Fiber 2", "Carbon Fiber 3"),
    ("Aluminum 4",),
    ("Carbon Fiber Tube",),
    ("Aluminum 1", "Aluminum 2"),
    ("Aluminum 1", "Aluminum 2", "Aluminum 3"),
    (
        "Aluminum 3",
        "Aluminum 4",
        "Carbon Fiber 1",
        "Carbon Fiber 2",
        "Carbon Fiber 3",
        "Carbon Fiber Tube",
    ),
)


def weight_gf(items: tuple[str, ...] | list[str]) -> float:
    """Weight of a combination in gf."""
    return round(sum(WEIGHTS_GF[item] for item in items), 4)
