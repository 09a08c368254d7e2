"""The ledger of a verdict: every rule that decided something, on what, with its numbers and its sentence.

It lies next to the verdict (`ledger.json`), for whoever wants to know why an effect is not in the model, or why its
status is no higher.
"""

from __future__ import annotations

import json
import math

from rotorid.io.text.writing import rounded
from rotorid.mismatch.decision.findings import Analysis, Finding
from rotorid.mismatch.decision.rules import RULES
from rotorid.mismatch.tell.verdict import Verdict


def ledger(analysis: Analysis, verdict: Verdict) -> list[dict]:
    """Entries of `rule`, `on`, `numbers` and `sentence`, in the order of the decisions."""
    out = [entry("enough_to_compare", "runs", sentence=text) for text in analysis.recordings.left_out]
    out += [of_finding(f, analysis) for f in analysis.findings]
    for name, (believed, refitted, low, high) in analysis.wrong_values.items():
        numbers = {"believed": believed, "refitted": refitted, "low_95": low, "high_95": high}
        out.append(entry("wrong_value", name, numbers, "the fitted runs contradict what is believed"))
    out += [entry("within_trust", "values", sentence=text) for text in analysis.corrected]
    left = {"share_left": verdict.unexplained.share}
    out.append(entry("word_from_numbers", verdict.verdict, left, verdict.unexplained.description))
    out += [entry(name, "search", {"fired": n}, RULES[name].decides) for name, n in sorted(analysis.fired.items())]
    return [e for e in out if e]


def of_finding(finding: Finding, analysis: Analysis) -> dict:
    """What decided on one id."""
    numbers: dict = {"p_value": finding.p_value} if finding.p_value < 1.0 else {}
    if finding.probability is not None:
        numbers["probability"] = finding.probability
    if finding.id in analysis.shares:
        numbers["share"] = analysis.shares[finding.id]
    if finding.gain is not None:
        numbers |= dict(zip(("rmse_ratio", "low_95", "high_95"), finding.gain, strict=True))
    if finding.status == "not_established":
        return entry(finding.rule or "search", finding.id, numbers, finding.sentence)
    if finding.status == "absorbed":
        return entry("absorbed_by_values", finding.id, numbers, finding.sentence)
    if finding.status == "suggested":
        return entry("suggested", finding.id, numbers, finding.objection)
    if finding.id not in analysis.without:
        return entry("mistakes_first", finding.id, numbers, finding.sentence)
    if finding.status == "ambiguous":
        return entry("class", finding.id, numbers, f"these data cannot distinguish {', '.join(finding.alternatives)}")
    return entry("established", finding.id, numbers, "it passed every rule")


def entry(rule: str, on: str, numbers: dict | None = None, sentence: str = "") -> dict:
    """One line of the ledger."""
    known = {name: value for name, value in (numbers or {}).items() if math.isfinite(value)}
    return {"rule": rule, "on": on, "numbers": rounded(known), "sentence": str(sentence)}


def text_of(entries: list[dict]) -> str:
    """The ledger as it is written."""
    return json.dumps(entries, indent=1, allow_nan=False) + "\n"
