"""What the runs held out say of every stated effect, and the word that this leaves it.

An effect is established if on the runs held out at least one channel is better with it (the whole interval of the ratio
below 1), none that it acts on is worse, its main parameter is away from nothing, and what it contributes is more than
what the model leaves over. Else it is suggested, with its numbers and the reason. The model stays as it was chosen: the
runs held out lower a word, nothing else.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch import rules
from rotorid.mismatch.comparison import VOTES_FROM
from rotorid.mismatch.findings import CLAIMED, Analysis, Finding, Trace
from rotorid.mismatch.shares import fitted_part
from rotorid.mismatch.sizes import effect_sizes, scales
from rotorid.mismatch.words import channel_words

ACTS = 1 / 3
"""Contribution to a channel, in units of its noise and relative to the strongest, from which an effect acts there."""
BLOCKS_S = (2.0, 1.0, 0.5, 0.25)
"""Lengths of the blocks that the bootstrap draws, the first that gives LEAST_BLOCKS: residuals are alike for less."""
LEAST_BLOCKS = 6
BOOTSTRAPS = 400
LEAST_SHARE = 0.01
"""Part of the error that goes on the runs held out below which an effect is only suggested: names that fill a gap left
by another cause hold less than 0.7 % of what a model explains. All of ten hidden effects that hold less than 1 % are
clearly better in some channel (ratio 0.16 to 0.77)."""
PLAIN_RATIO = 0.9
"""Error with an effect over that without up to which its gain in a channel is large, however small its share of all."""
WORSE_RATIO = 1.01
"""Error with an effect over that without from which a channel is worse."""
LEAST_EXCITED = 0.1
"""Size of a contribution on the runs held out, relative to that on the fitted ones, below which they are silent."""


@dataclass(frozen=True)
class Ratio:
    """Error of a channel with an effect over that without it on the runs held out, with its 95 % interval."""

    channel: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class HeldOutEvidence:
    """What the runs held out say of one effect."""

    ratios: tuple[Ratio, ...] = ()
    """Of every channel that the effect acts on, the surest gain first; empty where the runs held out are silent."""
    beyond_leftover: bool = True
    """Whether it contributes more than the model leaves over in some channel that it acts on."""

    @property
    def objection(self) -> str:
        """Why the effect is not established; empty where it is."""
        if not self.ratios:
            return "the runs held out say nothing about it"
        if self.contradiction:
            return self.contradiction
        if rules.BELOW_LEFTOVER(not self.beyond_leftover):
            return "it is smaller than what the model leaves over"
        return ""

    @property
    def contradiction(self) -> str:
        """What the runs held out say against it; empty where they confirm it, or say nothing."""
        worse = next((r for r in self.ratios if r.low > WORSE_RATIO), None)
        if rules.WORSE(worse is not None):
            percent = f"{100 * (worse.value - 1):.0f} %"
            return f"on the runs held out the error of the {channel_words(worse.channel)} is {percent} larger with it"
        if rules.NOT_BETTER(bool(self.ratios) and self.ratios[0].high >= 1.0):
            return "on the runs held out no channel is surely better with it"
        return ""

    def undone_by(self, whole: HeldOutEvidence) -> str:
        """Why a gain says nothing: with all that was found a channel is worse than as believed; empty else.

        An effect may gain only by correcting the error of a wrong value.
        """
        worse = {r.channel: r for r in whole.ratios if r.low > WORSE_RATIO}
        own = next((worse[r.channel] for r in self.ratios if r.channel in worse), None)
        if not rules.WORSE(own is not None):
            return ""
        percent = f"{100 * (own.value - 1):.0f} %"
        words = channel_words(own.channel)
        return f"on the runs held out the error of the {words} is {percent} larger with all that was found"


def weighed(analysis: Analysis) -> Analysis:
    """The analysis with gains on the runs held out, and with the words of its effects and values that these allow."""
    part = fitted_part(analysis)
    held = [part(t.run, t.time_s) < 0 for t in analysis.compared]
    shares = effect_shares(analysis, held)
    whole = evidence(analysis, tuple(t.before for t in analysis.compared), held)
    findings = tuple(judged(f, analysis, held, shares.get(f.id, 0.0), whole) for f in analysis.findings)
    against: dict[str, str] = {}
    for names, left in analysis.without_values.items():
        found = evidence(analysis, left, held)
        if why := found.contradiction or found.undone_by(whole):
            against |= {n: why for n in names if n not in against}
    doubtful = {n: (analysis.values[n], why) for n, why in against.items()}
    values = {n: v for n, v in analysis.values.items() if n not in doubtful}
    return replace(analysis, findings=findings, shares=shares, values=values, suggested_values=doubtful)


def with_shares(analysis: Analysis) -> Analysis:
    """The analysis with the size of each effect and what it carries of the error that goes; no word changes.

    Channels are weighed by what a pilot knows: the weight, and the moment that the rotors can make.
    """
    part = fitted_part(analysis)
    held = [part(t.run, t.time_s) < 0 for t in analysis.compared]
    units = {channel: scale.value for channel, scale in scales(analysis).items()}
    return replace(analysis, shares=effect_shares(analysis, held, units), effect_sizes=effect_sizes(analysis, held))


def effect_shares(
    analysis: Analysis, held: list[np.ndarray], units: Mapping[str, float] | None = None
) -> dict[str, float]:
    """To every stated effect the part of what goes from before to after on the runs held out that goes without it.

    Energies over all channels, each in its unit (default its floor): what is left without the effect less what is left
    with all, over what all take away. Effects that only act together add up to more than one.
    """
    units = analysis.noise_floor if units is None else units

    def energy(parts: Sequence[np.ndarray]) -> float:
        sums: dict[str, np.ndarray] = {}
        for trace, own, mask in zip(analysis.compared, parts, held, strict=True):
            new = np.array([np.nansum(own[mask] ** 2), np.isfinite(own[mask]).sum()])
            sums[trace.channel] = sums.get(trace.channel, np.zeros(2)) + new
        return sum(s[0] / max(s[1], 1) / units[c] ** 2 for c, s in sums.items() if units.get(c))

    before, after = (energy([getattr(t, stage) for t in analysis.compared]) for stage in ("before", "after"))
    if before <= after:
        return dict.fromkeys(analysis.without, 0.0)
    return {i: float(np.clip((energy(x) - after) / (before - after), 0.0, 1.0)) for i, x in analysis.without.items()}


def judged(
    finding: Finding, analysis: Analysis, held: list[np.ndarray], share: float, whole: HeldOutEvidence
) -> Finding:
    """A finding with its gain and the word that it deserves; one that no model holds (a mistake) as it is.

    `whole` is the evidence on all that was found together.
    """
    if finding.status not in CLAIMED or finding.id not in analysis.without:
        return finding
    without = analysis.without[finding.id]
    # What lies between command and speed moves every channel that the rotors act on.
    acts_on = finding.channels if finding.form else ()
    found = evidence(analysis, without, held, acts_on)
    if finding.windows and not found.ratios:
        # What acts in a window of one run alone (a gust) belongs to that run and is judged there.
        windows = [in_windows(t, finding.windows) for t in analysis.compared]
        found = evidence(analysis, without, windows, acts_on)
    nothing = rules.MAY_BE_NOTHING(not away_from_nothing(finding))
    reason = found.objection or found.undone_by(whole) or ("every number of it may be nothing" if nothing else "")
    slight = found.ratios and found.ratios[0].value > PLAIN_RATIO
    if rules.SLIGHT(bool(not reason and share < LEAST_SHARE and slight and not finding.windows)):
        reason = f"it carries {100 * share:.1f} % of the error that goes"
    best = found.ratios[0] if found.ratios else None
    finding = replace(finding, gain=None if best is None else (best.value, best.low, best.high))
    return replace(finding, status="suggested", objection=reason) if reason else finding


def in_windows(trace: Trace, windows: tuple[tuple[str, float, float], ...]) -> np.ndarray:
    """Mask of a trace's instants that lie in one of the windows: what belongs to a run is judged there."""
    inside = np.zeros(len(trace.time_s), bool)
    for run, start_s, stop_s in windows:
        if run == trace.run:
            inside |= (trace.time_s >= start_s) & (trace.time_s <= stop_s)
    return inside


def evidence(
    analysis: Analysis, without: tuple[np.ndarray, ...], held: list[np.ndarray], acts_on: Collection[str] = ()
) -> HeldOutEvidence:
    """What rows held out (masks of the traces) say of an effect, given what is left of the traces without it.

    Judged are the channels that the effect `acts_on`, others change by what the rest of the model is fitted to
    without it, and what two sensors say of each other: a wrong mass makes up for an accelerometer's scale in the force,
    never there. Where none of its channels is compared, those that differ most.
    """
    size: dict[str, list[float]] = {}
    for trace, left, mask in zip(analysis.compared, without, held, strict=True):
        added = (left - trace.after) ** 2
        own = size.setdefault(trace.channel, [0.0, 0.0, 0.0, 0.0])
        own[0], own[1] = own[0] + float(np.nansum(added[mask])), own[1] + int(mask.sum())
        own[2], own[3] = own[2] + float(np.nansum(added[~mask])), own[3] + int((~mask).sum())
    noise = {c: max(analysis.noise_floor.get(c) or 0.0, 1e-12) for c in size}
    here = {c: np.sqrt(s[0] / max(s[1], 1)) / noise[c] for c, s in size.items()}
    there = {c: np.sqrt(s[2] / max(s[3], 1)) / noise[c] for c, s in size.items()}
    strongest = max(here.values(), default=0.0)
    if strongest <= LEAST_EXCITED * max(there.values(), default=0.0):
        return HeldOutEvidence()
    sensors = {t.channel for t in analysis.between_sensors}
    differing = [c for c in here if here[c] > ACTS * strongest]
    acting = [c for c in here if c in acts_on or (c in sensors and c in differing)] or differing
    ratios = [r for r in (ratio_of(analysis, without, held, c) for c in acting) if r is not None]
    beyond = any(here[c] * noise[c] > leftover_rms(analysis, held, c) for c in acting)
    return HeldOutEvidence(tuple(sorted(ratios, key=lambda r: r.high)), beyond)


def leftover_rms(analysis: Analysis, held: list[np.ndarray], channel: str) -> float:
    """What the model leaves of a channel beyond its noise on masked rows, root mean square in the channel's unit."""
    pairs = [(t, m) for t, m in zip(analysis.compared, held, strict=True) if t.channel == channel and m.any()]
    if not pairs:
        return 0.0
    left = np.concatenate([t.after[m] for t, m in pairs])
    return float(np.sqrt(max(0.0, np.nanmean(left**2) - (analysis.noise_floor.get(channel) or 0.0) ** 2)))


def ratio_of(analysis: Analysis, without: tuple[np.ndarray, ...], held: list[np.ndarray], channel: str) -> Ratio | None:
    """Error of a channel with an effect over that without it, in the blocks in which it acts; None where these are few.

    Blocks are drawn anew for the interval. What acts for a short time is judged in shorter blocks.
    """
    parts = zip(analysis.compared, without, held, strict=True)
    own = [(t, left - t.after, m) for t, left, m in parts if t.channel == channel]
    for block_s in BLOCKS_S:
        energies = np.array([e for t, added, m in own for e in block_energies(t, added, m, block_s)]).reshape(-1, 3)
        acting = energies[energies[:, 2] > VOTES_FROM * energies[:, 2].max(initial=0.0)]
        if len(acting) >= LEAST_BLOCKS:
            break
    else:
        return None
    draws = acting[np.random.default_rng(1).integers(0, len(acting), (BOOTSTRAPS, len(acting)))].sum(axis=1)
    low, high = np.quantile(np.sqrt(draws[:, 0] / np.maximum(draws[:, 1], 1e-300)), [0.025, 0.975])
    value = np.sqrt(acting[:, 0].sum() / max(acting[:, 1].sum(), 1e-300))
    return Ratio(channel, float(value), float(low), float(high))


def block_energies(trace: Trace, added: np.ndarray, mask: np.ndarray, block_s: float):
    """Energies of blocks of masked rows: with the effect, without it (its contribution `added` (n,) put back), and of
    the contribution alone."""
    index = np.flatnonzero(mask & np.isfinite(trace.after) & np.isfinite(added))
    if not len(index):
        return
    period_s = float(np.median(np.diff(trace.time_s))) if len(trace.time_s) > 1 else block_s
    for rows in np.array_split(index, max(1, len(index) // max(1, int(round(block_s / period_s))))):
        after, own = trace.after[rows], added[rows]
        yield float(after @ after), float((after + own) @ (after + own)), float(own @ own)


def away_from_nothing(finding: Finding) -> bool:
    """Whether the interval of some number of a finding does not hold the value at which it does nothing."""
    if not finding.parameters:
        return True
    return any(not p.low <= 0.0 <= p.high for p in finding.parameters)
