"""Verdicts on the campaign's own sets against the emulators' truth, opened here and nowhere else.

- What is at work in each set, what the verdict names of it, and which of its numbers are inside their intervals.
- Whether the stand's numbers are those of one displacement, of sensor or centre of mass, that is taken for both.
- What a straight line in the loads leaves of the aluminium bench's error, which the verdict may call unexplained.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.io.text.files import read_yaml
from rotorid.mismatch.tell.consistency import EXPLAINED_SHARE
from rotorid.recordings import read_set
from rotorid_lab import log
from rotorid_proof import campaign, quoted

LINE, STAND = "campaign-bench-al", "campaign-stand"
SETS = ["set", "verdict", "hidden", "right", "wrong"]
NUMBERS = ["set", "effect", "numbers", "held", "symbol", "unit", "truth", "found", "low_95", "high_95"]


def main(
    verdicts: Sequence[str],
    ledgers: Sequence[str],
    sets: Mapping[str, str],
    truth: Sequence[str],
    out: Mapping[str, str],
) -> None:
    """Write what each verdict says (JSON), its channels, and against the truth a row a set and an effect (CSV).

    `truth` is empty where it is not known: both of these are empty then.
    """
    judged = [json.loads(Path(path).read_text(encoding="utf-8")) for path in verdicts]
    found = {verdict["set"]: verdict for verdict in judged}
    state = {"verdicts": {name: quoted.said(verdict) for name, verdict in found.items()}}
    state["thresholds"] = {"explained": EXPLAINED_SHARE, "unexplained": 1.0 - EXPLAINED_SHARE}
    rows = [row for name, verdict in found.items() for row in quoted.channels(name, verdict)]
    pd.DataFrame(rows, columns=quoted.CHANNEL_COLUMNS).to_csv(out["channels"], index=False, float_format="%.6g")
    if LINE in found:
        ledger = json.loads(Path(ledgers[list(found).index(LINE)]).read_text(encoding="utf-8"))
        state["line"] = campaign.straight_line(*_readings(sets[LINE], found[LINE]["runs"]["held_out"]))
        state["line"]["crosstalk"] = _stated(found[LINE], "crosstalk")
        state["line"]["ledger"] = [entry["sentence"] for entry in ledger if entry["on"] == "crosstalk"]
    rows, numbers = [], []
    if truth:
        true = read_yaml(Path(truth[0]))
        known = true["sets"]
        state["torque_sensor"] = {"force_into_moment_z": true["force_into_moment_z_m"]}
        if STAND in found:
            places_m = read_set(Path(sets[STAND])).vehicle.rotor_positions_m()
            state["sensor"] = _as_displaced(found[STAND], known[STAND], true, places_m)
        for name, verdict in found.items():
            named = campaign.names(verdict, known[name]["ids"])
            row = {"set": name, "verdict": verdict["verdict"], "hidden": "; ".join(known[name]["ids"])}
            rows.append(row | {word: "; ".join(ids) for word, ids in named.items()})
            numbers.append(campaign.furthest(campaign.numbers(verdict, known[name]["numbers"])).assign(set=name))
    pd.DataFrame(rows, columns=SETS).to_csv(out["sets"], index=False)
    table = pd.concat(numbers) if numbers else pd.DataFrame()
    table.reindex(columns=NUMBERS).to_csv(out["numbers"], index=False, float_format="%.6g")
    Path(out["state"]).write_text(json.dumps(state, indent=1) + "\n", encoding="utf-8")


def _stated(verdict: Mapping, effect_id: str) -> dict[str, tuple[float, float, float]]:
    """Value and 95 % interval of each parameter of an effect that is claimed; empty where it is not."""
    claimed = [e for e in verdict["effects"] if e["id"] == effect_id and e["status"] in ("established", "ambiguous")]
    return {p["symbol"]: (p["value"], *p["interval_95"]) for e in claimed for p in e["parameters"]}


def _as_displaced(verdict: Mapping, known: Mapping, true: Mapping, places_m: np.ndarray) -> dict:
    """How many of the stand's numbers are the true ones, and how many those of one displacement that is taken for two.

    A displaced sensor and a displaced centre of mass are at work, and the verdict names one of them.
    """
    claimed = [e["id"] for e in campaign.stated(verdict) if e["id"] in ("sensor_origin", "com_offset")]
    named = claimed[0] if claimed else "com_offset"
    alike = campaign.sensor_for_both(known["numbers"], places_m) if named == "sensor_origin" else true["displaced"]
    seen = campaign.numbers(verdict, alike)
    own = campaign.numbers(verdict, {name: known["numbers"][name] for name in alike})
    own = own[own["symbol"].isin(seen["symbol"])]
    rotors = own[own["effect"] == "unequal_rotors"].set_index("symbol")
    furthest = (rotors["found"] - rotors["truth"]).abs().idxmax() if len(rotors) else None
    return {
        "named": named,
        "place_error_m": true["sensor_place_error_m"],
        "sum_m": [
            known["numbers"]["sensor_origin"][f"d_{a}"] + known["numbers"]["com_offset"][f"r_{a}"] for a in "xyz"
        ],
        "numbers": len(seen),
        "inside_truth": int(own["inside"].sum()),
        "inside_displaced": int(seen["inside"].sum()),
        "rotor": None
        if furthest is None
        else {
            "number": int(furthest.split("_")[1]),
            "found": float(rotors.loc[furthest, "found"]),
            "truth": float(rotors.loc[furthest, "truth"]),
            "displaced": alike["unequal_rotors"][furthest],
        },
    }


def _readings(folder: str, held_out: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Loads and errors (n, 3) of a bench set, and which samples are of runs held out (n,)."""
    loads, errors, held = [], [], []
    for run in read_set(Path(folder)).runs:
        loads.append(run.table[[f"reference_force_{a}_n" for a in "xyz"]].to_numpy())
        errors.append(run.table[[f"force_{a}_n" for a in "xyz"]].to_numpy() - loads[-1])
        held.append(np.full(len(run.table), run.name in held_out))
    return np.concatenate(loads), np.concatenate(errors), np.concatenate(held)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            verdicts=snakemake.input.verdicts,
            ledgers=snakemake.input.ledgers,
            sets=snakemake.params.sets,
            truth=snakemake.input.truth,
            out=dict(snakemake.output.items()),
        )
