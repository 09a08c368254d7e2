"""Whether what an effect explains is enough to state it, and what the held-out runs say of it.

A selected effect stays established if what it contributes to the fitted runs is more than what the model leaves over,
if it takes a share of the error or gains much in some channel, and if its main parameter is away from nothing. Else it
is too small to matter: not established, or suggested where it is not known to be at work. The held-out runs change no
status: from them come the gain that is reported and the shares.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Finding
from rotorid.mismatch.decide.sizes import effect_sizes, fitted_part, scales
from rotorid.mismatch.decide.statements import SURE
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.evidence.comparison import VOTES_FROM

NOTHING = "every number of it may be nothing"


_Ratio = tuple[float, float, float]
"""Error of a channel with an effect over that without it, and its 95 % interval: value, low, high."""


def weighed(analysis: Analysis) -> Analysis:
    """The analysis with the statuses of its effects that the fitted runs allow, and with the gains on the held-out
    ones."""
    part = fitted_part(analysis)
    fitted, held = ([sign * part(t.run, t.time_s) > 0 for t in analysis.compared] for sign in (1, -1))
    shares = _effect_shares(analysis, fitted)
    return replace(
        analysis, findings=tuple(judged(f, analysis, fitted, held, shares.get(f.id, 0.0)) for f in analysis.findings)
    )


def with_shares(analysis: Analysis) -> Analysis:
    """The analysis with the size of each effect and what it carries of the error that goes; no word changes.

    Channels are weighed by what a pilot knows: the weight, and the moment that the rotors can make.
    """
    part = fitted_part(analysis)
    held = [part(t.run, t.time_s) < 0 for t in analysis.compared]
    units = {channel: scale.value for channel, scale in scales(analysis).items()}
    return replace(analysis, shares=_effect_shares(analysis, held, units), effect_sizes=effect_sizes(analysis, held))


def _effect_shares(
    analysis: Analysis, rows: list[np.ndarray], units: Mapping[str, float] | None = None
) -> dict[str, float]:
    """To every stated effect the part of what goes from before to after on some rows that goes without it.

    Energies over all channels, each in its unit (default its floor): what is left without the effect less what is left
    with all, over what all take away. Effects that only act together add up to more than one.
    """
    units = analysis.noise_floor if units is None else units

    def energy(parts: Sequence[np.ndarray]) -> float:
        sums: dict[str, np.ndarray] = {}
        for trace, own, mask in zip(analysis.compared, parts, rows, strict=True):
            new = np.array([np.nansum(own[mask] ** 2), np.isfinite(own[mask]).sum()])
            sums[trace.channel] = sums.get(trace.channel, np.zeros(2)) + new
        return sum(s[0] / max(s[1], 1) / units[c] ** 2 for c, s in sums.items() if units.get(c))

    before, after = (energy([getattr(t, stage) for t in analysis.compared]) for stage in ("before", "named"))
    if before <= after:
        return dict.fromkeys(analysis.without, 0.0)
    return {i: float(np.clip((energy(x) - after) / (before - after), 0.0, 1.0)) for i, x in analysis.without.items()}


def judged(
    finding: Finding, analysis: Analysis, fitted: list[np.ndarray], held: list[np.ndarray], share: float
) -> Finding:
    """A finding with its gain on the held-out runs and the status that the fitted ones allow, a mistake as it is.

    `share` is its part of the explained error. What the lift says of the path from command to thrust has the doubt of
    the loop in its interval: how much else of the forces has no name makes it no less sure.
    """
    if finding.status not in CLAIMED or finding.id not in analysis.without or finding.late_s is not None:
        return finding
    without = analysis.without[finding.id]
    # What lies between command and speed moves every channel that the rotors act on.
    acts_on = finding.channels if finding.form else ()
    found, beyond = contribution(analysis, without, fitted, acts_on)
    reported, _ = contribution(analysis, without, held, acts_on)
    if finding.windows and not reported:
        # What acts in a window of one run alone (a gust) belongs to that run and is reported there.
        windows = [_in_windows(t, finding.windows) for t in analysis.compared]
        reported, _ = contribution(analysis, without, windows, acts_on)
    # Error with an effect over that without up to which its gain in a channel is large, however small its share of all.
    large_gain = 0.9
    slight = found and next(iter(found.values()))[0] > large_gain
    next_to_no_gain = 0.998  # Error with an effect over that without from which its gain is none, however significant.
    idle = found and min(ratio for ratio, *_ in found.values()) > next_to_no_gain
    reason = ""
    # Part of the explained error below which an effect is only suggested: names that fit unmodelled residual hold less
    # than 0.7 % of what a model explains.
    least_share = 0.01
    if rules.BELOW_LEFTOVER(not beyond and not (analysis.command_path and finding.speed_form)):
        coarse = " or half a step of the reading" if _half_steps(analysis) else ""
        reason = f"it is smaller than what the model leaves over{coarse}"
    elif may_be_nothing(finding):
        reason = NOTHING
    elif _at_the_end_of_a_cable(finding):
        reason = "its cable or its damping is at the end of what is looked for"
    elif rules.SLIGHT(bool(share < least_share and slight and not finding.windows)):
        reason = f"it takes {100 * share:.1f} % of the error that goes"
    elif rules.SLIGHT(bool(idle and not finding.windows)):
        reason = "it betters no channel by a five-hundredth"
    finding = replace(finding, gain=next(iter(reported.values()), None))
    return lowered(finding, reason) if reason else finding


def may_be_nothing(finding: Finding) -> bool:
    """Whether the interval of every size of an effect holds zero: a length or a time says how it acts, not whether."""
    linear = {finding.form.parameters[i].symbol for i in finding.form.linear} if finding.form else set()
    sizes = [p for p in finding.parameters if p.symbol in linear] or finding.parameters
    return rules.MAY_BE_NOTHING(bool(sizes) and all(p.low <= 0.0 <= p.high for p in sizes))


def _at_the_end_of_a_cable(finding: Finding) -> bool:
    """Whether what swings is best on a cable at a limit of its length or damping: it is no cable then.

    No damping at all is that of a thin cable in air.
    """
    if finding.form is None or not finding.form.swings:
        return False
    free = [(finding.form.parameters[i], finding.values[i]) for i in finding.form.nonlinear]
    ends = [(v, p.high - p.low, end) for p, v in free for end in ((p.low, p.high) if p.unit == "m" else (p.high,))]
    near_an_end = 0.01  # Share of a range from its end at which a length or a damping is held there.
    return any(abs(v - end) < near_an_end * span for v, span, end in ends)


def lowered(finding: Finding, reason: str) -> Finding:
    """A claim that does not stand: suggested, or not established where it is at work and too small to matter."""
    if finding.probability is None or finding.probability < SURE:
        return replace(finding, status="suggested", objection=reason)
    sentence = f"{catalogue()[finding.id].name} is not established: {reason}"
    return replace(finding, status="not_established", sentence=sentence, rule="too_small", alternatives=())


def _in_windows(trace: ChannelTrace, windows: tuple[tuple[str, float, float], ...]) -> np.ndarray:
    """Mask of a trace's instants that lie in one of the windows: what belongs to a run is judged there."""
    inside = np.zeros(len(trace.time_s), bool)
    for run, start_s, stop_s in windows:
        if run == trace.run:
            inside |= (trace.time_s >= start_s) & (trace.time_s <= stop_s)
    return inside


def contribution(
    analysis: Analysis, without: tuple[np.ndarray, ...], rows: list[np.ndarray], acts_on: Collection[str] = ()
) -> tuple[dict[str, _Ratio], bool]:
    """What some rows (masks of the traces) say of an effect, given what is left of the traces without it.

    First the gain in every channel that the effect acts on by the channel's name, the most significant first, none
    where the rows do not excite it; then whether it contributes more than the model leaves over in some such channel,
    and more than half a step where the reading is coarse: what is less may be rounding.

    Judged are the channels that the effect `acts_on`, others change by what the rest of the model is fitted to
    without it, and what two sensors say of each other: a wrong mass makes up for an accelerometer's scale in the force,
    never there. Where none of its channels is compared, those that differ most.
    """
    size: dict[str, list[float]] = {}
    for trace, left, mask in zip(analysis.compared, without, rows, strict=True):
        added = (left - trace.named) ** 2
        own = size.setdefault(trace.channel, [0.0, 0.0, 0.0, 0.0])
        own[0], own[1] = own[0] + float(np.nansum(added[mask])), own[1] + int(mask.sum())
        own[2], own[3] = own[2] + float(np.nansum(added[~mask])), own[3] + int((~mask).sum())
    noise = {c: max(analysis.noise_floor.get(c) or 0.0, 1e-12) for c in size}
    here = {c: np.sqrt(s[0] / max(s[1], 1)) / noise[c] for c, s in size.items()}
    there = {c: np.sqrt(s[2] / max(s[3], 1)) / noise[c] for c, s in size.items()}
    strongest = max(here.values(), default=0.0)
    # Size of a contribution on the held-out runs, relative to that on the fitted ones, below which they do not excite
    # it.
    least_excited = 0.1
    if strongest <= least_excited * max(there.values(), default=0.0):
        return {}, True
    sensors = {t.channel for t in analysis.between_sensors}
    # Contribution to a channel, in units of its noise and relative to the strongest, from which an effect acts there.
    acts = 1 / 3
    differing = [c for c in here if here[c] > acts * strongest]
    acting = [c for c in here if c in acts_on or (c in sensors and c in differing)] or differing
    ratios = {c: r for c in acting if (r := ratio_of(analysis, without, rows, c)) is not None}
    rounding = _half_steps(analysis)
    beyond = any(here[c] * noise[c] > max(_leftover_rms(analysis, rows, c), rounding.get(c, 0.0)) for c in acting)
    return dict(sorted(ratios.items(), key=lambda pair: pair[1][2])), beyond


def _half_steps(analysis: Analysis) -> dict[str, float]:
    """Half a step of every channel whose steps are larger than its noise, in the channel's unit."""
    claims = [f for f in analysis.findings if f.status in CLAIMED]
    return {c: 0.5 * p.value for f in claims for c in f.channels for p in f.parameters if p.symbol == f"q_{c}"}


def _leftover_rms(analysis: Analysis, rows: list[np.ndarray], channel: str) -> float:
    """What the model leaves of a channel beyond its noise on masked rows, root mean square in the channel's unit."""
    pairs = [(t, m) for t, m in zip(analysis.compared, rows, strict=True) if t.channel == channel and m.any()]
    if not pairs:
        return 0.0
    left = np.concatenate([t.named[m] for t, m in pairs])
    return float(np.sqrt(max(0.0, np.nanmean(left**2) - (analysis.noise_floor.get(channel) or 0.0) ** 2)))


def ratio_of(
    analysis: Analysis, without: tuple[np.ndarray, ...], rows: list[np.ndarray], channel: str
) -> _Ratio | None:
    """Error of a channel with an effect over that without it, in the blocks in which it acts; None where these are few.

    Blocks are drawn anew for the interval. What acts for a short time is judged in shorter blocks.
    """
    parts = zip(analysis.compared, without, rows, strict=True)
    own = [(t, left - t.named, m) for t, left, m in parts if t.channel == channel]
    # Lengths of the blocks that the bootstrap draws, the first that gives enough of them: residuals are alike for less.
    blocks_s = (2.0, 1.0, 0.5, 0.25)
    least_blocks = 6
    for block_s in blocks_s:
        energies = np.array([e for t, added, m in own for e in _block_energies(t, added, m, block_s)]).reshape(-1, 3)
        acting = energies[energies[:, 2] > VOTES_FROM * energies[:, 2].max(initial=0.0)]
        if len(acting) >= least_blocks:
            break
    else:
        return None
    bootstraps = 400
    draws = acting[np.random.default_rng(1).integers(0, len(acting), (bootstraps, len(acting)))].sum(axis=1)
    low, high = np.quantile(np.sqrt(draws[:, 0] / np.maximum(draws[:, 1], 1e-300)), [0.025, 0.975])
    value = np.sqrt(acting[:, 0].sum() / max(acting[:, 1].sum(), 1e-300))
    return float(value), float(low), float(high)


def _block_energies(trace: ChannelTrace, added: np.ndarray, mask: np.ndarray, block_s: float):
    """Energies of blocks of masked rows: with the effect, without it (its contribution `added` (n,) put back), and of
    the contribution alone."""
    index = np.flatnonzero(mask & np.isfinite(trace.named) & np.isfinite(added))
    if not len(index):
        return
    period_s = float(np.median(np.diff(trace.time_s))) if len(trace.time_s) > 1 else block_s
    for rows in np.array_split(index, max(1, len(index) // max(1, int(round(block_s / period_s))))):
        after, own = trace.named[rows], added[rows]
        yield float(after @ after), float((after + own) @ (after + own)), float(own @ own)
