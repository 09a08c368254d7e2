"""What the runs held out say of every stated effect, and the word that this leaves it.

An effect is established if on the runs held out at least one channel is better with it (the whole interval of the ratio
below 1), none that it acts on is worse, its main parameter is away from nothing, and what it contributes is more than
what the model leaves over. Else it is suggested, with its numbers and the reason. The model stays as it was chosen: the
runs held out lower a word, nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch.findings import Analysis, Finding, Trace
from rotorid.mismatch.shares import fitted_part
from rotorid.mismatch.words import channel_words

CLAIMED = ("established", "ambiguous")
ACTS = 1 / 3
"""Contribution to a channel, in units of its noise and beside the strongest, from which an effect acts there."""
BLOCK_S = 2.0
"""Length of the blocks that the bootstrap draws: longer than residuals are alike."""
LEAST_BLOCKS = 6
"""Blocks that the bootstrap needs; less than BLOCK_S each where little is held out."""
BOOTSTRAPS = 400
LEAST_EXCITED = 0.1
"""Size of a contribution on the runs held out, beside that on the fitted ones, below which they are silent."""


@dataclass(frozen=True)
class Ratio:
    """Error of a channel with an effect over that without it on the runs held out, with its 95 % interval."""

    channel: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Evidence:
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
        worse = next((r for r in self.ratios if r.low > 1.0), None)
        if worse is not None:
            return (
                f"on the runs held out the error of the {channel_words(worse.channel)} is {worse.value:.2f} times what "
                "it is without"
            )
        if self.ratios[0].high >= 1.0:
            return "on the runs held out no channel is surely better with it"
        if not self.beyond_leftover:
            return "it is smaller than what the model leaves over"
        return ""


def weighed(analysis: Analysis) -> Analysis:
    """The analysis with gains on the runs held out, and with the words of its effects that these allow."""
    part = fitted_part(analysis)
    held = [part(t.run, t.time_s) < 0 for t in analysis.traces]
    return replace(analysis, findings=tuple(judged(f, analysis, held) for f in analysis.findings))


def judged(finding: Finding, analysis: Analysis, held: list[np.ndarray]) -> Finding:
    """A finding with its gain and the word that it deserves; one that no model holds (a mistake) as it is."""
    if finding.status not in CLAIMED or finding.id not in analysis.without:
        return finding
    without = analysis.without[finding.id]
    found = evidence(analysis, without, held)
    if finding.windows and not found.ratios:
        # What acts in a window of one run alone (a gust) belongs to that run and is judged there.
        found = evidence(analysis, without, [in_windows(t, finding.windows) for t in analysis.traces])
    reason = found.objection or ("" if away_from_nothing(finding) else "every number of it may be nothing")
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


def evidence(analysis: Analysis, without: tuple[np.ndarray, ...], held: list[np.ndarray]) -> Evidence:
    """What rows held out (masks of the traces) say of an effect, given what is left of the traces without it."""
    size: dict[str, list[float]] = {}
    for trace, left, mask in zip(analysis.traces, without, held, strict=True):
        added = (left - trace.after) ** 2
        own = size.setdefault(trace.channel, [0.0, 0.0, 0.0, 0.0])
        own[0], own[1] = own[0] + float(np.nansum(added[mask])), own[1] + int(mask.sum())
        own[2], own[3] = own[2] + float(np.nansum(added[~mask])), own[3] + int((~mask).sum())
    noise = {c: max(analysis.noise_floor.get(c) or 0.0, 1e-12) for c in size}
    here = {c: np.sqrt(s[0] / max(s[1], 1)) / noise[c] for c, s in size.items()}
    there = {c: np.sqrt(s[2] / max(s[3], 1)) / noise[c] for c, s in size.items()}
    strongest = max(here.values(), default=0.0)
    if strongest <= LEAST_EXCITED * max(there.values(), default=0.0):
        return Evidence()
    acting = [c for c in here if here[c] > ACTS * strongest]
    ratios = [r for r in (ratio_of(analysis, without, held, c) for c in acting) if r is not None]
    beyond = any(here[c] * noise[c] > leftover_rms(analysis, held, c) for c in acting)
    return Evidence(tuple(sorted(ratios, key=lambda r: r.high)), beyond)


def leftover_rms(analysis: Analysis, held: list[np.ndarray], channel: str) -> float:
    """What the model leaves of a channel beyond its noise on masked rows, root mean square in the channel's unit."""
    pairs = [(t, m) for t, m in zip(analysis.traces, held, strict=True) if t.channel == channel and m.any()]
    if not pairs:
        return 0.0
    left = np.concatenate([t.after[m] for t, m in pairs])
    return float(np.sqrt(max(0.0, np.nanmean(left**2) - (analysis.noise_floor.get(channel) or 0.0) ** 2)))


def ratio_of(analysis: Analysis, without: tuple[np.ndarray, ...], held: list[np.ndarray], channel: str) -> Ratio | None:
    """Error of a channel with an effect over that without, block bootstrap; None with fewer than LEAST_BLOCKS."""
    energies = []
    own = [(t, x, m) for t, x, m in zip(analysis.traces, without, held, strict=True) if t.channel == channel]
    period_s = min((float(np.median(np.diff(t.time_s))) for t, _, _ in own if len(t.time_s) > 1), default=BLOCK_S)
    block_s = min(BLOCK_S, period_s * sum(int(m.sum()) for _, _, m in own) / (2 * LEAST_BLOCKS))
    for trace, left, mask in own:
        index = np.flatnonzero(mask & np.isfinite(trace.after) & np.isfinite(left))
        if len(index):
            per = max(1, int(block_s / period_s))
            for rows in np.array_split(index, max(1, len(index) // per)):
                energies.append((float(trace.after[rows] @ trace.after[rows]), float(left[rows] @ left[rows])))
    if len(energies) < LEAST_BLOCKS:
        return None
    e = np.array(energies)
    draws = e[np.random.default_rng(1).integers(0, len(e), (BOOTSTRAPS, len(e)))].sum(axis=1)
    low, high = np.quantile(np.sqrt(draws[:, 0] / np.maximum(draws[:, 1], 1e-300)), [0.025, 0.975])
    return Ratio(channel, float(np.sqrt(e[:, 0].sum() / max(e[:, 1].sum(), 1e-300))), float(low), float(high))


def away_from_nothing(finding: Finding) -> bool:
    """Whether the interval of some number of a finding does not hold the value at which it does nothing."""
    if not finding.parameters:
        return True
    return any(not p.low <= 0.0 <= p.high for p in finding.parameters)
