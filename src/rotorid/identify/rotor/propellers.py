"""Thrust coefficients of one propeller over all the motors that turned it on the stand."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from rotorid.identify.rotor.coefficients import (
    Points,
    fit_coefficient,
    fit_exponent,
    modified_z_scores,
    pool,
    rest_reading,
    usable,
)
from rotorid.recordings import RecordingSet

FORMS = {"origin": False, "offset": True}
NAMES = {
    "t5040c": "Cyclone T5040C, 3 blades",
    "t5045c": "Cyclone T5045C, 3 blades",
    "hq5x4": "HQ 5x4, 4 blades",
    "lumenier5x45": "Lumenier 5x4.5, 2 blades",
}
COLUMNS = [
    "propeller",
    "motor",
    "form",
    "c_f_n_s2",
    "low_95_n_s2",
    "high_95_n_s2",
    "offset_2s_n",
    "offset_3s_n",
    "residual_rms_n",
    "points",
    "modified_z",
    "outlying",
]


def summarise(
    recordings: RecordingSet, speed_noise_relative: float, outlying_above: float
) -> tuple[dict, list[dict], list[dict]]:
    """Summary, one row a motor and form, and all points of one propeller's set.

    Runs are called `<motor>_2s` and `<motor>_3s`; keys carry their units.
    """
    name = recordings.name.removeprefix("strawson-")
    points, at_rest, lost = {}, [], 0
    for run in recordings.runs:
        speed, thrust = run.column("rotor_speed_1_rad_s"), -run.column("force_z_n")
        points.setdefault(run.name[0], []).append(Points(run.name, speed, thrust))
        at_rest += list(thrust[(run.column("throttle_1") == 0) & (speed == 0)])
        lost += int((~usable(speed, thrust) & (run.column("throttle_1") > 0)).sum())
    summary = {"name": NAMES[name], "runs": len(recordings.runs), "points_without_speed": lost}
    rows = []
    for form, offset in FORMS.items():
        fits = {m: fit_coefficient(p, offset, speed_noise_relative) for m, p in points.items()}
        exact = {m: fit_coefficient(p, offset) for m, p in points.items()}
        values = [fit.value for fit in fits.values()]
        scores = modified_z_scores(values)
        pooled = pool(values, [fit.standard_error for fit in fits.values()])
        without_noise = pool([f.value for f in exact.values()], [f.standard_error for f in exact.values()])
        furthest = int(np.argmax(np.abs(scores)))
        summary[form] = {
            **asdict(pooled),
            "between_relative": pooled.between_sd / pooled.value,
            "value_if_speed_exact": without_noise.value,
            "median_standard_error": float(np.median([f.standard_error for f in fits.values()])),
            "median_residual_rms_n": float(np.median([f.residual_rms_n for f in fits.values()])),
            "outlying": [m for m, z in zip(fits, scores, strict=True) if abs(z) > outlying_above],
            "furthest_motor": list(fits)[furthest],
            "furthest_modified_z": float(scores[furthest]),
        }
        for (motor, fit), score in zip(fits.items(), scores, strict=True):
            offsets = fit.offsets_n or (None, None)
            values = (fit.value, *fit.interval_95, *offsets, fit.residual_rms_n, fit.points)
            row = (name, motor, form, *values, float(score), "yes" if abs(score) > outlying_above else "")
            rows.append(dict(zip(COLUMNS, row, strict=True)))
    exponents = [fit_exponent(p)[0] for p in points.values()]
    mean = float(np.mean(exponents))
    half = float(1.96 * np.std(exponents, ddof=1) / np.sqrt(len(exponents)))
    summary["exponent"] = {"value": mean, "interval_95": [mean - half, mean + half]}
    summary["rest"] = rest_reading(at_rest)
    offsets = [v for row in rows if row["form"] == "offset" for v in (row["offset_2s_n"], row["offset_3s_n"])]
    summary["mean_offset_n"] = float(np.mean(offsets))
    scattered = [
        {"propeller": name, "run": p.run, "speed_rad_s": s, "thrust_n": t, "used": bool(u)}
        for group in points.values()
        for p in group
        for s, t, u in zip(p.speed_rad_s, p.thrust_n, usable(p.speed_rad_s, p.thrust_n), strict=True)
    ]
    return summary, rows, scattered
