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


def _energies(channels: Mapping[str, Channel], located: Sequence[str]) -> tuple[float, float, float]:
    """Energies before, with what is named, and of the noise floor over located channels, each in units of its floor."""
    before = named = noise = 0.0
    for name in located:
        errors, floor = quoted(channels[name]), channels[name].noise_floor
        if errors.before is None or errors.named is None or not floor:
            continue
        before, named, noise = before + (errors.before / floor) ** 2, named + (errors.named / floor) ** 2, noise + 1.0
    return before, named, noise


def share_left(channels: Mapping[str, Channel], located: Sequence[str], samples: Mapping[str, int]) -> float:
    """Share of the mismatch that is left, from the errors printed; of an error that is by chance what it is, none."""
    before, named, noise = _energies(channels, located)
    if before <= noise * _by_chance(min((samples[name] for name in located), default=1)) ** 2:
        return 0.0
    return min(1.0, max(0.0, named - noise) / max(before - noise, noise)) if noise else 0.0


MOST_OFF = 0.2
"""Share of the weight that a force may be off by in what is called explained."""


def verdict_word(
    analysis: Analysis, locations: Sequence[Location], left: float, channels: Mapping[str, Channel]
) -> VerdictWord:
    """One of the four words, from what was found, the share that is left, and the errors of the channels.

    Nothing is explained while a force stays off by more than a fifth of the weight.
    """
    if not with_status(analysis, *CLAIMED) and not analysis.wrong_values:
        return "unexplained" if locations else "no_mismatch"
    if left <= EXPLAINED_SHARE:
        return "partly_explained" if _force_is_off(analysis, channels) else "explained"
    return "partly_explained" if left < 1.0 - EXPLAINED_SHARE else "unexplained"


def _force_is_off(analysis: Analysis, channels: Mapping[str, Channel]) -> bool:
    """Whether some force of a flight is off by more than MOST_OFF of the weight with what is named."""
    vehicle = analysis.believed
    if vehicle.kind != "flight":
        return False
    forces = [c.rmse.held_out for name, c in channels.items() if name.startswith("force")]
    off_n = max((errors.named for errors in forces if errors is not None), default=0.0)
    return off_n > MOST_OFF * vehicle.mass_kg * vehicle.gravity_m_s2


def located_channels(locations: Sequence[Location], channels: Mapping[str, Channel]) -> tuple[str, ...]:
    """Channels in which the mismatch is located; all of force and moment where a fault of the set left no place."""
    named = {location.channel for location in locations}
    return tuple(c for c in channels if c in named) or tuple(channels)


def _by_chance(samples: int) -> float:
    """Ratio of two root mean squares of so many samples of one noise that hardly any exceeds."""
    return float(np.sqrt(f.isf(_CHANCE, samples, samples)))


def _plainly_off(samples: int) -> float:
    """Error in units of the noise floor from which a channel is off, where both come of so few samples."""
    plainly_off = 1.5
    return max(plainly_off, _BEYOND_CHANCE * _by_chance(samples))


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
    # Where nothing is stated, values corrected within their trust may be all that it takes.
    stated = with_status(analysis, *CLAIMED) or analysis.wrong_values
    for name, channel in channels.items():
        both = (channel.rmse.held_out, channel.noise_floor), (channel.rmse.training, analysis.noise_floor.get(name))
        errors = [x / n for e, n in both if (x := e.before if stated else e.named) is not None and n]
        wrench = name.split("_")[0] in ("force", "moment")
        if wrench and name not in there and max(errors, default=0.0) > _plainly_off(samples[name]):
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
