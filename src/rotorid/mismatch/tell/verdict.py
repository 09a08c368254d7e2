"""The verdict on a recording set: a typed model of `verdict.json`, and how it follows from an analysis.

The JSON schema in `workflow/schemas/verdict.schema.json` is generated from this model
(`python -m rotorid.mismatch.tell.verdict --write-schema`). A number that is not known is written as null. What stands
in the way of believing a verdict are the doubts of `check`, less those that the analysis corrected.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from rotorid.io.text.writing import rounded
from rotorid.mismatch.decide.findings import Analysis, Finding, by_channel, rms
from rotorid.mismatch.decide.sizes import Size, fitted_part, scales
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.tell.consistency import VerdictWord, by_share, missing_places, share_left, verdict_word
from rotorid.mismatch.tell.sentences import (
    Contents,
    details,
    first_words,
    headline,
    main_channel,
    spoken,
    warnings_of,
)
from rotorid.recordings import RecordingSet
from rotorid.recordings.check import doubts_of
from rotorid.recordings.sufficient import basis_of

__all__ = ["Verdict", "main_channel", "make_verdict", "spoken"]

SCHEMA_PATH = Path(__file__).parents[4] / "workflow" / "schemas" / "verdict.schema.json"


def _rounded(value: float | None) -> float | None:
    """To the digits that a verdict states; what is not a finite number becomes null."""
    return None if value is None or not math.isfinite(value) else rounded(float(value))


_Number = Annotated[float | None, BeforeValidator(_rounded)]


def _not_zero(p_value: float | None) -> float | None:
    smallest_p = 1e-300  # Stated of a place whose p-value is smaller.
    return None if p_value is None else min(max(float(p_value), smallest_p), 1.0)


_Probability = Annotated[Annotated[float, Field(ge=0, le=1)] | None, BeforeValidator(_rounded)]
_Share = Annotated[float, BeforeValidator(_rounded), Field(ge=0, le=1)]
_Magnitude = Annotated[Annotated[float, Field(ge=0)] | None, BeforeValidator(_rounded)]
_Interval = tuple[_Number, _Number]


class _KeysOfVerdict(BaseModel):
    """A group of keys of the verdict: none unknown, none missing."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def filled(cls, *values: object) -> Self:
        """Filled in the order of its keys."""
        return cls(**dict(zip(cls.model_fields, values, strict=True)))


class Runs(_KeysOfVerdict):
    """Runs used to fit and runs held out."""

    training: tuple[str, ...]
    held_out: tuple[str, ...]


class Errors(_KeysOfVerdict):
    """Root mean square errors of the believed vehicle, of values refitted, of values with the effects that are claimed
    (one member of each class), and of the vehicle that is delivered, derivatives included."""

    before: _Magnitude
    refitted: _Magnitude
    named: _Magnitude
    after: _Magnitude


class SplitErrors(_KeysOfVerdict):
    """Errors on the runs of each kind; null where there is none."""

    training: Errors
    held_out: Errors


class PValues(_KeysOfVerdict):
    """p-value that the residual does not depend on the inputs; null for simulation run forward."""

    before: _Probability
    after: _Probability


class Channel(_KeysOfVerdict):
    """One channel's errors relative to its noise, in its unit."""

    unit: str
    noise_floor: _Magnitude
    rmse: SplitErrors
    p_value: PValues


class Regime(_KeysOfVerdict):
    """Range of a variable in which the mismatch shows."""

    variable: str
    low: _Number
    high: _Number
    either_sign: bool = Field(default=False, description="Whether the range is that of the variable's magnitude.")


class Location(_KeysOfVerdict):
    """Where the mismatch shows: a channel of a run, from when to when, in which regime."""

    run: str
    channel: str
    start_s: _Number
    stop_s: _Number
    p_value: Annotated[_Probability, BeforeValidator(_not_zero)]
    energy_share: _Share = Field(description="Share of the channel's mismatch energy in this run that lies here.")
    regime: Regime | None


class ParameterEstimate(_KeysOfVerdict):
    """A parameter of an effect with its 95 % interval."""

    symbol: str
    value: _Number
    unit: str
    interval_95: _Interval


class Gain(_KeysOfVerdict):
    """Held-out rmse with the effect over that without it, block-bootstrap interval."""

    rmse_ratio: _Magnitude
    interval_95: _Interval


class SizeOfError(_KeysOfVerdict):
    """Root mean square of an error, or of what an effect does, in a channel's unit and in units that a pilot knows."""

    channel: str
    rms: _Magnitude
    unit: str
    share: _Magnitude
    of: str
    metres_after_half_a_second: _Magnitude = Field(
        description="How far off it alone leads within half a second of simulation; null where it moves nothing."
    )


class BasisOfVerdict(_KeysOfVerdict):
    """What the verdict rests on, said before anything else."""

    sentence: str
    recorded_s: _Magnitude
    in_the_air_s: _Magnitude = Field(description="Null for a stand or bench, and where no rotors are recorded.")
    ground_share: _Magnitude = Field(description="Of the time recorded, on the ground with rotors that idle.")
    not_recorded: tuple[str, ...]


class EffectVerdict(_KeysOfVerdict):
    """What the data say of one id."""

    id: str
    status: Literal["established", "ambiguous", "suggested", "absorbed", "not_established"]
    delivered: bool = Field(description="Whether it stands in one of the three files.")
    withheld: str = Field(description="Of one that is established or of a class and not delivered: why.")
    alternatives: tuple[str, ...]
    sentence: str
    size: SizeOfError | None = Field(description="What it does where it does most, on the held-out runs.")
    share: _Share | None = Field(
        description="Part of the squared error between before and after on the held-out runs that goes without it, "
        "two sensors of one quantity compared among the channels."
    )
    equation: str
    channels: tuple[str, ...]
    parameters: tuple[ParameterEstimate, ...]
    probability: _Probability = Field(description="Posterior that the id is at work; null where none was computed.")
    p_value: _Probability
    held_out_gain: Gain | None


class Absent(_KeysOfVerdict):
    """An id that was tested and not found, and how large it may be all the same."""

    id: str
    symbol: str = Field(description="Of the parameter that does most; empty of a form whose size has none of its own.")
    at_most: _Magnitude = Field(description="Of the parameter's magnitude, with 95 % probability.")
    unit: str
    share_of_weight: _Magnitude = Field(
        description="Root mean square force over the weight, moment over the weight at the rotors' mean distance."
    )


class DoubtOfSet(_KeysOfVerdict):
    """Something that stands in the way of believing the verdict."""

    what: str
    sentence: str
    stops: bool = Field(description="Whether the set is not judged because of it.")


class BelievedValue(_KeysOfVerdict):
    """One believed value before and after, with all values free, jointly with the delivered effects."""

    believed: _Number
    estimate: _Number
    interval_95: _Interval = Field(description="Null of a value that a bound holds: it has none.")
    delivered: _Number = Field(description="What stands in improved_vehicle.yaml.")
    wrong: bool = Field(description="Whether it is among `parameters`.")


class Correlated(_KeysOfVerdict):
    """Two believed values of which these recordings know little more than a ratio."""

    values: tuple[str, str]
    correlation: _Number


class Score(_KeysOfVerdict):
    """How well a candidate predicts what was left out of the fit."""

    model: Literal["believed", "refitted", "named"]
    derivatives: bool
    score: _Number = Field(
        description="Mean over channels, and over what half a second of simulation is off by, of the logarithm of the "
        "error over the believed vehicle's; lower is better."
    )
    standard_error: _Magnitude = Field(description="Of the difference from the best candidate.")
    unfit: str = Field(description="Why it does not hover or fly; empty where it does, or was not asked.")


class Delivered(_KeysOfVerdict):
    """Which candidate stands in improved_vehicle.yaml."""

    model: Literal["believed", "refitted", "named"]
    derivatives: bool
    scores: tuple[Score, ...]


class DerivativeOf(_KeysOfVerdict):
    """What a channel gains per unit of a quantity, predictive and without a cause."""

    channel: str
    quantity: str
    unit: str
    value: _Number
    interval_95: _Interval
    low: _Number
    high: _Number


class WrongValue(_KeysOfVerdict):
    """A value of vehicle.yaml that the data contradict."""

    believed: _Number
    refitted: _Number
    interval_95: _Interval


class NotTestable(_KeysOfVerdict):
    """An id that no column of the recording allows to test."""

    id: str
    reason: str


class Unexplained(_KeysOfVerdict):
    """What the findings leave."""

    share: _Share
    channels: tuple[str, ...]
    depends_on: tuple[str, ...]
    description: str


class NextExperiment(_KeysOfVerdict):
    """What to fly to distinguish the alternatives; empty where nothing is open.

    The separation, in standard errors, is None: `rotorid plan` alone computes it, for what can be flown.
    """

    manoeuvre: str
    separates: tuple[str, ...]
    predicted_separation_sigma: _Magnitude


class Verdict(_KeysOfVerdict):
    """The whole of `verdict.json`."""

    set: str
    kind: Literal["flight", "stand", "bench"]
    runs: Runs
    verdict: VerdictWord
    basis: BasisOfVerdict
    doubts: tuple[DoubtOfSet, ...]
    sentence: str
    size: SizeOfError | None = Field(description="Of the error as believed in the channel that the sentence names.")
    details: tuple[str, ...] = Field(description="What the sentence has no room for, the largest share first.")
    warnings: tuple[str, ...] = Field(description="Channels that are worse with what is delivered.")
    channels: dict[str, Channel]
    locations: tuple[Location, ...]
    effects: tuple[EffectVerdict, ...]
    delivered: Delivered
    derivatives: tuple[DerivativeOf, ...]
    absent: tuple[Absent, ...]
    parameters: dict[str, WrongValue]
    believed_values: dict[str, BelievedValue]
    correlations: tuple[Correlated, ...]
    command_path: tuple[ParameterEstimate, ...] = Field(
        description="Without recorded rotor speeds, about the hover command u_h: percent more thrust for one percent "
        "more command (e_u) and voltage (e_V), lateness of the rotors (tau); what the recording does not say is absent."
    )
    not_testable: tuple[NotTestable, ...]
    unexplained: Unexplained
    next_experiment: NextExperiment

    def text(self) -> str:
        """The file's text."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def schema_text() -> str:
    """The JSON schema of `verdict.json` as text."""
    return json.dumps(Verdict.model_json_schema(), indent=1, sort_keys=True) + "\n"


def make_verdict(analysis: Analysis, locations: Sequence[Location], forward: Mapping[str, Channel]) -> Verdict:
    """The verdict that an analysis, its locations and the simulation run forward amount to.

    Its word, the share left and the shares of the effects follow from the errors that it prints.
    """
    inverse, samples = _inverse_channels(analysis)
    locations = [*locations, *_missing_locations(analysis, locations, inverse, samples)]
    left, shares, basis = share_left(inverse, locations, samples), analysis.shares, basis_of(analysis.recordings)
    stopped, wrong = any(d.stops for d in analysis.doubts), analysis.values.keys()
    word: VerdictWord = "not_judged" if stopped else verdict_word(analysis, locations, left, inverse)
    main = main_channel(analysis, locations, inverse)
    contents = Contents(analysis, word, locations, inverse, main, left if word != "no_mismatch" else 0.0, forward)
    return Verdict(
        set=analysis.recordings.name,
        kind=analysis.recordings.vehicle.kind,
        runs=Runs(training=analysis.split.training, held_out=analysis.split.held_out),
        verdict=word,
        basis=BasisOfVerdict.filled(
            basis.sentence, basis.recorded_s, basis.in_the_air_s, basis.ground_share, basis.missing
        ),
        doubts=tuple(DoubtOfSet.model_validate(d, from_attributes=True) for d in analysis.doubts),
        sentence=spoken(headline(contents), analysis),
        size=_size_of(contents.main_size),
        details=tuple(spoken(text, analysis) for text in details(contents)),
        warnings=tuple(spoken(text, analysis) for text in warnings_of({**inverse, **forward})),
        channels=inverse | dict(forward),
        locations=tuple(locations),
        effects=tuple(
            effect_verdict(f, shares.get(f.id), analysis.effect_sizes.get(f.id))
            for f in by_share(analysis.findings, shares)
        ),
        delivered=Delivered(
            model=analysis.delivery.model,
            derivatives=analysis.delivery.derivatives,
            scores=tuple(Score.filled(*score) for score in analysis.delivery.scores),
        ),
        derivatives=tuple(DerivativeOf(**d.model_dump()) for d in analysis.improved.derivatives),
        absent=tuple(Absent.filled(a.id, a.symbol, a.at_most, a.unit, a.share or None) for a in analysis.absent),
        parameters={
            name: WrongValue.filled(believed, refitted, interval)
            for name, (believed, refitted, *interval) in analysis.values.items()
        },
        believed_values={
            r.name: BelievedValue.filled(r.believed, r.estimate, (r.low, r.high), r.delivered, r.name in wrong)
            for r in analysis.believed_values
        },
        correlations=tuple(Correlated.filled(*row) for row in analysis.value_correlations.items()),
        command_path=_estimates(analysis.command_path),
        not_testable=tuple(NotTestable.filled(*row) for row in sorted(analysis.not_testable.items())),
        unexplained=Unexplained(
            share=float(np.clip(contents.left, 0.0, 1.0)),
            channels=analysis.unexplained_channels,
            depends_on=analysis.unexplained_depends_on,
            description=analysis.unexplained_description,
        ),
        next_experiment=NextExperiment.filled(analysis.next_manoeuvre, analysis.next_separates, None),
    )


def _estimates(numbers: Sequence[Estimate]) -> tuple[ParameterEstimate, ...]:
    return tuple(ParameterEstimate.filled(e.symbol, e.value, e.unit, (e.low, e.high)) for e in numbers)


def _size_of(size: Size | None) -> SizeOfError | None:
    """A size as the file has it."""
    if size is None:
        return None
    return SizeOfError(
        channel=size.channel,
        rms=size.rms,
        unit=size.unit,
        share=size.share,
        of=size.words.removeprefix("of "),
        metres_after_half_a_second=size.metres,
    )


def _missing_locations(
    analysis: Analysis, locations: Sequence[Location], channels: Mapping[str, Channel], samples: Mapping[str, int]
) -> Iterator[Location]:
    """Whole runs of the channels that the rest of the verdict speaks of and nothing located."""
    for channel, p_value in missing_places(analysis, locations, channels, samples):
        traces = [t for t in analysis.traces if t.channel == channel and len(t.time_s)]
        for run in dict.fromkeys(t.run for t in traces):
            own = [t for t in traces if t.run == run]
            start_s, stop_s = float(own[0].time_s[0]), float(own[-1].time_s[-1])
            yield Location.filled(run, channel, start_s, stop_s, p_value, 1.0, None)


def _inverse_channels(analysis: Analysis) -> tuple[dict[str, Channel], dict[str, int]]:
    """Errors of every channel that the traces hold, by inverse dynamics.

    And of how many samples: of those fitted and those held out the fewer.
    """
    found, samples, part = {}, {}, fitted_part(analysis)
    for channel, traces in by_channel(analysis.traces).items():
        signs = [part(t.run, t.time_s) for t in traces]
        fitted, held_out = (
            {
                stage: rms([getattr(t, stage)[sign * s > 0] for t, s in zip(traces, signs, strict=True)])
                for stage in Errors.model_fields
            }
            for sign in (1, -1)
        )
        floor, p_values = analysis.noise_floor.get(channel), analysis.p_values.get(channel, (None, None))
        found[channel] = channel_of(traces[0].unit, floor, fitted, held_out, *p_values)
        counts = [sum(int((sign * s > 0).sum()) for s in signs) for sign in (1, -1)]
        samples[channel] = max(min(counts), 1)
    return found, samples


def channel_of(
    unit: str,
    floor: float | None,
    fitted: Mapping[str, float | None],
    held_out: Mapping[str, float | None],
    before: float | None = None,
    after: float | None = None,
) -> Channel:
    """A channel's errors by stage on the runs fitted and held out, and p-values before and after."""
    rmse = SplitErrors(training=Errors(**fitted), held_out=Errors(**held_out))
    p_value = PValues(before=before, after=after)
    return Channel(unit=unit, noise_floor=reached(floor, rmse.held_out), rmse=rmse, p_value=p_value)


def reached(floor: float | None, held_out: Errors) -> float | None:
    """A noise floor, but no more than an error that is reached where nothing was fitted.

    The floor is a root mean square of the runs that are fitted: a landing among them, or a second of vibration, makes
    it larger than the whole error of other runs.
    """
    errors = [e for e in held_out.model_dump().values() if e is not None]
    return None if floor is None else min([floor, *errors])


def effect_verdict(finding: Finding, share: float | None, size: Size | None = None) -> EffectVerdict:
    """One entry under `effects`."""
    return EffectVerdict(
        id=finding.id,
        status=finding.status,
        delivered=finding.delivered,
        withheld=finding.withheld,
        alternatives=finding.alternatives,
        sentence=first_words(f"only suggested: {finding.objection}" if finding.objection else finding.sentence),
        size=_size_of(size),
        share=share,
        equation=finding.equation or (finding.form.equation if finding.form else ""),
        channels=finding.channels,
        parameters=_estimates(finding.parameters),
        probability=finding.probability,
        p_value=finding.p_value,
        held_out_gain=None if finding.gain is None else Gain.filled(finding.gain[0], finding.gain[1:]),
    )


def with_doubts(analysis: Analysis, recordings: RecordingSet) -> Analysis:
    """The analysis with the doubts about the set as it was given, those that it corrected said to be so.

    Corrected is a doubt that the recordings as analysed, with the improved vehicle, no longer raise, where the model
    then describes them. Axes can be exchanged so that all sensors agree and the vehicle is another one.
    """
    # Share of the weight, or of the moment that the rotors can make, that may stay off in a channel where a mistake in
    # the set counts as corrected: of wrong corrections seen a quarter to a half stayed, of right ones next to nothing.
    described = 0.1
    found = left = doubts_of(recordings)
    if any(d.stops for d in found) and _still_off(analysis) < described:
        # Mistakes undone and wrong values at their numbers, without effects.
        vehicle = analysis.improved.model_copy(update={"effects": (), "derivatives": ()})
        left = doubts_of(replace(analysis.recordings, vehicle=vehicle))
    standing = {d.what for d in left}
    said = [
        d
        if d.what in standing or not d.stops
        else replace(d, sentence=f"{d.sentence} The analysis found and corrected this.", stops=False)
        for d in found
    ]
    return replace(analysis, doubts=tuple(dict.fromkeys((*said, *recordings.proposed, *analysis.recordings.proposed))))


def _still_off(analysis: Analysis) -> float:
    """Largest error of a channel beyond its noise, over what a pilot knows: the weight, the moment at hand."""
    known, off = scales(analysis), [0.0]
    for channel, traces in by_channel(t for t in analysis.traces if t.channel in known).items():
        square = rms(t.named for t in traces) ** 2
        off.append(math.sqrt(max(square - analysis.noise_floor.get(channel, 0.0) ** 2, 0.0)) / known[channel].value)
    return max(off)


if __name__ == "__main__":
    if "--write-schema" in sys.argv:
        SCHEMA_PATH.write_text(schema_text())
    else:
        print(schema_text(), end="")
