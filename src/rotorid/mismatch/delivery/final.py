"""The analysis whose model holds what is claimed and passes the gate, and nothing else, for every kind of set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from rotorid.mismatch.decision.evidence import with_shares
from rotorid.mismatch.decision.findings import Analysis, Finding
from rotorid.mismatch.decision.words import parameter_words
from rotorid.mismatch.delivery.gate import Gated, Offer, Residuals, Settled, gate
from rotorid.mismatch.delivery.parts import improved_vehicle
from rotorid.mismatch.delivery.stated import restated, value_correlations, value_rows
from rotorid.mismatch.delivery.usable import exports_lost
from rotorid.mismatch.model.delivered import FittedModel, Values
from rotorid.mismatch.model.values import names_of
from rotorid.recordings import Vehicle


@dataclass(frozen=True)
class Offered:
    """What an analysis offers for delivery."""

    words: Analysis
    """Of the whole choice, with its statuses, which stay."""
    model: FittedModel
    """Of the fitted runs, with what is claimed alone."""
    offer: Offer
    plain: Values
    """Values called wrong where no effect is at work."""
    believed_left: Residuals
    """What the believed vehicle leaves of every stretch."""
    believed: Vehicle
    stated: Values
    """Wrong values as the analysis states them."""
    moved: Values
    """Values that the whole choice moved within their trust."""
    names: Mapping[str, str]
    """Keys of values to their contract names."""
    whole: bool
    """Whether `model` and `offer` lack nothing of the choice."""
    improved: Callable[[Settled], Vehicle]
    """The vehicle of a settled offer, without its effects."""
    again: Callable[[Gated, tuple[Finding, ...]], Analysis]
    """What remains, accounted for on every run anew."""
    unusable: Callable[[Settled], str] = lambda settled: ""
    """Why the vehicle of a settled offer is no body that hovers and flies; empty where it is."""
    remarks: tuple[str, ...] = ()
    restates: bool = True
    """Whether numbers are stated by the settled fit even where nothing was kept out; else by the fit that found them,
    with the believed values free."""


def as_delivered(offered: Offered) -> Analysis:
    """What an offer amounts to once it has passed the gate; statuses, wrong values and their reasons stay."""
    words, model = offered.words, offered.model
    gated = gate(model, offered.offer, offered.plain, offered.believed_left, offered.unusable)
    settled = gated.settled
    through = offered.whole and gated.passes_whole and settled.moved.keys() == offered.moved.keys()
    stated = words.findings if through and not offered.restates else restated(words.findings, model, settled)
    findings = tuple(replace(f, withheld=gated.withheld.get(f.id, "")) for f in stated)
    if through:
        last = replace(words, findings=findings, improved=offered.improved(settled))
    else:
        last = replace(
            offered.again(gated, findings),
            findings=findings,
            values=words.values,
            suggested_values=words.suggested_values,
            instead=words.instead,
            not_testable=words.not_testable,
        )
    reasons, of_name = gated.withheld_values, names_of(offered.stated, offered.names)
    fell_back = [fell_back_note(key, why, offered.names) for key, why in gated.fell_back.items()]
    return replace(
        with_shares(last),
        worse_elsewhere=tuple(map(str, gated.worse(model))),
        withheld_values={name: reasons[k] for name, keys in of_name.items() for k in keys if k in reasons},
        notes=(*last.notes, *fell_back, *offered.remarks, *exports_lost(improved_vehicle(last), offered.believed)),
        believed_values=value_rows(model, settled, last.improved, offered.believed, offered.names),
        value_correlations=value_correlations(model, settled, offered.names),
    )


def fell_back_note(key: str, why: str, names: Mapping[str, str]) -> str:
    """That a value of the refitted vehicle is left as believed."""
    return f"Refitted, the {parameter_words(names[key])[0]} stays as believed: {why}."
