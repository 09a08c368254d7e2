"""What the analysis of a recording set found, before it is put into words, figures and files, and how probable it is.

Probabilities are those of the posterior at the model that was chosen and at its neighbours: without each effect, and
with each other effect in its place (`statements`). What the regression does not decide (chain, wind, mistakes) has
none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, SpeedForm
from rotorid.effects.describe import advice
from rotorid.effects.loading import InstrumentFacts, Loading
from rotorid.mismatch.decide.posterior import Found
from rotorid.mismatch.decide.statements import LIKELY, SURE, Statement, share_of, statements_of, weights_of
from rotorid.mismatch.decide.status import CLAIMED, Estimate, Status
from rotorid.mismatch.decide.support import Support
from rotorid.mismatch.evidence.rows import CHANNELS, Rows
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.recordings import RecordingSet, Split, Vehicle
from rotorid.recordings.run import Doubt

if TYPE_CHECKING:
    from rotorid.mismatch.decide.sizes import Size
    from rotorid.mismatch.decide.statements import UpperLimit


class Reason(str):
    """Why an effect is not stated, in words, and the rule that says so."""

    rule: str

    def __new__(cls, rule: str, text: str) -> Reason:
        """The words of a rule."""
        made = super().__new__(cls, text)
        made.rule = rule
        return made


@dataclass(frozen=True)
class Finding:
    """One id of the catalogue (physics, sensor, mistake) and what the data say of it."""

    id: str
    status: Status
    form: Form | None = None
    """The form that fits best (None for mistakes and effects that are no wrench, such as `sensor_dropout`)."""
    speed_form: SpeedForm | None = None
    """The form of one that lies between command and rotor speed."""
    values: tuple[float, ...] = ()
    """Parameter values of `form` or `speed_form`, in its order."""
    equation: str = ""
    sentence: str = ""
    parameters: tuple[Estimate, ...] = ()
    p_value: float = 1.0
    channels: tuple[str, ...] = ()
    """Channels it shows in, the strongest first (`force_x` … `moment_z`, `rotor_speed_i`)."""
    alternatives: tuple[str, ...] = ()
    """For `ambiguous`: the whole class, itself included."""
    gain: tuple[float, float, float] | None = None
    """Held-out rmse ratio (with / without the effect) and its 95 % interval, block bootstrap."""
    rule: str = ""
    """Of one that is not established: the rule that took it out."""
    objection: str = ""
    """Of a `suggested` one: why it is not established."""
    windows: tuple[tuple[str, float, float], ...] = ()
    """(run, start_s, stop_s) where it acts, for effects in part of the flight; empty for always."""
    late_s: float | None = None
    """Of stamps that are late (positive) or early: by how much; `parameters` have the length alone."""
    probability: float | None = None
    """That it, or one of its class, is at work; None where none was computed."""
    withheld: str = ""
    """Of one that is claimed: why it is in none of the files; empty where it is delivered."""

    @property
    def which(self) -> tuple[str, tuple[str, ...]]:
        """What distinguishes it from another mistake of a set: its id, of a clock also the columns stamped by it."""
        return self.id, () if self.late_s is None else self.channels

    @property
    def delivered(self) -> bool:
        """Whether it may stand in one of the files."""
        return self.status in CLAIMED and not self.withheld

    def or_else(self, others: Iterable[str]) -> Finding:
        """It, or one of some other ids, in a class with those of which the data could not distinguish it before."""
        return replace(self, status="ambiguous", alternatives=tuple(sorted({self.id, *others, *self.alternatives})))


def not_held(effect_id: str, reason: str, **known) -> Finding:
    """The finding that an id was tested and did not hold."""
    sentence = f"{catalogue()[effect_id].name} did not hold: {reason}"
    return Finding(effect_id, "not_established", sentence=sentence, **known)


def in_interval(symbol: str, value: float, unit: str, sd: float) -> Estimate:
    """A number with one sigma as it is stated, with its 95 % interval."""
    return Estimate(symbol, float(value), unit, float(value - 1.96 * sd), float(value + 1.96 * sd))


@dataclass(frozen=True)
class RunWind:
    """Wind of a run: straight lines between instants, still air outside of them."""

    run: str
    kind: Literal["all the time", "in windows"]
    time_s: np.ndarray
    """(k,)."""
    wind_m_s: np.ndarray
    """North and east, (k, 2)."""


@dataclass(frozen=True)
class ValueRow:
    """A believed value before and after, all values free within their trust jointly with the delivered effects."""

    name: str
    """By its contract name."""
    believed: float
    estimate: float
    low: float
    high: float
    """95 % interval of the estimate, its trust a part of it; NaN where a bound holds the value: it has none then."""
    delivered: float
    """What stands in the improved vehicle."""


@dataclass(frozen=True)
class ChannelTrace:
    """Residual of one channel of one run, thinned."""

    run: str
    channel: str
    unit: str
    time_s: np.ndarray
    before: np.ndarray
    refitted: np.ndarray
    """Of values alone: without a form of the path from command to thrust, too."""
    named: np.ndarray
    """With the effects, one member of each class."""
    after: np.ndarray
    """Of the vehicle that is delivered, derivatives included."""
    on_path: np.ndarray | None = None
    """Of values behind the path from command to thrust, where commands alone are recorded; None where speeds are."""

    def of_model(self, model: str) -> np.ndarray:
        """What a candidate (`Delivery.model`) leaves without derivatives, (n,)."""
        refitted = self.refitted if self.on_path is None else self.on_path
        return {"believed": self.before, "refitted": refitted, "named": self.named}[model]


@dataclass(frozen=True)
class Delivery:
    """Which candidate is taken home, and every candidate's number."""

    model: Literal["believed", "refitted", "named"]
    derivatives: bool
    scores: tuple[tuple[str, bool, float, float, str], ...]
    """Model, whether with derivatives, mean logarithm of the error over the believed vehicle's where not fitted, the
    standard error of its difference from the best, and why it was not fit to be flown (or nothing)."""


def by_channel(traces: Iterable[ChannelTrace]) -> dict[str, list[ChannelTrace]]:
    """Traces of each channel, in their order."""
    out: dict[str, list[ChannelTrace]] = {}
    for trace in traces:
        out.setdefault(trace.channel, []).append(trace)
    return out


def rms(parts: Iterable[np.ndarray]) -> float:
    """Root mean square over stretches, missing samples left out; NaN where nothing is there."""
    values = np.concatenate([np.zeros(0), *map(np.ravel, parts)])
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan


@dataclass(frozen=True)
class Analysis:
    """Everything that the verdict, its page and the improved vehicle are made from."""

    recordings: RecordingSet
    """The set as analysed (mistakes with overwhelming evidence already corrected)."""
    split: Split
    believed: Vehicle
    refitted: Vehicle
    """Believed values re-estimated without new physics."""
    improved: Vehicle
    """The vehicle that is taken home, without the effects (which `findings` hold)."""
    named: Vehicle
    """Values re-estimated together with the established effects."""
    findings: tuple[Finding, ...]
    values: dict[str, tuple[float, float, float, float]]
    """Wrong values: contract name to (believed, refitted, low, high)."""
    not_testable: dict[str, str]
    traces: tuple[ChannelTrace, ...]
    noise_floor: dict[str, float]
    """Measured noise of each channel, its own unit, in the band of the traces."""
    p_values: dict[str, tuple[float, float]]
    """Channel to p-value that the residual does not depend on the inputs, before and after."""
    regimes: dict[str, dict[str, np.ndarray]]
    """Run to regime variable (`airspeed_m_s`, …, and `time_s`) on the traces' instants."""
    absent: tuple[UpperLimit, ...] = ()
    """Ids that were tested and not found, and how large they may be."""
    winds: tuple[RunWind, ...] = ()
    """Winds that the model flies in, by run."""
    between_sensors: tuple[ChannelTrace, ...] = ()
    """Two sensors of one quantity compared (`accelerometer_x` … `gyroscope_z`): effects are judged by them, too."""
    without: Mapping[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    """To the id of a stated effect what is left of every trace of `compared` without it, all else fitted anew."""
    suggested_values: Mapping[str, tuple[tuple[float, float, float, float], str]] = field(default_factory=dict)
    """Values that an open class would change: as in `values`, and why."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """To the id of a stated effect the part of the error that goes on the runs held out which goes without it."""
    effect_sizes: Mapping[str, Size] = field(default_factory=dict)
    """To the id of a stated effect what it does where it does most, on the runs held out."""
    unexplained_channels: tuple[str, ...] = ()
    unexplained_depends_on: tuple[str, ...] = ()
    unexplained_description: str = ""
    next_manoeuvre: str = ""
    next_separates: tuple[str, ...] = ()
    force_source: str = "accelerometer"
    samples_per_row: int = 1
    """How many samples a row of a stand's or bench's traces is the mean of."""
    instrument: InstrumentFacts | None = None
    """Kinds `stand` and `bench`: what is known of the instrument."""
    loadings: tuple[Loading, ...] = ()
    """Kinds `stand` and `bench`: loads and readings as analysed, rotor speeds as the improved model has them."""
    command_path: tuple[Estimate, ...] = ()
    """Where commands alone are recorded: what is known of the path from command to thrust about the hover command."""
    notes: tuple[str, ...] = field(default_factory=tuple)
    """Things a reader must know (what was derived, what was corrected)."""
    instead: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Wrong value to others, in words, that would explain as much in its place: `yaw inertia −9.8 ± 0.4 %`."""
    fired: Mapping[str, int] = field(default_factory=dict)
    """How often each rule's condition held during the analysis (`rules`)."""
    corrected: tuple[str, ...] = ()
    """Values corrected within their trust, in words: `thrust coefficient −0.7 %`."""
    doubts: tuple[Doubt, ...] = ()
    """What `check` doubts in the set, and values that are only proposed."""
    delivery: Delivery = Delivery("believed", False, ())
    """Which vehicle is taken home; before it is chosen the believed one."""
    believed_values: tuple[ValueRow, ...] = ()
    """Every believed value before and after, as an identification report has them."""
    value_correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """Correlation of the estimates of two values of which little more than a ratio is known."""

    @property
    def compared(self) -> tuple[ChannelTrace, ...]:
        """Everything that effects are judged by: the traces that are shown, and those between sensors."""
        return (*self.traces, *self.between_sensors)

    @property
    def wrong_values(self) -> dict[str, tuple[float, float, float, float]]:
        """Those of `values` that were believed to be something else; a scale that nobody stated is no mismatch."""
        return {name: v for name, v in self.values.items() if math.isfinite(v[0])}


def with_status(analysis: Analysis, *statuses: str) -> list[Finding]:
    """Findings of these statuses, the surest first."""
    return sorted((f for f in analysis.findings if f.status in statuses), key=lambda f: f.p_value)


def one_per_class(findings: Sequence[Finding]) -> list[Finding]:
    """The surest of each class of alternatives."""
    kept, seen = [], set()
    for finding in findings:
        members = frozenset(finding.alternatives) | {finding.id}
        if not members & seen:
            kept.append(finding)
        seen |= members
    return kept


def with_probabilities(
    findings: Iterable[Finding], found: Found, support: Callable[[], Support] | None = None
) -> list[Finding]:
    """The findings with the posterior probability of each, of a class that one of it is at work.

    A claim below 0.99 becomes the smallest class of which one is at work with 0.99; without such a class it is
    `suggested`, below 0.5 `not_established`. `found` is the posterior at the model that the findings are of; a claim
    that has too little `support` becomes the smallest class that has enough, or is `suggested`.
    """
    stated = {s.id: s for s in statements_of(found)}  # first: it visits every rival
    weights = weights_of(found)
    drawn = None if support is None else support()
    decided = {found.problem.terms[key].effect for key in found.model if key in found.problem.effects}

    def weighed(one: Finding) -> Finding:
        if not decided & _members(one):
            return one
        probability = min(1.0, share_of(found, weights, _members(one)))
        one = _with_probability(one, probability, stated.get(one.id))
        return one if drawn is None else _supported(one, drawn, decided)

    out = [weighed(one) for one in findings]
    rivals = set().union(*(one.alternatives for one in out if one.status in CLAIMED))
    return [one for one in out if one.status != "not_established" or one.id not in rivals]


def _supported(claim: Finding, support: Support, decided: Collection[str]) -> Finding:
    """A claim as far as draws of the recording's seconds support it: itself, a class, or only suggested.

    What is at work next to it (`decided`) does not stand in its place.
    """
    members = _members(claim)
    if not members:
        return claim
    found = support.class_of(members, frozenset(decided) - members | UNKNOWNS.keys())
    if found is None:
        share = f"where the recording's seconds are weighed anew it is at work in {100 * support.of(members):.0f} %"
        return replace(claim, status="suggested", alternatives=(), objection=share)
    return claim if found == members else claim.or_else(found)


def _members(finding: Finding) -> set[str]:
    """The ids of a claim: its own, and its class."""
    return {finding.id, *finding.alternatives} if finding.status in CLAIMED else set()


def _with_probability(claim: Finding, probability: float, stated: Statement | None) -> Finding:
    """A claim with its probability, and with the status that this leaves it; `stated` is the posterior's own word."""
    if probability >= SURE:
        return replace(claim, probability=probability)
    if stated is not None and stated.status == "ambiguous":
        return replace(claim, probability=stated.probability, status="ambiguous", alternatives=stated.alternatives)
    reason = f"its probability is {100 * probability:.0f} %"
    if probability >= LIKELY:
        return replace(claim, probability=probability, status="suggested", objection=reason)
    return not_held(claim.id, reason, rule="probability", probability=probability)


@dataclass(frozen=True)
class NextFlight:
    """What to do, and the ids that it separates; empty where nothing is open."""

    manoeuvre: str = ""
    separates: tuple[str, ...] = ()


def next_flight(findings: Sequence[Finding], recordings: RecordingSet) -> NextFlight:
    """For the first class that the data leave open."""
    for finding in findings:
        if finding.status == "ambiguous":
            ids = tuple(finding.alternatives)
            return NextFlight(advice(catalogue()[finding.id], recordings), ids)
    return NextFlight()


def on_traces(
    traces: Sequence[ChannelTrace], rows: Sequence[Rows], left: Sequence[np.ndarray]
) -> tuple[np.ndarray, ...]:
    """Residuals (n, channels) of every stretch on the traces; what is delivered where a trace is of none of them."""
    known = {}
    for r, part in zip(rows, left, strict=True):
        known |= {(r.run, first_s(r.time_s), CHANNELS[k]): values for k, values in enumerate(part.T)}
    return tuple(known.get((t.run, first_s(t.time_s), t.channel), t.named) for t in traces)


def first_s(time_s: np.ndarray) -> float:
    """First instant of a stretch; of one without rows infinity."""
    return float(time_s[0]) if len(time_s) else np.inf
