"""Tensile tests of printed PLA (thesis 2.6.4, table 2.5, fig. 2.29): modulus, strength and 0.2 % yield.

- Stress is force over the section, strain displacement over the distance between grips.
- Modulus: slope of the straight part. It begins where the specimen is taut and is extended for as long as the
  line's largest residual stays within the noise; the foot, where the slack is removed, is left out.
- Strain is then counted from where that line meets zero stress (toe compensation).
- Yield: where the curve meets the line of the modulus moved by 0.2 % of strain. Strength: the largest stress.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.identify.bench.loadcell import fit_line
from rotorid.io.tables import by_recording

_OFFSET_STRAIN = 0.002
_FOOT_SHARE = 0.04
"""The straight part is looked for from this share of the strength on: below it the slack is still being removed."""
_FIRST_SHARE = 0.12
"""… and reaches at least up to this share."""
_NOISE_FACTOR = 4.0
"""Residuals beyond so many standard deviations of the noise end the straight part."""


@dataclass(frozen=True)
class _Specimen:
    """Curve and figures of one specimen; strain is compensated for the slack."""

    strain: np.ndarray
    stress_pa: np.ndarray
    modulus_pa: float
    modulus_interval_95_pa: tuple[float, float]
    strength_pa: float
    yield_pa: float
    yield_strain: float
    proportional_pa: float
    """Stress at which the straight part ends."""
    break_strain: float
    slack_mm: float
    straight_samples: int


def evaluate(displacement_mm: np.ndarray, force_n: np.ndarray, gauge_mm: float, section_mm2: float) -> _Specimen:
    """Figures of one specimen.

    Parameters
    ----------
    displacement_mm, force_n
        Samples, shape (n,), from before the specimen is taut to after it broke.
    gauge_mm, section_mm2
        Distance between grips and cross-section.

    Raises
    ------
    InputError
        No straight part of at least five samples, or a curve that never meets the 0.2 % line.
    """
    displacement, force = np.asarray(displacement_mm, float), np.asarray(force_n, float)
    stress, strain = force / section_mm2 * 1e6, displacement / gauge_mm
    peak = int(np.argmax(stress))
    strength = float(stress[peak])
    first = int(np.argmax(stress > _FOOT_SHARE * strength))
    last = int(np.argmax(stress > _FIRST_SHARE * strength))
    noise = _noise(stress[: peak + 1])
    last = max(last, first + 4)
    if last >= peak:
        raise InputError("no straight part of at least five samples before the largest force")
    while last < peak:
        longer = fit_line(strain[first : last + 2], stress[first : last + 2])
        if np.max(np.abs(longer.residuals)) > _NOISE_FACTOR * noise:
            break
        last += 1
    line = fit_line(strain[first : last + 1], stress[first : last + 1])
    zero = -line.a0 / line.a1
    strain = strain - zero
    broken = int(peak + np.argmax(np.append(stress[peak:], 0.0) < 0.5 * strength))
    yield_strain, yield_pa = _offset_yield(strain[: peak + 1], stress[: peak + 1], line.a1)
    return _Specimen(
        strain=strain[:broken],
        stress_pa=stress[:broken],
        modulus_pa=line.a1,
        modulus_interval_95_pa=line.interval(1),
        strength_pa=strength,
        yield_pa=yield_pa,
        yield_strain=yield_strain,
        proportional_pa=float(stress[last]),
        break_strain=float(strain[broken - 1]),
        slack_mm=float(zero * gauge_mm),
        straight_samples=last - first + 1,
    )


def _noise(stress: np.ndarray) -> float:
    """Standard deviation of the readings from their third differences, which a smooth curve does not show."""
    third = np.diff(stress, 3)
    return float(1.4826 * np.median(np.abs(third)) / np.sqrt(20))


def _offset_yield(strain: np.ndarray, stress: np.ndarray, modulus: float) -> tuple[float, float]:
    """Strain and stress where the curve falls below the line moved by 0.2 % of strain."""
    above = stress - modulus * (strain - _OFFSET_STRAIN)
    loaded = np.flatnonzero(strain > _OFFSET_STRAIN)
    below = loaded[above[loaded] <= 0]
    if len(below) == 0:
        raise InputError("the curve never meets the line of 0.2 % plastic strain: the specimen broke before it yielded")
    i = below[0]
    share = above[i - 1] / (above[i - 1] - above[i])
    return (
        float(strain[i - 1] + share * (strain[i] - strain[i - 1])),
        float(stress[i - 1] + share * (stress[i] - stress[i - 1])),
    )


def specimens(samples: pd.DataFrame, sessions: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """One row a specimen with its figures, and all curves (`infill_percent specimen strain stress_pa`)."""
    parts = by_recording(samples)
    rows, curves = [], []
    for session in sessions.itertuples():
        table = parts[session.id]
        table = table[table["quality"] == 0]
        try:
            found = evaluate(
                table["displacement_mm"].to_numpy(),
                table["force_n"].to_numpy(),
                session.gauge_length_mm,
                session.cross_section_mm2,
            )
        except InputError as error:
            raise InputError(f"{session.id}: {error}") from None
        infill = int(session.infill_percent)
        rows.append(
            {
                "infill_percent": infill,
                "specimen": session.specimen,
                "modulus_gpa": found.modulus_pa / 1e9,
                "modulus_low_95_gpa": found.modulus_interval_95_pa[0] / 1e9,
                "modulus_high_95_gpa": found.modulus_interval_95_pa[1] / 1e9,
                "strength_mpa": found.strength_pa / 1e6,
                "yield_mpa": found.yield_pa / 1e6,
                "yield_strain": found.yield_strain,
                "proportional_mpa": found.proportional_pa / 1e6,
                "break_strain": found.break_strain,
                "slack_mm": found.slack_mm,
                "straight_samples": found.straight_samples,
            }
        )
        curve = pd.DataFrame({"strain": found.strain, "stress_pa": found.stress_pa})
        curves.append(curve.assign(infill_percent=infill, specimen=session.specimen))
    return pd.DataFrame(rows), pd.concat(curves, ignore_index=True)


def by_infill(table: pd.DataFrame, printed: pd.DataFrame) -> pd.DataFrame:
    """Mean of each infill's specimens with its 95 % interval, next to the thesis's table 2.5.

    `printed` has the columns `infill_percent modulus_gpa strength_mpa yield_mpa`.
    """
    known = printed.set_index("infill_percent")
    rows = []
    for infill, part in table.groupby("infill_percent"):
        row = {"infill_percent": infill, "specimens": len(part)}
        for name in ("modulus_gpa", "strength_mpa", "yield_mpa"):
            values = part[name]
            half = student_quantile(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values))
            row |= {
                name: values.mean(),
                f"{name}_low_95": values.mean() - half,
                f"{name}_high_95": values.mean() + half,
                f"{name}_thesis": known.loc[infill, name] if infill in known.index else np.nan,
            }
        rows.append(row)
    return pd.DataFrame(rows)
