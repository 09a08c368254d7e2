"""One verdict against one sealed answer. Pure functions on the two parsed JSON files.

Words used here:

- A *claim* is an effect of status `established` or `ambiguous`; its *class* is the id alone, or the alternatives too.
- A claim is *sharp* about a true effect if its class holds the effect and nothing but names that the answer lists as
  indistinguishable from it (`equivalent`).
- A claim is *false* if its class holds no true effect, nothing that is indistinguishable from one, and nothing that the
  answer calls `fair` to say in addition (a filter's delay, a vibration that is in an autopilot's log).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotorid_proof.spelling import translated
from rotorid_proof.units import same_unit

CLAIMED = ("established", "ambiguous")
LOCATION_STEP_S = 0.05
"""Grid on which true and reported stretches of time are compared."""
SMALLEST_P = 1e-300
REGIMES = {
    "rotor_drag": {"airspeed_m_s", "forward_speed_m_s", "sideward_speed_m_s"},
    "frame_drag": {"airspeed_m_s", "forward_speed_m_s", "sideward_speed_m_s"},
    "translational_lift": {"airspeed_m_s", "forward_speed_m_s", "sideward_speed_m_s"},
    "flapping_moment": {"airspeed_m_s", "forward_speed_m_s", "sideward_speed_m_s"},
    "rotor_interference": {"airspeed_m_s", "forward_speed_m_s", "sideward_speed_m_s"},
    "axial_inflow": {"vertical_speed_over_hover_inflow"},
    "vortex_ring": {"vertical_speed_over_hover_inflow"},
    "ground_effect": {"height_over_rotor_radius", "height_m"},
    "rotor_acceleration_torque": {"rotor_acceleration_rad_s2"},
    "battery_sag": {"battery_voltage_v"},
    "rotational_damping": {"body_rate_rad_s"},
}
"""Regime variables in which an effect shows by its own formula."""
BLADE = "blade"
"""Form of an answer whose parameters are not the catalogue's: no interval can be held against them."""


@dataclass(frozen=True)
class Claim:
    """An effect that a verdict holds to be at work."""

    id: str
    members: frozenset[str]
    """The class: `id` and its alternatives."""
    strength: tuple[float, float]
    """Sorts claims, strongest first: p-value, then held-out rmse ratio."""

    @property
    def is_ambiguous(self) -> bool:
        return len(self.members) > 1


def claims_of(verdict: Mapping[str, Any]) -> list[Claim]:
    """Claims of a verdict, strongest first; of several with one class the strongest stands for all."""
    found: dict[frozenset[str], Claim] = {}
    for effect in verdict.get("effects", ()):
        if effect["status"] not in CLAIMED:
            continue
        others = effect["alternatives"] if effect["status"] == "ambiguous" else ()
        p = effect["p_value"]
        gain = effect.get("held_out_gain") or {}
        ratio = gain.get("rmse_ratio")
        strength = (max(SMALLEST_P, 1.0 if p is None else p), 1.0 if ratio is None else ratio)
        claim = Claim(effect["id"], frozenset({effect["id"], *others}), strength)
        if claim.members not in found or strength < found[claim.members].strength:
            found[claim.members] = claim
    return sorted(found.values(), key=lambda c: c.strength)


def equivalents(answer: Mapping[str, Any]) -> dict[str, frozenset[str]]:
    """True effect to the names that these data cannot distinguish from it, itself among them."""
    out = {}
    for effect in answer["effects"]:
        names = {effect["id"]}
        for entry in effect["equivalent"]:  # names, or groups of names with the effect itself among them
            names |= {entry} if isinstance(entry, str) else set(entry)
        out[effect["id"]] = out.get(effect["id"], frozenset()) | names
    return out


def true_effects(answer: Mapping[str, Any]) -> list[str]:
    """Ids that are to be found: all that is expected but the wrong values."""
    return [e for e in answer["expected"] if e not in answer["wrong_parameters"]]


def acceptable_names(answer: Mapping[str, Any]) -> frozenset[str]:
    """Names of which a class must hold one not to be false: true ones, what is the same as those, and what is fair."""
    outside = (o["acceptable"] for o in answer["outside_catalogue"])
    return frozenset().union(*equivalents(answer).values(), true_effects(answer), *outside, answer.get("fair", ()))


def is_sharp(claim: Claim, effect: str, same: frozenset[str]) -> bool:
    """Whether a claim names a true effect as exactly as the data allow."""
    return effect in claim.members and claim.members <= same


def f1_of_times(
    true: Iterable[tuple[str, float, float]], found: Iterable[tuple[str, float, float]]
) -> dict[str, float] | None:
    """Overlap of stretches (run, start_s, stop_s) in seconds: `f1`, `precision`, `recall`; None where none is true.

    Stretches of one run that overlap count once.
    """

    def cells(stretches):
        out = set()
        for run, start, stop in stretches:
            first, last = round(start / LOCATION_STEP_S), round(stop / LOCATION_STEP_S)
            out |= {(run, k) for k in range(first, last)}
        return out

    wanted, got = cells(true), cells(found)
    if not wanted:
        return None
    both = len(wanted & got)
    return {
        "f1": 2 * both / (len(wanted) + len(got)),
        "precision": both / len(got) if got else 0.0,
        "recall": both / len(wanted),
    }


def parameter_scores(verdict: Mapping[str, Any], answer: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Every true number next to the verdict's estimate and interval, where the verdict names the same symbol."""
    out = []
    claimed = {e["id"]: e for e in verdict.get("effects", ()) if e["status"] in CLAIMED}
    for effect in answer["effects"]:
        if effect["form"] == BLADE or effect["id"] not in claimed:
            continue
        estimates: dict[str, list] = {}
        for p in claimed[effect["id"]]["parameters"]:
            estimates.setdefault(p["symbol"], []).append(p)
        truths = translated(effect["id"], effect["parameters"])
        symbols = [p["symbol"] for p in truths]
        for truth in truths:
            found = estimates.get(truth["symbol"], [])
            value = truth["value"]
            # A symbol that stands more than once (several gusts, swapped columns) has no single true value.
            numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
            if len(found) != 1 or symbols.count(truth["symbol"]) != 1 or not numeric:
                continue
            if same_unit(found[0]["unit"], truth["unit"]):
                out.append(_compared(effect["id"], truth["symbol"], value, found[0]["value"], found[0]["interval_95"]))
    for name, values in answer["wrong_parameters"].items():
        found = verdict.get("parameters", {}).get(name)
        if found is not None:
            # As a share of what was believed: a scale of distances is believed to be one by the verdict.
            low, high = (None if x is None else x / found["believed"] for x in found["interval_95"])
            share = values["true"] / values["believed"]
            out.append(_compared("", name, share, found["refitted"] / found["believed"], (low, high)))
    return [p for p in out if p is not None]


def _compared(effect, symbol, true, value, interval) -> dict[str, Any] | None:
    if value is None:
        return None
    low, high = (None, None) if not interval else interval
    known = low is not None and high is not None and high > low
    return {
        "effect": effect,
        "symbol": symbol,
        "true": true,
        "estimate": value,
        "relative_error": abs(value - true) / abs(true) if true else None,
        "covered": bool(low <= true <= high) if known else None,
    }


def kind_and_rest(case: str) -> tuple[str, str]:
    """`stand`, `bench` or `flight`, and a case's name without it: only flights are not named so."""
    first, _, rest = case.partition("/")
    return (first, rest) if first in ("stand", "bench") else ("flight", case)


def oracle_rms(answer: Mapping[str, Any], held_out: Sequence[str], samples_per_row: int = 1) -> dict[str, float]:
    """Rms that the true model leaves on the held-out runs, force (N) and moment (N m) channels; runs weigh alike.

    Flights are compared through a low-pass (`noise_rms`); stands and benches as they were read, or as means of
    `samples_per_row` samples (`noise_rms_of_means`).
    """

    def noise(channel: Mapping[str, Any]) -> float | None:
        means = channel.get("noise_rms_of_means")
        return channel.get("noise_rms") if means is None else means.get(str(samples_per_row))

    known = answer.get("oracle", {}).get("runs", {})
    runs = [known[run] for run in held_out if run in known]
    channels = (
        [c for c in runs[0] if c.split("_")[0] in ("force", "moment") and noise(runs[0][c]) is not None] if runs else []
    )
    return {c: math.sqrt(sum(noise(run[c]) ** 2 for run in runs) / len(runs)) for c in channels}


def held_out_ratio(verdict: Mapping[str, Any], oracle: Mapping[str, float], stage: str) -> float | None:
    """Held-out rmse of a stage over what the true model leaves, root mean square over force and moment channels."""
    ratios = []
    for channel, noise in oracle.items():
        found = verdict.get("channels", {}).get(channel)
        value = found["rmse"]["held_out"][stage] if found else None
        if value is not None and noise > 0:
            ratios.append(value / noise)
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None


def regime_right(verdict: Mapping[str, Any], effects: Sequence[str]) -> bool | None:
    """Whether a location's regime is one in which a true effect shows; None where no location states a regime."""
    stated = {loc["regime"]["variable"] for loc in verdict.get("locations", ()) if loc.get("regime")}
    allowed = set().union(*(REGIMES.get(e, set()) for e in effects)) if effects else set()
    if not stated or not allowed:
        return None
    return bool(stated & allowed)


def score_case(verdict: Mapping[str, Any], answer: Mapping[str, Any], samples_per_row: int = 1) -> dict[str, Any]:
    """All scores of one verdict.

    Parameters
    ----------
    verdict
        `verdict.json`, or `{"failed": "reason"}` of a stage that stopped: it claims nothing and is right in nothing.
    answer
        The sealed answer.
    samples_per_row
        How many samples a row of the verdict's errors is the mean of.
    """
    failed = "failed" in verdict
    oracle = oracle_rms(answer, verdict.get("runs", {}).get("held_out", ()), samples_per_row)
    claims = claims_of(verdict)
    same = equivalents(answer)
    wrong = set(answer["wrong_parameters"])
    truth = true_effects(answer)
    for effect in truth:
        same.setdefault(effect, frozenset({effect}))
    outside = answer["outside_catalogue"]
    fair = set(answer.get("fair", ()))
    near = acceptable_names(answer)
    false = [c for c in claims if not c.members & near]
    covered = [e for e in truth if any(e in c.members for c in claims)]
    sharp = [e for e in truth if any(is_sharp(c, e, same[e]) for c in claims)]
    primary = answer["effects"][0]["id"] if answer["effects"] else None
    named = not failed and primary in sharp and bool(claims) and bool(claims[0].members & set(truth))
    open_question = any(len(same[e] - wrong) > 1 for e in truth)
    stated = [c for c in claims if c.is_ambiguous]
    if open_question:
        states = any(same[e] - {"mass_kg"} <= c.members for e in truth if len(same[e]) > 1 for c in claims)
    else:
        states = not stated
    times = f1_of_times(
        [(x["run"], x["start_s"], x["stop_s"]) for x in answer["locations"]],
        [(x["run"], x["start_s"], x["stop_s"]) for x in verdict.get("locations", ())],
    )
    values = set(verdict.get("parameters", {}))
    word = verdict.get("verdict")
    alarm = any(not c.members & fair for c in claims) or bool(values - fair) or word not in answer["verdict"]
    whole = not failed and len(sharp) == len(truth) and not false
    nothing = not (truth or wrong or outside or answer["effects"])
    return {
        "set": answer["set"],
        "case": answer["case"],
        "kind": kind_and_rest(answer["case"])[0],
        "family": kind_and_rest(answer["case"])[1].split("/")[0],
        "failed": failed,
        "truth": truth,
        "primary": primary,
        "separable": not open_question,
        "claims": [sorted(c.members) for c in claims],
        "claimed": [c.id for c in claims],
        "named": named,
        "top_one": bool(claims) and bool(claims[0].members & set(truth)),
        "inside": not failed and len(covered) == len(truth),
        "whole_set": whole,
        "right": not failed and not alarm if nothing else whole and values >= wrong and values <= wrong | fair,
        "clean": nothing,
        "claim_count": len(claims),
        "false_count": len(false),
        "false_names": sorted(c.id for c in false),
        "missed": [e for e in truth if e not in covered],
        "blurred": [e for e in covered if e not in sharp],
        "values_claimed": sorted(values),
        "values_true": sorted(wrong),
        "values_right": values >= wrong if wrong else None,
        "false_alarm": not failed and alarm,
        "word": word,
        "word_right": word in answer["verdict"],
        "ambiguity_there": open_question,
        "ambiguity_right": not failed and states,
        "parameters": parameter_scores(verdict, answer),
        "location": times,
        "regime_right": regime_right(verdict, truth),
        "held_out_before": held_out_ratio(verdict, oracle, "before"),
        "held_out_refitted": held_out_ratio(verdict, oracle, "refitted"),
        "held_out_after": held_out_ratio(verdict, oracle, "after"),
        "size_over_noise": next((e["size_over_noise"] for e in answer["effects"]), None),
        "grade": answer.get("grade", ""),
        "released": answer.get("released", ""),
    }
