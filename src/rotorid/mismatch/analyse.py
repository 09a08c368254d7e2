"""From a recording set to what is off in it: the whole analysis in its order.

1. mistakes in the set, 2. what is fitted (`fitted`), 3. a word on each id: established, ambiguous, absorbed or not
established, and on the believed values, 4. what is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.catalogue import before_the_rotors, catalogue, ids_of, ids_of_stage, moving_air
from rotorid.effects.contract import SUPPLY, SpeedForm, SpeedPath
from rotorid.errors import InputError
from rotorid.io.text.wording import listed
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.enough import weighed
from rotorid.mismatch.decide.findings import (
    Analysis,
    ChannelTrace,
    Finding,
    RunWind,
    by_channel,
    in_interval,
    next_flight,
    rms,
    with_probabilities,
)
from rotorid.mismatch.decide.posterior import Found
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.selected import coefficients, path_findings, wrench_findings
from rotorid.mismatch.decide.sizes import fitted_part
from rotorid.mismatch.decide.statements import UpperLimit
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.values import absorbed_findings, changed_vehicle, contract_values, with_values_in_question
from rotorid.mismatch.decide.ways import beyond_trust, in_words, residuals_of, settled
from rotorid.mismatch.deliver.by_vehicle import acting_over_rows, on_vehicle
from rotorid.mismatch.deliver.candidates import Candidate, Ground
from rotorid.mismatch.deliver.files import claimed, conditions_of, instruments_of, place_of, with_effects
from rotorid.mismatch.deliver.final import Choice, Stretches, delivered
from rotorid.mismatch.deliver.flown import model_of, squares_of_windows
from rotorid.mismatch.deliver.usable import as_a_body, question_of
from rotorid.mismatch.evidence.motion import Segment, full_speed, regime_variables, stretches
from rotorid.mismatch.evidence.regression import Fit
from rotorid.mismatch.evidence.rows import CHANNELS, PARAMETER_NAMES, RUN_SCALE, Term
from rotorid.mismatch.evidence.speedpath import CommandChain
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.flight.absent import absent, chosen_already
from rotorid.mismatch.flight.every_run import lacking, on_every_run, scaled_by_run
from rotorid.mismatch.flight.fitted import Decided, Fitted, Watch, fitted, unwatched
from rotorid.mismatch.flight.gains import values_alone
from rotorid.mismatch.flight.gusts import gust_finding
from rotorid.mismatch.flight.leftover import dependence, leftover
from rotorid.mismatch.flight.prepare import Prepared, prepare, prepare_like
from rotorid.mismatch.flight.swinging import loads, on_board
from rotorid.mismatch.flight.values import (
    believed_residuals,
    only_throttle,
    values_without_path,
    with_square_term,
    with_thrust_per_command,
)
from rotorid.mismatch.flight.without import chain_ids, with_only, without_each
from rotorid.mismatch.flight.wrench import WrenchModel, linear_drag, nonlinear_intervals
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.vehicle.derivatives import quantities
from rotorid.vehicle.improved import active_forms

_UNITS = {"force": "N", "moment": "N m"}
_SENSOR_UNITS = {2: "m/s2", 3: "rad/s"}


def analyse(recordings: RecordingSet, watch: Watch = unwatched) -> Analysis:
    """The whole analysis of a set of kind `flight`.

    Model, values and words are chosen from the fitted runs alone; the runs held out are opened once, after that.
    `watch` is called with what was chosen, just before.
    """
    recordings, mistakes, remarks = find_mistakes(recordings)
    try:
        return _analysed(recordings, mistakes, remarks, watch)
    except _NothingToCompare as error:
        opened = split_runs(recordings).held_out
        left, lost = [r for r in recordings.runs if r.name not in opened], error
    if left:
        # What is held out lost a sensor throughout: something else must show what the model is worth.
        names = ", ".join(r.name for r in recordings.runs if r not in left)
        remarks = (*remarks, f"Nothing of {names} could be compared; other recordings were held out instead.")
        try:
            return _analysed(replace(recordings, runs=tuple(left), held_out=None), mistakes, remarks, watch)
        except _NothingToCompare as error:
            lost = error if error.lacking else lost
    raise InputError(
        f"set {recordings.name}: no run can be held out: "
        + (
            f"{listed(lost.runs)} {'lacks' if len(lost.runs) == 1 else 'lack'} {listed(lost.lacking)} in flight, by "
            "which the others are fitted; record it in all runs, or leave its columns out of all"
            if lost.lacking
            else f"{listed(lost.runs)} {'has' if len(lost.runs) == 1 else 'have'} no stretch of flight in which all "
            "sensors read"
        )
    )


class _NothingToCompare(Exception):
    """Nothing of the runs held out can be compared: they lack, in words, what the fitted ones have."""

    def __init__(self, runs: tuple[str, ...], lacking: tuple[str, ...]) -> None:
        super().__init__(runs, lacking)
        self.runs, self.lacking = runs, lacking


def _analysed(recordings: RecordingSet, mistakes, remarks, watch: Watch) -> Analysis:
    """The analysis of a set whose mistakes are undone; _NothingToCompare where the runs held out lack a sensor."""
    split = split_runs(recordings)
    known, held_out = parts_of(recordings, split)
    prepared = prepare(known, unseen=tuple(r.name for r in held_out.runs))
    unseen = prepare_like(prepared, held_out)
    lost = [lacking(s, prepared.segments[0]) for s in unseen[0]]
    if all(lost):
        raise _NothingToCompare(split.held_out, min(lost, key=len, default=()))
    found = fitted(prepared)
    model, values = found.model, found.values

    fit, moved = settled(model, values, model.selection.active)

    outside = [*mistakes, *findings_outside(found, prepared)]
    findings, to_state, posterior = decided(found, outside, fit, moved)
    stated_ids = {i for f in findings for i in (f.id, *f.alternatives)}
    limits = tuple(limit for limit in absent(model, posterior) if limit.id not in stated_ids)
    full = full_speed(known.runs, prepared.vehicle) if only_throttle(recordings) else None

    # The last decision is made: the runs held out are opened.
    watch(Decided(found, tuple(outside), tuple(findings), contract_values(prepared.vehicle, to_state)))
    seen = on_every_run(found, recordings, split, unseen)
    question, faults = question_of(prepared.vehicle, recordings.runs)
    choice = FlightChoice(
        model=model,
        values=values,
        plain=values_alone(model),
        stated=to_state,
        findings=_with_windows(findings, seen),
        split=split,
        believed=prepared.vehicle,
        question=question,
        remarks=faults,
        recordings=recordings,
        found=found,
        full_rad_s=full,
        absent=limits,
        corrected=tuple(remarks),
        unseen=unseen,
        seen=seen,
    )
    return with_noise_held_out(delivered(choice, lambda first: with_values_in_question(weighed(first))))


def decided(
    found: Fitted, outside: Sequence[Finding], fit: Fit, moved: Values
) -> tuple[tuple[Finding, ...], Values, Found]:
    """What is decided of a set fitted: its findings, those `outside` the model among them, wrong values as stated, and
    the posterior at the chosen model.

    `fit` with `moved` is what is delivered.
    """
    model, values = found.model, found.values
    findings = [*outside, *findings_inside(found, found.prepared, fit, {**moved, **values})]
    findings = payload_or_offset(findings, {**moved, **values})
    findings += absorbed_findings(model, values, findings)
    findings, to_state = with_square_term(findings, values, model)
    chosen = chosen_already(model)
    findings = with_probabilities(together(findings), chosen.found, chosen.support)
    return tuple(rotors_or_offset(findings, model, fit)), to_state, chosen.found


@dataclass(frozen=True)
class FlightChoice(Choice):
    """The answer on a set of flights."""

    recordings: RecordingSet
    found: Fitted
    full_rad_s: float | None
    """Where throttle alone was recorded, the speed that a full one was taken for."""
    absent: tuple[UpperLimit, ...]
    """Ids that were tested and not found, and how large they may be."""
    corrected: tuple[str, ...]
    """What was corrected in the set, a sentence each."""
    unseen: tuple[list[Segment], list[Segment]]
    """Stretches of the runs held out, and the same with noise added once more (`prepare_like`)."""
    seen: WrenchModel
    """The model with the rows of every run."""

    names = PARAMETER_NAMES

    @property
    def commanded(self) -> bool:
        """Whether rotor speeds are known from their commands alone."""
        return self.found.commanded

    def only(self, words: Analysis) -> FlightChoice:
        """The choice with what is claimed alone at work, all that stays fitted without effects that are only suggested.

        A value that is only suggested, because a payload that is not excluded would change it, is delivered as it is:
        the vehicle flies with that number, whichever of the two it is.
        """
        ids = {f.id for f in claimed(words.findings)}
        if ids >= {f.id for f in words.findings if f.id in words.without}:
            return self
        found = with_only(self.found, ids, self.values)
        stated = {k: v for k, v in self.stated.items() if k in self.values}
        seen = on_every_run(found, self.recordings, self.split, self.unseen)
        return replace(self, model=found.model, found=found, seen=seen, stated=stated)

    def with_values(self, moved: Values, stated: Values, believed: bool = False) -> Vehicle:
        """The believed vehicle with values moved within their trust and wrong ones as stated.

        Where commands alone are recorded its rotors make the thrust that was felt, unless it is the `believed` one.
        """
        changed = changed_vehicle(self.believed, {k: v[0] for k, v in {**moved, **stated}.items()})
        if not self.commanded:
            return changed
        return with_thrust_per_command(changed, 1.0 if believed else self.found.chain.scale, self.full_rad_s)

    def stated_of(self, candidate: Candidate) -> Values:
        """Wrong values of a candidate, as they are stated."""
        if candidate.model == "named" or not self.stated:
            return {k: v for k, v in self.stated.items() if k in candidate.values}
        return candidate.values

    def without_effects(self, candidate: Candidate) -> Vehicle:
        """A candidate's vehicle without effects."""
        return self.with_values(candidate.moved, self.stated_of(candidate), candidate.model == "believed")

    def believed_left(self) -> list[np.ndarray]:
        """What the believed vehicle leaves of every fitted stretch, (n, 12)."""
        return believed_residuals(self.found.prepared, self.model.rows, self.found.chain if self.commanded else None)

    def stretches(self, every_run: bool = False) -> Stretches:
        """Of the fitted rows, or of those of every run."""
        of, thinner = self.seen if every_run else self.model, self.found.prepared.thinner
        pairs = zip(of.rows, of.segments, strict=True)
        return [(r.run, r.time_s, thinner(quantities(s.motion, self.believed))) for r, s in pairs]

    def vehicle(self, candidate: Candidate, findings: Sequence[Finding]) -> Vehicle:
        """A candidate's vehicle as it would be written, given what is claimed."""
        inside = {self.model.search.terms[k].effect for k in candidate.active}
        if candidate.model != "believed" or not self.commanded:
            inside |= chain_ids(self.found)
        kept = [f for f in claimed(findings) if f.id in inside and place_of(f) == "vehicle"]
        derivatives = candidate.learnt.derivatives if candidate.learnt else ()
        whole = with_effects(self.without_effects(candidate), kept)
        return whole.model_copy(update={"derivatives": derivatives})

    def flown(self, candidate: Candidate, findings: Sequence[Finding], ground: Ground, words: Analysis) -> np.ndarray:
        """Errors of a candidate's vehicle run forward, each window by derivatives learnt without its run or piece."""
        segments = [s for s in self.found.prepared.segments if s.motion.has(("rotor_speed", "angular_velocity"))]
        parts = (conditions_of(words), instruments_of(words)) if candidate.model == "named" else ()
        vehicle = self.vehicle(candidate, findings)
        whole, of_unit = model_of(vehicle, *parts), None
        if candidate.learnt:
            regression = self.model.regression
            fold = dict(zip(regression.left_out_together(), regression.folds(), strict=True))
            own = [vehicle.model_copy(update={"derivatives": d}) for d in candidate.learnt.without]
            models = [replace(whole, forms=tuple(active_forms(v))) for v in own]
            of_unit = lambda unit: models[fold[unit]]  # noqa: E731
        return squares_of_windows(segments, whole, ground.unit_at, ground.units, of_unit)

    def larger(self, candidate: Candidate, term: Term) -> np.ndarray:
        """Factors of a term's coefficients on a candidate's vehicle (`rotorid.mismatch.deliver.by_vehicle`)."""
        changed = {**candidate.moved, **self.stated_of(candidate)}
        return on_vehicle(term, self.model.segments, self.believed, changed, self.model.noise)[0]

    def in_rows(self, vehicle: Vehicle) -> np.ndarray:
        """Force and moment on a vehicle over those that its rows hold, (6,)."""
        return acting_over_rows(self.believed, vehicle)

    def embodied(self, values: Values, moved: Values) -> Values:
        """Values moved within their trust such that next to those called wrong they are of one body."""
        return as_a_body(self.believed, values, moved)

    def account(self, findings: tuple[Finding, ...]) -> Analysis:
        """What the choice amounts to on every run, given the words on it so far."""
        found, seen, model, named, refitted = self.found, self.seen, self.model, self.named, self.refitted
        fit, plain_fit = scaled_by_run(seen, named.fit), scaled_by_run(seen, refitted.fit)
        delivered = residuals_of(seen, fit)
        before, after, depends = dependence(seen.prepared, seen, seen.segments, seen.noisy_segments)
        unexplained_channels, depends_on, description = leftover(
            seen.prepared,
            seen,
            seen.segments,
            seen.noisy_segments,
            after,
            depends,
            delivered if beyond_trust(model, self.values, model.selection.active) else None,
            bool(self.values) or any(f.status in CLAIMED for f in findings),
        )
        believed_left = believed_residuals(seen.prepared, seen.rows, found.chain if found.commanded else None)
        refitted_left = on_path = residuals_of(seen, plain_fit)
        by_values = changed_vehicle(self.believed, {k: v[0] for k, v in {**refitted.moved, **refitted.values}.items()})
        if found.commanded:
            faster = believed_residuals(seen.prepared, seen.rows, found.chain, times=np.sqrt(2.0))
            gains, refitted_left = values_without_path(believed_left, faster, len(model.rows))
            by_values = self.with_values(gains, {}, believed=True)
        traces = _make_traces(seen, found, believed_left, refitted_left, on_path, delivered)
        between = _sensor_traces(seen, on_path, delivered)
        fly, improved = next_flight(findings, self.recordings), self.with_values(named.moved, self.stated)
        return Analysis(
            recordings=self.recordings,
            split=self.split,
            believed=self.believed,
            refitted=by_values,
            improved=improved,
            named=improved,
            findings=findings,
            values=contract_values(self.believed, self.stated),
            not_testable=not_testable(found.prepared, found.chain, findings),
            absent=self.absent,
            traces=traces,
            between_sensors=between,
            without=without_each(found, seen, self.values, fit, findings, (*traces, *between)),
            noise_floor=_noise_floors(found),
            p_values={c: (before[c], after[c]) for c in before},
            regimes=_regimes_by_run(seen.segments, seen.prepared),
            winds=_winds_of(seen),
            unexplained_channels=unexplained_channels,
            unexplained_depends_on=depends_on,
            unexplained_description=description,
            next_manoeuvre=fly.manoeuvre,
            next_separates=fly.separates,
            force_source=model.segments[0].force_source,
            command_path=_command_path(found.chain),
            notes=(*self.corrected, *run_scale_notes(model), *_lag_alone_notes(found.chain)),
            instead=_instead_in_words(found.instead),
            corrected=in_words(named.moved),
        )


def _with_windows(findings: Sequence[Finding], seen: WrenchModel) -> tuple[Finding, ...]:
    """Findings with the windows of every run in which they act: gusts, and a payload on board for a time."""
    windows = tuple(g.window for g in seen.gusts)
    blown = ids_of("air_moves", "in windows") if seen.gusts else ()
    out = [replace(f, windows=windows) if f.id in blown else f for f in findings]
    if aboard := on_board(seen.segments):
        comes_and_goes = {t.effect for t in loads(seen)}
        out = [_payload_for_a_time(f, aboard) if f.id in comes_and_goes else f for f in out]
    return tuple(out)


def _winds_of(seen: WrenchModel) -> tuple[RunWind, ...]:
    """The winds in which a model flies its runs."""
    out = [RunWind(g.run, "in windows", g.knots_s, g.wind_m_s) for g in seen.gusts]
    if seen.wind is None:
        return tuple(out)
    for run in dict.fromkeys(s.run for s in seen.segments):
        own = [s.motion.time_s for s in seen.segments if s.run == run]
        span = np.array([own[0][0], own[-1][-1]])
        out.append(RunWind(run, "all the time", span, np.tile(np.asarray(seen.wind, float), (2, 1))))
    return tuple(out)


def findings_outside(found: Fitted, prepared: Prepared) -> list[Finding]:
    """A finding for what is fitted outside of the regression of force and moment: winds, gusts, the command chain."""
    model = found.model
    findings = [] if model.wind is None else [_wind_finding(model)]
    if model.gusts:
        findings.append(gust_finding(model.gusts))
    if found.chain is not None:
        rotors, full = prepared.vehicle.rotor_count, found.chain.full_speed
        # One-sigma, in samples, that no time is better known by: between two samples commands hold, or change, as
        # nobody recorded.
        timing_floor = 0.05
        findings += path_findings(
            found.chain.result,
            tuple(f"rotor_speed_{i + 1}" for i in range(rotors)) if found.measured else ("force_z",),
            timing_floor / prepared.segments[0].rate_hz,
            lambda form, values: _limited_windows(prepared.segments, form, values, full),
        )
    return findings


def findings_inside(found: Fitted, prepared: Prepared, delivered: Fit, changed: Values | None = None) -> list[Finding]:
    """A finding for every term that the regression of force, moment and sensors selected or dropped.

    Numbers are those for the believed vehicle with its values `changed`.
    """
    model = found.model
    findings = wrench_findings(
        model.contributions,
        model.search.regression,
        model.search,
        model.selection,
        model.noise,
        nonlinear_intervals(prepared, model, model.segments),
        delivered,
        lambda term: on_vehicle(term, model.segments, prepared.vehicle, changed or {}, model.noise),
    )
    return findings


def _payload_for_a_time(finding: Finding, windows: tuple[tuple[str, float, float], ...]) -> Finding:
    """A payload with when it is on board."""
    when = ", ".join(f"in {run} from {start:.1f} to {stop:.1f} s" for run, start, stop in windows)
    return replace(finding, windows=windows, sentence=f"{finding.sentence}: {when}")


def not_testable(prepared: Prepared, chain: CommandChain | None, findings: list[Finding]) -> dict[str, str]:
    """Reasons why ids cannot be tested on this set, those aside that were found all the same."""
    reasons = dict(prepared.not_testable)
    if chain is None:
        recorded = all(s.command is not None for s in prepared.segments)
        why = "no force is known to compare commands with" if recorded else "no rotor commands recorded"
        reasons.update(dict.fromkeys(before_the_rotors(), why))
    elif chain.full_voltage is None:
        reasons = {**dict.fromkeys(ids_of_stage(SUPPLY), "no battery voltage"), **reasons}
    if chain is not None:
        reasons = {**chain.result.silent, **reasons}
    known = {f.id for f in findings if f.status in CLAIMED}
    return {k: v for k, v in reasons.items() if k not in known}


def _instead_in_words(instead: Mapping[str, Sequence[Values]]) -> dict[str, tuple[str, ...]]:
    """Contract name of a wrong value to others, in words, that would explain as much in its place."""
    return {
        PARAMETER_NAMES[key]: tuple(filter(None, (" with ".join(in_words(x)) for x in as_well)))
        for key, as_well in instead.items()
    }


def _command_path(chain: CommandChain | None) -> tuple[Estimate, ...]:
    """What is known of the path from command to thrust about the hover command."""
    known = {} if chain is None else chain.result.about_hover
    return tuple(in_interval(symbol, value, unit, sd) for symbol, (value, sd, unit) in known.items())


def _lag_alone_notes(chain: CommandChain | None) -> list[str]:
    """The lag as others state it, who fit neither a delay nor a throttle curve jointly, where it shares with them."""
    if chain is None or chain.result.lag_alone is None:
        return []
    fit = chain.result.lag_alone
    tau, reach = float(fit.values[0]), 1.96 * float(np.sqrt(fit.covariance[0, 0]))
    return [
        "The lateness of the rotors is shared by a lag and what else was found; a lag alone would be "
        f"{1000 * tau:.0f} ms ({1000 * (tau - reach):.0f} to {1000 * (tau + reach):.0f} ms)."
    ]


def run_scale_notes(model: WrenchModel) -> list[str]:
    """What was done about a thrust that differs between runs.

    Reported is what a flight shows, thrust over mass: both may move together with anything.
    """
    regression = model.search.regression
    terms = [t for t in regression.terms if t.key.startswith(RUN_SCALE)]
    if not terms:
        return []
    fit = regression.fit(model.search.always + model.selection.active)

    def change(key: str) -> float:
        return float(coefficients(regression, fit, key)[0][0])

    common = change("thrust") - (change("mass") if "mass" in model.search.terms else 0.0)
    parts = ", ".join(f"{t.run} {100 * (change(t.key) + common):+.1f} %" for t in terms)
    return [
        f"The thrust that a rotor speed makes per mass is not the same in every run; each has its own scale ({parts})."
    ]


def _wind_finding(model: WrenchModel) -> Finding:
    """The steady wind as a velocity, fitted through the drag."""
    effect = moving_air("all the time")
    w, sd = model.wind, model.wind_sd
    drag = linear_drag(model)
    form = next(f for f in effect.forms(model.prepared.vehicle) if f.linear_drag == "times rotor speed")
    k_d = 0.0 if drag is None or drag[0].linear_drag != form.linear_drag else float(np.mean(drag[1]))
    return Finding(
        id=effect.id,
        status="established",
        form=form if k_d else None,
        values=tuple(float(k_d * x) for x in w),
        equation="v_air = v − Rᵀ w",
        sentence="the vehicle flew through air that moves over the ground",
        parameters=tuple(
            in_interval(f"w_{axis}", x, "m/s", s) for axis, x, s in zip(("north", "east"), w, sd, strict=True)
        ),
        p_value=float(np.exp(-0.5 * min(1400.0, np.sum((w / sd) ** 2)))),
        channels=("force_x", "force_y"),
    )


def payload_or_offset(findings: list[Finding], values: dict) -> list[Finding]:
    """A centre of mass off its place on a vehicle that is heavier than believed may be a payload as well.

    The payload would bring products of inertia along: found with such an offset they belong to the same question.
    """
    surely_heavier = 2.0  # Standard errors by which a vehicle must be heavier than believed to carry a payload.
    sure = {key: change for key, (change, sd) in values.items() if abs(change) > surely_heavier * sd}
    heavier = max(sure.get("mass", 0.0), sure.get("lifted", 0.0)) > 0 or sure.get("thrust", 0.0) < 0
    stated = [f for f in findings if f.status in CLAIMED]
    load = next(e for e in catalogue().values() if e.like_on_heavier)
    first, *others = load.like_on_heavier
    offset = next((f for f in stated if first in (f.id, *f.alternatives)), None)
    if not rules.PAYLOAD_OR_OFFSET(offset is not None and heavier):
        return findings
    return [f.or_else([load.id]) if f is offset or (f.id in others and f in stated) else f for f in findings]


def rotors_or_offset(findings: Sequence[Finding], model: WrenchModel, fit: Fit) -> list[Finding]:
    """Findings in which effects that roll and pitch the vehicle alike in these runs are one class.

    In a hover one rotor's thrust is a moment about the centre of mass, and so is an offset of that centre. `fit` is of
    the terms at work.
    """
    terms, out = model.search.terms, list(findings)
    for place, f in enumerate(findings):
        other = catalogue()[f.id].turns_like
        if f.status not in CLAIMED or not other or other in f.alternatives:
            continue
        own = [k for k in model.selection.active if terms[k].effect == f.id]
        others = [t for t in terms.values() if t.kind == "effect" and t.effect == other]
        if not own or not others:
            continue
        cols = model.regression.columns(own)
        made = np.concatenate(model.contributions.of(cols, fit.beta[fit.places(cols)]))[:, 3:5].ravel()
        share = max(_share_made(model, t, made) for t in others)
        if rules.ROTORS_OR_OFFSET(share >= rules.ROTORS_OR_OFFSET["share"]):
            out[place] = f.or_else([other])
    return out


def _share_made(model: WrenchModel, term: Term, moment: np.ndarray) -> float:
    """Share of the squares of a rolling and pitching moment (2 n,), N m, that a term's columns can make."""
    cols = model.regression.columns([term.key])
    columns = np.concatenate([r.x[:, 3:5, cols].reshape(-1, len(cols)) for r in model.rows])
    left = moment - columns @ np.linalg.lstsq(columns, moment, rcond=None)[0]
    return 1.0 - float(left @ left) / max(float(moment @ moment), 1e-300)


def _make_traces(
    model: WrenchModel,
    found: Fitted,
    believed: list[np.ndarray],
    refitted: list[np.ndarray],
    on_path: list[np.ndarray],
    delivered: list[np.ndarray],
) -> tuple[ChannelTrace, ...]:
    """Residual of every channel before refitting, after it (alone and `ChannelTrace.on_path`) and with the effects,
    (n, 12) each per stretch."""
    prepared, chain = model.prepared, found.chain
    out = []
    parts = (model.rows, prepared.segments, believed, refitted, on_path, delivered)
    for r, segment, before, plain, path, after in zip(*parts, strict=True):
        for c in range(6):
            if np.isfinite(r.y[:, c]).all():
                unit = _UNITS[CHANNELS[c].split("_")[0]]
                own = (part[:, c] for part in (before, plain, after, after, path))
                out.append(ChannelTrace(r.run, CHANNELS[c], unit, r.time_s, *own))
        if chain is not None and found.measured:
            path = chain.speeds(segment)
            asked = prepared.thinner(segment.motion.rotor_speed - segment.command)
            left = prepared.thinner(segment.motion.rotor_speed - path)
            for i in range(asked.shape[1]):
                name = f"rotor_speed_{i + 1}"
                out.append(
                    ChannelTrace(r.run, name, "rad/s", r.time_s, asked[:, i], asked[:, i], left[:, i], left[:, i])
                )
    return tuple(out)


def _sensor_traces(
    model: WrenchModel, refitted: list[np.ndarray], delivered: list[np.ndarray]
) -> tuple[ChannelTrace, ...]:
    """The same of two sensors of one quantity: reading of one less what the other makes of it.

    Offsets of the sensors, which no vehicle states, are taken out before, too.
    """
    return tuple(
        ChannelTrace(
            r.run, CHANNELS[c], _SENSOR_UNITS[c // 3], r.time_s, plain[:, c], plain[:, c], after[:, c], after[:, c]
        )
        for r, plain, after in zip(model.rows, refitted, delivered, strict=True)
        for c in range(6, 12)
        if np.isfinite(r.y[:, c]).all()
    )


def _noise_floors(found: Fitted) -> dict[str, float]:
    """Noise of each channel in the band of the traces: what is left where the whole catalogue is free to explain.

    Never less than the sensors' own noise makes of the channel: the whole catalogue may fit that, too.
    """
    model, chain = found.model, found.chain
    own = _sensor_floor(model)
    out = {name: float(max(model.floor[c], own[c])) for c, name in enumerate(CHANNELS) if np.isfinite(model.floor[c])}
    if chain is not None and found.measured:
        out |= {f"rotor_speed_{i + 1}": float(sd) for i, sd in enumerate(_speed_floor(found))}
    return out


def with_noise_held_out(analysis: Analysis) -> Analysis:
    """Where nothing is stated that a model holds, the analysis with floors that hold on the runs held out, too.

    What is left of a channel there and depends on nothing recorded is noise, however much less of it the fitted runs
    had: a vibration seen through aliasing is larger or smaller by the rotors' speed.
    """
    if analysis.without or analysis.wrong_values:
        return analysis
    part, floors = fitted_part(analysis), dict(analysis.noise_floor)
    no_dependence_p = 0.01  # p-value of a residual's dependence on what is recorded from which it is taken for noise.
    for channel, traces in by_channel(analysis.traces).items():
        left = rms(t.named[part(t.run, t.time_s) < 0] for t in traces)
        noise = analysis.p_values.get(channel, (0.0, 0.0))[1] > no_dependence_p
        if noise and channel not in analysis.unexplained_channels and not np.isnan(left):
            floors[channel] = max(floors.get(channel, 0.0), left)
    return replace(analysis, noise_floor=floors)


def _speed_floor(found: Fitted) -> np.ndarray:
    """Noise of the measured speed of each rotor in the band of the traces, (rotors,), rad/s.

    What the chain leaves less what a regression on the command, its square and derivatives and on the voltage still
    explains.
    """
    thinner, left, inputs = found.prepared.thinner, [], []
    for segment in found.prepared.segments:
        left.append(thinner(segment.motion.rotor_speed - found.chain.speeds(segment)))
        command = segment.command / max(float(np.abs(segment.command).max()), 1e-12)
        slope = np.gradient(command, segment.dt_s, axis=0)
        volts = np.zeros(len(command)) if segment.motion.voltage is None else segment.motion.voltage
        columns = [command, command**2, slope, np.gradient(slope, segment.dt_s, axis=0), volts[:, None] * command]
        inputs.append(np.stack([thinner(x) for x in columns], axis=2))
    left, inputs = np.concatenate(left), np.concatenate(inputs)
    out = np.zeros(left.shape[1])
    for i in range(left.shape[1]):
        x = np.column_stack([np.ones(len(left)), inputs[:, i]])
        x = x / np.maximum(np.abs(x).max(axis=0), 1e-300)
        rest = left[:, i] - x @ np.linalg.lstsq(x, left[:, i], rcond=1e-9)[0]
        out[i] = rest.std()
    return out


def _sensor_floor(model: WrenchModel) -> np.ndarray:
    """What the sensors' noise makes of each channel (12,), but no more than the model leaves; 0 where not known."""
    if model.contributions.noisy is None:
        return np.zeros(12)
    pairs = list(zip(model.rows, model.contributions.noisy, strict=True))
    added = np.concatenate([n.y - r.y for r, n in pairs])
    full = model.full_fit()
    left = np.concatenate(
        [r.y - part for r, part in zip(model.rows, model.contributions.of(full.columns, full.beta), strict=True)]
    )
    rms = [np.sqrt(np.mean(x**2, axis=0)) for x in (added, left)]
    return np.nan_to_num(np.minimum(*rms))


def _regimes_by_run(segments, prepared: Prepared) -> dict[str, dict[str, np.ndarray]]:
    """Regime variables of every run, its stretches one after the other."""
    out: dict[str, dict[str, np.ndarray]] = {}
    for s in segments:
        own = regime_variables(s, prepared)
        if s.run not in out:
            out[s.run] = own
            continue
        shared = [k for k in out[s.run] if k in own]
        out[s.run] = {k: np.concatenate([out[s.run][k], own[k]]) for k in shared}
    return out


def _limited_windows(
    segments, form: SpeedForm, values: np.ndarray, full_speed: float
) -> tuple[tuple[str, float, float], ...]:
    """Stretches in which a limit holds a rotor's command (`full_speed` in rad/s), closer than 0.3 s taken together."""
    out = []
    for s in segments:
        times = s.motion.time_s
        beyond = (form.apply(SpeedPath(s.command, times, full_speed), values) != s.command).any(axis=1)
        for start, stop in stretches(beyond):
            begin, end = float(times[start]), float(times[stop - 1])
            if out and out[-1][0] == s.run and begin - out[-1][2] < 0.3:
                out[-1] = (s.run, out[-1][1], end)
            else:
                out.append((s.run, begin, end))
    return tuple(out)


def together(findings: list[Finding]) -> list[Finding]:
    """Findings with the windows of one id (several gusts) as one."""
    out: dict[str, Finding] = {}
    for f in findings:
        first = out.get(f.id)
        if first is None or not f.windows or not first.windows:
            out.setdefault(f.id if first is None else f"{f.id}/{len(out)}", f)
            continue
        better = first if first.p_value <= f.p_value else f
        out[f.id] = replace(better, windows=first.windows + f.windows)
    return list(out.values())
