"""What makes a verdict agree with itself: its word and its shares follow from the errors that it prints.

With b, a and n the energies of before, named and the noise floor over the located channels of the runs held out, each
channel in units of its floor, the share left is max(0, a − n) / max(b − n, n): up to 0.15 the mismatch is explained,
below 0.85 partly. Derivatives, which have no cause, explain nothing. A reader with a
pocket calculator gets the same word.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.stats import f

from rotorid.mismatch.decide.findings import Analysis, Finding, with_status
from rotorid.mismatch.decide.status import CLAIMED

if TYPE_CHECKING:
    from rotorid.mismatch.tell.verdict import Channel, Errors, Location

VerdictWord = Literal["no_mismatch", "explained", "partly_explained", "unexplained", "not_judged"]
EXPLAINED_SHARE = 0.15
"""Up to this share of the mismatch's energy may be left for the word `explained`; from all but this share on the
findings are said to explain nothing that matters."""
_CHANCE, _BEYOND_CHANCE = 0.001, 1.2
"""Probability of a ratio of two root mean squares by chance, and how far beyond such a ratio an error must be."""


def quoted(channel: Channel) -> Errors:
    """A channel's errors on the runs held out; where nothing of it is held out, on the fitted ones."""
    return channel.rmse.training if channel.rmse.held_out.named is None else channel.rmse.held_out


def share_left(channels: Mapping[str, Channel], locations: Sequence[Location], samples: Mapping[str, int]) -> float:
    """Share of the mismatch that is left, from the errors printed; of an error that is by chance what it is, none.

    Over the channels in which the mismatch is located; all of force and moment where a fault of the set left no place.
    """
    named_there = {location.channel for location in locations}
    located = [c for c in channels if c in named_there] or list(channels)
    before = named = noise = 0.0  # energies, each in units of its channel's floor
    for name in located:
        errors, floor = quoted(channels[name]), channels[name].noise_floor
        if errors.before is not None and errors.named is not None and floor:
            before, named, noise = before + (errors.before / floor) ** 2, named + (errors.named / floor) ** 2, noise + 1
    if before <= noise * _by_chance(min((samples[name] for name in located), default=1)) ** 2:
        return 0.0
    return min(1.0, max(0.0, named - noise) / max(before - noise, noise)) if noise else 0.0


def verdict_word(
    analysis: Analysis, locations: Sequence[Location], left: float, channels: Mapping[str, Channel]
) -> VerdictWord:
    """One of the four words, from what was found, the share that is left, and the errors of the channels.

    Nothing is explained while a force stays off by more than a fifth of the weight.
    """
    if not with_status(analysis, *CLAIMED) and not analysis.wrong_values:
        return "unexplained" if locations else "no_mismatch"
    most_off, vehicle = 0.2, analysis.believed
    if left <= EXPLAINED_SHARE and vehicle.kind == "flight":
        forces = (c.rmse.held_out.named or 0.0 for name, c in channels.items() if name.startswith("force"))
        off = max(forces, default=0.0) > most_off * vehicle.mass_kg * vehicle.gravity_m_s2
        return "partly_explained" if off else "explained"
    if left <= EXPLAINED_SHARE:
        return "explained"
    return "partly_explained" if left < 1.0 - EXPLAINED_SHARE else "unexplained"


def _by_chance(samples: int) -> float:
    """Ratio of two root mean squares of so many samples of one noise that hardly any exceeds."""
    return float(np.sqrt(f.isf(_CHANCE, samples, samples)))


def missing_places(
    analysis: Analysis, locations: Sequence[Location], channels: Mapping[str, Channel], samples: Mapping[str, int]
) -> list[tuple[str, float]]:
    """Channels (with p-values) that must be located too: sentence, list and pictures speak of the same ones.

    Of each effect that a model holds the channel it betters most; what stays unexplained though nothing was located;
    a channel whose error is far above its noise floor: on the fitted runs above their own, since a run with more noise
    than others is no mismatch. `samples`: of each channel those fitted or held out, the fewer.
    """
    there = {location.channel for location in locations}
    out: dict[str, float] = {}
    for finding in with_status(analysis, *CLAIMED):
        own = [c for c in finding.channels if c in channels]
        if finding.id in analysis.without and own and not there & set(own):
            out.setdefault(own[0], finding.p_value)
            there.add(own[0])
    if not there and not analysis.wrong_values:
        out |= {c: analysis.p_values.get(c, (1.0, 1.0))[1] for c in analysis.unexplained_channels if c in channels}
    plainly_off = 1.5  # Error in units of the noise floor from which a channel is off, unless few samples allow more.
    # Where nothing is stated, values corrected within their trust may be all that it takes.
    stated = with_status(analysis, *CLAIMED) or analysis.wrong_values
    for name, channel in channels.items():
        both = (channel.rmse.held_out, channel.noise_floor), (channel.rmse.training, analysis.noise_floor.get(name))
        errors = [x / n for e, n in both if (x := e.before if stated else e.named) is not None and n]
        wrench = name.split("_")[0] in ("force", "moment")
        allowed = max(plainly_off, _BEYOND_CHANCE * _by_chance(samples[name])) if wrench else np.inf
        if name not in there and max(errors, default=0.0) > allowed:
            out.setdefault(name, analysis.p_values.get(name, (1.0, 1.0))[0])
    return [(c, p) for c, p in out.items() if c not in {location.channel for location in locations}]


def by_share(findings: Sequence[Finding], shares: Mapping[str, float]) -> list[Finding]:
    """Findings in the order of their shares: the stated ones first, mistakes of the set before all."""
    order = {"established": 0, "ambiguous": 0, "suggested": 1, "absorbed": 2, "not_established": 3}
    return sorted(findings, key=lambda f: (order[f.status], -shares.get(f.id, 2.0 if f.status in CLAIMED else 0.0)))


def carrying(findings: Sequence[Finding], shares: Mapping[str, float]) -> list[Finding]:
    """Those of the stated findings, the largest share first, that together take away nine tenths of the error."""
    out, total = [], 0.0
    ordered = by_share(findings, shares)
    whole = sum(shares.get(f.id, 0.0) for f in ordered)
    for finding in ordered:
        if out and total >= 0.9 * whole:
            break
        out.append(finding)
        total += shares.get(finding.id, 0.0)
    return out
