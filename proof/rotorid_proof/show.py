"""The proof's tables as a reader sees them: shares as percent, targets in words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from rotorid_proof import quoted, table
from rotorid_proof.intervals import wilson

NOT_KEPT = "not kept"


def short_code(code: object) -> str:
    """The beginning of a hash; several, or none that was kept, in words."""
    known = [part for part in str(code).split() if part not in ("nan", "None", "unknown")]
    return " ".join(part[:7] for part in known) or NOT_KEPT


DRAWN_KINDS = {"flights": ("flight",), "stands": ("stand",), "benches": ("bench",), "all": table.KINDS}


def of_stored(cases: pd.DataFrame, plantings: pd.DataFrame, released: str) -> pd.DataFrame:
    """What is too dear for the run that makes a report, a row a count: drawn cases of one release, and plantings.

    `what` is counted, `key` names the row for a text, `count` and `of` are sets (causes in real flights), `share` their
    quotient with its 95 % interval (Wilson), `code` the beginning of the hash of the code that judged.
    """
    own = cases[cases["released"].astype(str) == released]
    clean, right = own["clean"].astype(bool), own["right"].astype(bool)
    named = own["truth"].notna() | own["values_true"].notna()
    code = ", ".join(sorted({short_code(code) for code in own["judged_by"]}))
    rows = []
    for kind, kinds in DRAWN_KINDS.items():
        here = own["kind"].isin(kinds) & ~clean & named
        key = "all" if kind == "all" else "kind"
        rows.append((key, f"something to be named, {kind}: all of it named and no wrong name", right & here, here))
    hidden, other = ~clean & named, ~clean & ~named
    further = own.apply(has_further_name, axis=1)
    rows += [
        (
            "further",
            "of these right ones: a further name that the score allows",
            further & right & hidden,
            right & hidden,
        ),
        ("outside", "outside the catalogue, or too small to be named: no wrong name", right & other, other),
        ("allowed", "of these right ones: a name that is not what is hidden", further & right & other, right & other),
        ("wrong", "something hidden: a wrong name", ~clean & (own["false_count"] > 0), ~clean),
        ("alarms", "nothing hidden: an alarm", clean & own["false_alarm"].astype(bool), clean),
    ]
    out = [_counted(key, what, int(part.sum()), int(whole.sum()), code) for key, what, part, whole in rows]
    large = plantings[(plantings["size"] == "large") & plantings["group"].str.startswith("code ")]
    for key, what in PLANTED.items():
        for score in large[large["what"] == what].to_dict("records"):
            of = int(score["count"])
            planted = short_code(score["group"].removeprefix("code "))
            out.append(_counted(key, PLANTED_WORDS[key], round(float(score["value"]) * of), of, planted))
    columns = ["key", "what", "count", "of", "share", "code"]
    return pd.DataFrame([row for row in out if row["of"]], columns=columns)


def has_further_name(case: pd.Series) -> bool:
    """Whether a case has a name whose class holds nothing of what is hidden."""
    hidden = {*str(case["truth"]).split("; "), str(case["primary"])}
    claims = [] if pd.isna(case["claims"]) else str(case["claims"]).split("; ")
    return any(not hidden & set(claim.split(" or ")) for claim in claims)


PLANTED = {"planted": "named", "planted_size": "size covered"}
PLANTED_WORDS = {
    "planted": "a cause planted in a real flight: named",
    "planted_size": "a cause planted in a real flight: its size inside the stated interval",
}


def _counted(key: str, what: str, count: int, of: int, code: str) -> dict[str, object]:
    low, high = wilson(count, of) if of else (0.0, 0.0)
    share = f"{100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})" if of else ""
    return {"key": key, "what": what, "count": count, "of": of, "share": share.replace(" ", "\u00a0"), "code": code}


def of_studies(real: pd.DataFrame) -> pd.DataFrame:
    """Real recordings, one row each: ids and wrong values in words; error of the channel group recorded best."""
    rows = []
    for _, row in real.iterrows():
        group, unit, digits = ("force", "N", 3) if pd.notna(row["force_after"]) else ("rotor_speed", "rad/s", 1)
        stages = [row[f"{group}_{stage}"] for stage in ("before", "refitted", "after")]
        wrong = [VALUE_UNIT.sub("", v.strip()) for v in str(row["values"]).split(";") if pd.notna(row["values"])]
        found = [words(row["found"])] if pd.notna(row["found"]) else []
        found += [f"wrong {'values' if len(wrong) > 1 else 'value'}: {words(', '.join(wrong))}"] if wrong else []
        error = " / ".join("–" if pd.isna(s) else f"{s:.{digits}f}" for s in stages) + f" {unit}"
        error = "–" if row["word"] == "stopped" else error
        share = row["unexplained_share"]
        expected, confirmed = (
            [] if pd.isna(row[name]) else [words(one) for one in str(row[name]).split("; ")]
            for name in ("expected", "expected_found")
        )
        rows.append(
            {
                "study": row["study"],
                "about": row["about"],
                "found": "the stage stopped" if row["word"] == "stopped" else "; ".join(found) or "nothing",
                "expected": "; ".join(expected) or "–",
                "lacking": "; ".join(one for one in expected if one not in confirmed) or "–",
                "confirmed": len(confirmed) if expected else "",
                "error": error.replace(" ", "\u00a0"),
                "unexplained": "–" if pd.isna(share) else f"{100 * share:.0f} %",
            }
        )
    return pd.DataFrame(
        rows, columns=["study", "about", "expected", "lacking", "confirmed", "found", "error", "unexplained"]
    )


def of_channels(channels: pd.DataFrame) -> pd.DataFrame:
    """Errors on the runs held out of every channel, a row each: three stages and the noise, in the channel's unit.

    `worse`: by how much the delivered model is worse than the refitted values where it is, in percent.
    """
    held = channels[channels["split"] == "held_out"].reset_index(drop=True)
    out = pd.DataFrame({"recordings": held["example"], "channel": held["channel"].map(words), "unit": held["unit"]})
    for name in ("noise_floor", "before", "refitted", "after"):
        out[name] = held[name].map(lambda value: "–" if pd.isna(value) else f"{value:.3g}")
    growth = held["after"] / held["refitted"] - 1
    out["worse"] = [f"{100 * more:.1f} %" if more > LEAST_WORSE else "" for more in growth]
    return out


LEAST_WORSE = 5e-4
"""Growth of an error that its three printed digits may show."""


def power_of(value: float) -> int:
    """The power of ten, a multiple of three, in whose units a small number is written; 0 for others."""
    return 3 * math.floor(math.log10(abs(value)) / 3) if 0 < abs(value) < 1e-3 else 0


def of_effects(effects: pd.DataFrame) -> pd.DataFrame:
    """Effects of a verdict as text: names with their class and status, each number with its interval in one cell."""
    rows = []
    for row in effects.itertuples():
        known = pd.notna(row.value)
        numbers = (row.value, row.low_95, row.high_95) if known else (0.0, 0.0, 0.0)
        largest = max(map(abs, numbers))
        power = power_of(largest)
        # A value that its interval does not separate from zero has no digits of its own.
        decimals = max(0, 2 - math.floor(math.log10(largest / 10**power))) if largest else 0
        form = f".{decimals}f" if abs(numbers[0]) < 0.01 * largest else ".3g"
        value, low, high = (f"{x / 10**power:{form}}".replace("-", "−") for x in numbers)
        others = " or ".join(x for x in words(row.alternatives).split(" or ") if x != words(row.effect))
        rows.append(
            {
                "effect": words(row.effect) + (f" (or: {others})" if others else ""),
                "status": words(row.status),
                "symbol": row.symbol if isinstance(row.symbol, str) else "",
                "value": f"{value} ({low} to {high})" if known else "",
                "unit": ((f"1e{power} " if power else "") + str(row.unit)) if known else "",
            }
        )
    return pd.DataFrame(rows, columns=["effect", "status", "symbol", "value", "unit"])


def of_campaign_sets(sets: pd.DataFrame) -> pd.DataFrame:
    """The campaign's sets as text: verdict, what is at work, and what of it was named, rightly or wrongly."""
    return sets.apply(lambda column: column.map(words)).replace({"right": {"": "–"}, "wrong": {"": "–"}})


def of_campaign_numbers(numbers: pd.DataFrame) -> pd.DataFrame:
    """A row a set and effect as text: how many numbers are inside, and the one furthest out."""
    rows = []
    for row in numbers.itertuples():
        power = power_of(row.found)
        shown = (row.truth, row.found, row.low_95, row.high_95)
        true, found, low, high = (f"{x / 10**power:.4g}".replace("-", "−") for x in shown)
        rows.append(
            {
                "set": row.set,
                "effect": words(row.effect),
                "inside": f"{row.held} of {row.numbers}",
                "symbol": row.symbol,
                "truth": true,
                "found": f"{found} ({low} to {high})",
                "unit": (f"1e{power} " if power else "") + row.unit,
            }
        )
    return pd.DataFrame(rows, columns=["set", "effect", "inside", "symbol", "truth", "found", "unit"])


VALUE_UNIT = re.compile(r"_(kg_m2|kg|n_m_s2|n_s2|m_s2|rad_s)$")
"""The unit at the end of the name of a believed value."""


def words(ids: object) -> str:
    """Ids with underscores as words; nothing as an empty text."""
    return "" if pd.isna(ids) else str(ids).replace("_", " ")


def of_published(coefficients: pd.DataFrame) -> pd.DataFrame:
    """Coefficients found next to published ones, as text: small ones in units of a power of ten."""
    rows = []
    for row in coefficients.itertuples():
        power = power_of(max(abs(row.found), abs(row.published)))
        found, low, high, published = (
            f"{x / 10**power:.3g}" for x in (row.found, row.low_95, row.high_95, row.published)
        )
        rows.append(
            {
                "study": row.study,
                "effect": words(row.effect),
                "symbol": row.symbol,
                "found": f"{found} ({low} to {high})",
                "published": published,
                "unit": (f"1e{power} " if power else "") + row.unit,
                "source": row.source,
            }
        )
    return pd.DataFrame(rows)


LABELLED = {
    "crazypad-normal": "unharmed",
    "crazypad-cut": "propeller 3 cut",
    "crazypad-weight": "weight near rotor 3",
}
"""Sets whose authors say what they did, in words."""
SHOWN_CHANNELS = ("force_z", "moment_x", "moment_y", "position", "velocity", "attitude")
CLAIMED = ("established", "ambiguous")


def labelled_state(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What the verdicts on labelled sets say, by set, for a text; `reason` where one could not be had.

    `unequal` and `com` are the claimed effects that the authors' changes are, or None; `parameters` by symbol.
    """
    missing = [one["reason"] for one in found if not one["available"]]
    sets = {}
    for one in found if not missing else ():
        verdict = one["verdict"]
        claimed = [e for e in verdict["effects"] if e["status"] in CLAIMED]
        by_id = {}
        for name in ("unequal_rotors", "com_offset", "payload", "motor_lag"):
            effect = next((e for e in claimed if name in (e["id"], *e["alternatives"])), None)
            if effect:
                ids = [words(x) for x in dict.fromkeys((effect["id"], *effect["alternatives"]))]
                effect = {**effect, "ids": ids, "numbers": {p["symbol"]: p for p in effect["parameters"]}}
            by_id[name] = effect
        held = {name: channel["rmse"]["held_out"] for name, channel in verdict["channels"].items()}
        sets[one["study"].removeprefix("crazypad-")] = {
            **quoted.said(verdict),
            "names": [words(" or ".join(dict.fromkeys((e["id"], *e["alternatives"])))) for e in claimed],
            "held_out": verdict["runs"]["held_out"],
            "training": len(verdict["runs"]["training"]),
            "left": verdict["unexplained"]["share"],
            "open": verdict["unexplained"]["description"],
            "rmse": held,
            **by_id,
        }
    reason = missing[0] if missing else "" if found else "they are not among the studies of this run"
    return {"available": bool(sets), "reason": reason, "sets": sets}


def of_labelled(judged: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Claimed effects of labelled sets, a row an effect, as text: class, equation, numbers with intervals, share."""
    rows = []
    for name, verdict in judged.items():
        for effect in (e for e in verdict["effects"] if e["status"] in CLAIMED):
            others = [words(x) for x in effect["alternatives"] if x != effect["id"]]
            numbers = []
            for p in effect["parameters"]:
                low, high = p["interval_95"]
                scale, unit = (1000.0, "mm") if p["unit"] == "m" else (1.0, "" if p["unit"] == "1" else p["unit"])
                value, low, high = (f"{scale * x:.2g}".replace("-", "−") for x in (p["value"], low, high))
                numbers.append(f"{p['symbol']} = {value} ({low} to {high}) {unit}".strip())
            share = effect["share"]
            rows.append(
                {
                    "set": LABELLED[name],
                    "effect": words(effect["id"]) + (f" (or: {' or '.join(others)})" if others else ""),
                    "equation": effect["equation"],
                    "numbers": "; ".join(numbers),
                    "share": "–" if share is None else f"{100 * share:.0f} %",
                }
            )
    return pd.DataFrame(rows, columns=["set", "effect", "equation", "numbers", "share"])


def of_errors(judged: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Errors on runs held out of labelled sets: believed, refitted, with the names; half a second simulated too."""
    rows = []
    for name, verdict in judged.items():
        for channel in SHOWN_CHANNELS:
            if channel not in verdict["channels"]:
                continue
            own = verdict["channels"][channel]
            scale, unit = (1000.0, "mN m") if own["unit"] == "N m" else (1.0, own["unit"])
            held = own["rmse"]["held_out"] | {"noise": own["noise_floor"]}
            stages = ("before", "refitted", "named", "after", "noise")
            numbers = {k: "–" if held[k] is None else f"{scale * held[k]:.3g}" for k in stages}
            rows.append({"set": LABELLED[name], "channel": words(channel), "unit": unit, **numbers})
    return pd.DataFrame(rows, columns=["set", "channel", "unit", "before", "refitted", "named", "after", "noise"])


def of_differences(compared: Mapping[str, Any]) -> pd.DataFrame:
    """What `rotorid compare` states of labelled pairs, a row a quantity: difference, and how large it must be."""
    rows = []
    for name, pair in compared["pairs"].items():
        for d in pair["level_1"]["quantities"]:
            if not d["stated"]:
                continue
            quantity = pair["names"][d["id"]]
            scale = 100.0 if quantity.endswith("(%)") else math.degrees(1.0) if "(°)" in quantity else 1.0
            low, high = (scale * x for x in d["interval_95"])
            found = f"{scale * d['difference']:.3g} ({low:.3g} to {high:.3g})".replace("-", "−")
            limit = f"{scale * d['smallest_stated']:.2g}"
            rows.append(
                {"pair": LABELLED[f"crazypad-{name}"], "quantity": quantity, "difference": found, "limit": limit}
            )
    return pd.DataFrame(rows, columns=["pair", "quantity", "difference", "limit"])


_OF_THE_PATH = {
    "elasticity": "thrust by throttle, % a %",
    "late_s": "delay of the rotors, s",
    "voltage": "thrust by voltage, % a %",
}
_SHOWN_PATH = "imrc-brushless/throttle/whole"


def of_concealed(speeds: pd.DataFrame) -> pd.DataFrame:
    """Numbers of the path from command to thrust, a row a quantity: how often they are stated without the recorded
    speeds and right, and one recording's own.

    `speeds` has a row a recording and quantity: what the recorded speeds say (`true`, NaN where nothing), what is
    `stated`, its interval, `status` (right, wrong, silent, unknown) and the code that judged.
    """
    columns = ["what", "known", "stated", "right", "inside", "recorded", "found", "code"]
    rows = []
    for quantity, words in _OF_THE_PATH.items() if len(speeds) else ():
        of = speeds[(speeds["quantity"] == quantity) & speeds["true"].notna()]
        stated = of[of["status"].isin(["right", "wrong"])]
        row = {"what": words, "known": len(of), "stated": len(stated), "right": int((of["status"] == "right").sum())}
        row["inside"] = int((stated["held"].astype(str) == "True").sum())
        for one in of[of["set"] == _SHOWN_PATH].itertuples():
            row |= {"recorded": f"{one.true:.2g}", "found": f"{one.stated:.2g} ({one.low_95:.2g} to {one.high_95:.2g})"}
        rows.append(row | {"code": of["judged_by"].iloc[0]})
    return pd.DataFrame(rows, columns=columns)
