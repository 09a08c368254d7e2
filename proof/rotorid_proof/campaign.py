"""Verdicts on the campaign's own sets against what the emulators were given.

The truth is stated in the words of the catalogue by the emulators' side (`rotorid_acquire.emulators.physics`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

STATED = ("established", "ambiguous")


def stated(verdict: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Effects that the verdict claims, alone or as one of a class."""
    return [effect for effect in verdict["effects"] if effect["status"] in STATED]


def names(verdict: Mapping[str, Any], at_work: Sequence[str]) -> dict[str, list[str]]:
    """Ids claimed that are at work (`right`, a class that holds one too), that are not (`wrong`)."""
    right, wrong = [], []
    for effect in stated(verdict):
        members = {effect["id"], *effect["alternatives"]}
        word = " or ".join(dict.fromkeys((effect["id"], *effect["alternatives"])))
        (right if members & set(at_work) else wrong).append(word)
    return {"right": right, "wrong": wrong}


def numbers(verdict: Mapping[str, Any], of: Mapping[str, Mapping[str, float]]) -> pd.DataFrame:
    """Each number that is both stated and known, and whether the truth is `inside` its interval."""
    rows = []
    for effect in stated(verdict):
        known = of.get(effect["id"], {})
        for parameter in effect["parameters"]:
            if parameter["symbol"] in known and parameter["interval_95"]:
                true, (low, high) = known[parameter["symbol"]], parameter["interval_95"]
                rows.append(
                    {
                        "effect": effect["id"],
                        "symbol": parameter["symbol"],
                        "unit": parameter["unit"],
                        "truth": true,
                        "found": parameter["value"],
                        "low_95": low,
                        "high_95": high,
                        "inside": low <= true <= high,
                    }
                )
    columns = ["effect", "symbol", "unit", "truth", "found", "low_95", "high_95", "inside"]
    return pd.DataFrame(rows, columns=columns)


def furthest(table: pd.DataFrame) -> pd.DataFrame:
    """One row an effect: how many of its numbers are inside, and the one that is furthest out in half widths."""
    if table.empty:
        return table.assign(numbers=[], held=[])
    half = (table["high_95"] - table["low_95"]) / 2
    away = (table["truth"] - (table["high_95"] + table["low_95"]) / 2).abs() / half
    rows = []
    for _, own in table.groupby("effect", sort=False):
        worst = own.loc[away[own.index].idxmax()].to_dict()
        rows.append(worst | {"numbers": len(own), "held": int(own["inside"].sum())})
    return pd.DataFrame(rows)


def sensor_for_both(known: Mapping[str, Mapping[str, float]], places_m: np.ndarray) -> dict[str, dict[str, float]]:
    """Numbers that a displaced sensor and unequal rotors have if the sensor stands for the centre of mass as well.

    The weight's moment shows the sum of both displacements, the thrust's the sensor's alone: what the sensor is given
    too much the rotors, at `places_m` (n, 3), take back, with the smallest differences that do.
    """
    own, centre = known["sensor_origin"], known["com_offset"]
    both = {f"d_{a}": own[f"d_{a}"] + centre[f"r_{a}"] for a in "xyz"}
    excess = np.array([centre["r_x"], centre["r_y"]])
    count = len(places_m)
    change = -np.linalg.pinv(np.vstack([places_m[:, :2].T, np.ones(count)])) @ np.append(count * excess, 0.0)
    rotors = {f"d_{i + 1}": known["unequal_rotors"][f"d_{i + 1}"] + float(change[i]) for i in range(count)}
    return {"sensor_origin": both, "unequal_rotors": rotors}


def straight_line(load_n: np.ndarray, error_n: np.ndarray, held_out: np.ndarray) -> dict[str, Any]:
    """What a straight line in the loads, fitted to training runs, leaves of the reading's error on those held out.

    Shapes (n, 3), (n, 3), (n,) bool. `before_n`, `after_n`: RMS of each channel; `slopes`: [channel][load] (1).
    """
    known = np.isfinite(load_n).all(axis=1) & np.isfinite(error_n).all(axis=1)
    fit, test = known & ~held_out, known & held_out
    slopes = np.linalg.lstsq(load_n[fit], error_n[fit], rcond=None)[0]
    left = error_n[test] - load_n[test] @ slopes
    return {
        "before_n": np.sqrt(np.mean(error_n[test] ** 2, axis=0)).tolist(),
        "after_n": np.sqrt(np.mean(left**2, axis=0)).tolist(),
        "slopes": slopes.T.tolist(),
    }
