"""From a recording set of kind `stand` or `bench` to what is off in it, in the same form as for a flight.

1. mistakes in the set, 2. what lies between command and rotor speed, 3. the grouped search over everything that acts
on the load or on its reading, with the believed values free, 4. nonlinear parameters refined, 5. a word on each id,
6. the runs held out, opened once, as for a flight.

Two things may look like a wrong value and are none. A law of nature has one form, an effect of the catalogue has many:
another laboratory's thrust curve, cable or room is never quite that of any equation written down before. What a strong
effect's form leaves follows the same inputs, is far above the noise, and a believed value will fit it. So a value that
seems wrong must also be needed where the effect is free to have any smooth form: its contribution times hat functions
of the load's size and of its own, and a little late. Effects whose equation is geometry or a definition
(`Effect.exact`) have that form and no other. And a gain only looks wrong where a characteristic is curved.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.effects.catalogue import before_the_rotors, catalogue, ids_of, ids_of_stage
from rotorid.effects.contract import CURVE, SUPPLY
from rotorid.effects.loading import CHANNELS, NO_ROTORS, UNITS, Loading
from rotorid.effects.throttle_curve import SLOPE
from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.enough import weighed
from rotorid.mismatch.decide.findings import (
    Analysis,
    ChannelTrace,
    Finding,
    first_s,
    next_flight,
    on_traces,
    with_probabilities,
)
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.select import KEEP_P, SHARE_OF_LARGEST, Selection
from rotorid.mismatch.decide.selected import (
    SMALLEST_CHANGE,
    VALUE_Z,
    WIDEST_TRUST,
    coefficients,
    estimates,
    findings_of,
    throttle_or_thrust,
    wrong_values,
)
from rotorid.mismatch.decide.status import CLAIMED, Estimate
from rotorid.mismatch.decide.values import absorbed_findings, changed_vehicle, contract_values
from rotorid.mismatch.decide.ways import in_words, residuals_of, settled
from rotorid.mismatch.decide.words import TAKEN_UP
from rotorid.mismatch.deliver.candidates import Candidate
from rotorid.mismatch.deliver.files import claimed
from rotorid.mismatch.deliver.final import Choice, delivered
from rotorid.mismatch.evidence.regression import Fit, Regression
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.instrument.chain import (
    ChainResult,
    find_chain,
    moved,
    speed_traces,
    supply_reason,
    unseen_loadings,
)
from rotorid.mismatch.instrument.mistakes import find_mistakes
from rotorid.mismatch.instrument.model import (
    VALUE_NAMES,
    ReadingModel,
    active_values,
    chosen_already,
    fitted_model,
    kept_values,
    make_terms,
    nonlinear_deviation,
    regression_of,
    rows_of,
    whole_reading,
)
from rotorid.mismatch.instrument.remainder import dependence, leftover, regimes
from rotorid.mismatch.instrument.sampling import quantisation
from rotorid.mismatch.instrument.setup import PreparedInstrument, averaged, pieces_of, set_up
from rotorid.recordings import RecordingSet, Vehicle
from rotorid.steps import step

_MOST_SHARE = 0.5
"""A value is weaker than an effect where it adds less than this share of what the effect explains by itself, and is not
needed where less than this share of what it adds remains given the effect's free form."""
_FREE = "free form"
_GAIN = "gain"
_SPEED_LEFT = "what was found between command and rotor speed does not carry over to the runs held out"


def _same_curve(chain: ChainResult) -> dict[str, str]:
    """Ids that given a curve of the throttle only say again what it leaves, where speeds are known from it alone."""
    if not any(f.id in ids_of_stage(CURVE) and f.status in CLAIMED for f in chain.findings):
        return {}
    return dict.fromkeys(sorted(ids_of("curve_of_load")), TAKEN_UP)


def _one_load(finding: Finding, setup: PreparedInstrument) -> Finding:
    """Thrust and reading of one rotor that does not tilt are curves of one load: which of them is curved stays open."""
    alone = setup.recordings.vehicle.rotor_count == 1 and not setup.instrument.tilts
    if not alone or finding.id not in ids_of("curve_of_load") or finding.status not in CLAIMED:
        return finding
    if set(finding.channels) != {"force_z"}:
        return finding
    if not rules.ONE_LOAD(True):
        return finding
    return replace(
        finding, status="ambiguous", alternatives=tuple(sorted({*ids_of("curve_of_load"), *finding.alternatives}))
    )


def decided_of_reading(model: ReadingModel) -> list[Finding]:
    """Findings on the load and on its reading, with what one load or commands alone cannot distinguish."""
    found = [_one_load(f, model.setup) for f in reading_findings(model)]
    measured = all(x.measured for x in model.setup.loadings)
    return found if measured else [throttle_or_thrust(f) for f in found]


@step("searching what acts")
def first_model(
    setup: PreparedInstrument, terms: list[Term]
) -> tuple[ReadingModel, ChainResult | None, tuple[Loading, ...] | None]:
    """The model of the reading as the search ends, what lies between command and rotor speed, and the loads by that.

    The loads are None where rotor speeds are measured, or no rotor turns: they stay as they were prepared.
    """
    measured = all(x.measured for x in setup.loadings)
    chain = find_chain(setup)
    loadings = None if chain is None or measured else moved(setup, chain)
    model = fitted_model(setup, terms, loadings=loadings)
    if loadings is not None and model.selection.active:
        # What was found at the reading changes what the commands must explain: once more with it known.
        others = [(model.search.terms[k].form, active_values(model, k)) for k in model.selection.active]
        chain = find_chain(setup, others)
        loadings = moved(setup, chain)
        refused = _same_curve(chain)
        active = [k for k in model.selection.active if model.search.terms[k].effect not in refused]
        model = fitted_model(setup, terms, active, loadings, refused)
    return model, chain, loadings


def analyse_instrument(recordings: RecordingSet) -> Analysis:
    """The whole analysis of a set of kind `stand` or `bench`.

    Model, values and words are chosen from the fitted runs alone; the runs held out are opened once, after that.
    """
    recordings, findings, remarks = find_mistakes(recordings)
    known, unseen = parts_of(recordings, split_runs(recordings))
    setup = set_up(known, recordings)
    terms, reasons = make_terms(setup)
    measured = all(x.measured for x in setup.loadings)
    model, chain, loadings = first_model(setup, terms)

    def values_of(selection: Selection, refused: Collection[str] = ()) -> Values:
        def size(key: str, change: float) -> float:
            return float(model.search.ask.sizes_of(key, np.array([change])).max())

        return wrong_values(model.regression, selection, size, moving=False, refused=refused)

    model = with_plainer_forms(model, loadings)
    if chain is None:
        reasons.update(
            {k: NO_ROTORS if setup.instrument.bench else "no commands are recorded" for k in before_the_rotors()}
        )
    else:
        findings += chain.findings
        why = supply_reason(setup)
        if why is not None:
            reasons |= dict.fromkeys(ids_of_stage(SUPPLY), why)
    values, refused = values_of(model.selection), set()
    while needless := (_needless_values(model, values) | _curved_gains(model, values)) - refused:
        refused |= needless
        values = values_of(model.selection, refused)
    findings += decided_of_reading(model)
    coarse, why = quantisation(setup, model.noise)
    if coarse is not None:
        findings.append(coarse)
    elif why:
        reasons["quantisation"] = why

    plain = values_of(Selection([], model.selection.fit))
    findings += absorbed_findings(model, values, findings)
    chosen = chosen_already(model)
    findings = with_probabilities(findings, chosen.found, chosen.support)
    to_state = values if measured else _stated_of_commands(findings, values)

    # The last decision is made: the runs held out are opened.
    choice = InstrumentChoice(
        model=model,
        values=values,
        plain=plain,
        stated=to_state,
        findings=tuple(findings),
        split=setup.split,
        believed=setup.vehicle,
        question=lambda vehicle: "",
        remarks=(),
        recordings=recordings,
        chain=chain,
        reasons=reasons,
        corrected=tuple(remarks),
        seen=_on_every_run(model, chain, unseen),
    )
    return delivered(choice, weighed)


def _stated_of_commands(findings: list[Finding], values: Values) -> Values:
    """Wrong values to state where rotor speeds are known from commands alone: none that only says their scale.

    At which voltage the believed values hold is not stated (the largest in the set is only a guess), and a curve of the
    throttle has a slope of its own: no thrust then, and a torque less its part in the scale.
    """
    claims = [f for f in findings if f.status in CLAIMED]
    curves = (f for f in claims if f.id in ids_of_stage(CURVE))
    if not (
        any(f.id in ids_of_stage(SUPPLY) for f in claims)
        or any(SLOPE in [p.symbol for p in f.parameters] for f in curves)
    ):
        return values
    (thrust, thrust_sd), (torque, torque_sd) = (values.get(k, (0.0, 0.0)) for k in ("thrust", "torque"))
    kept = {k: v for k, v in values.items() if k not in ("thrust", "torque", "speed", "mass")}
    change, sd = (1 + torque) / (1 + thrust) - 1, float(np.hypot(thrust_sd, torque_sd))
    if "torque" in values and abs(change) > max(VALUE_Z * sd, SMALLEST_CHANGE):
        kept["torque"] = (change, sd)
    return kept


@dataclass(frozen=True)
class InstrumentChoice(Choice):
    """The answer on a set of a stand or bench."""

    model: ReadingModel
    recordings: RecordingSet
    chain: ChainResult | None
    """What lies between command and speed; None where no command is recorded."""
    reasons: Mapping[str, str]
    """To ids that cannot be tested, why."""
    corrected: tuple[str, ...]
    """What was corrected in the set, a sentence each."""
    seen: ReadingModel
    """The model with the rows of every run."""

    names = VALUE_NAMES
    restates = False

    @property
    def chain_of_speeds(self) -> ChainResult | None:
        """What lies between command and speed, where both are recorded."""
        return self.chain if all(x.measured for x in self.model.setup.loadings) else None

    def only(self, words: Analysis) -> InstrumentChoice:
        """The choice with what is claimed alone at work, fitted without effects that are only suggested."""
        model = self.model
        ids = {f.id for f in claimed(words.findings)}
        active = [k for k in model.selection.active if model.search.terms[k].effect in {*ids, *UNKNOWNS}]
        gone = [k for k, _ in self.chain_of_speeds.result.fit.chain if k not in ids] if self.chain_of_speeds else []
        if len(active) == len(model.selection.active) and not gone:
            return self
        chain = self.chain.less(gone) if gone else self.chain
        fewer = _with_terms(model, active)
        return replace(self, model=fewer, chain=chain, seen=replace(self.seen, selection=fewer.selection))

    def without_effects(self, candidate: Candidate) -> Vehicle:
        """A candidate's vehicle without effects, with a full speed that nobody stated."""
        vehicle = improved(self.believed, {**candidate.moved, **candidate.values})
        if self.chain is None or not self.model.setup.estimated_full_speed:
            return vehicle
        return vehicle.model_copy(update={"rotor_speed_limits_rad_s": (0.0, self.chain.full_speed)})

    def believed_left(self) -> list[np.ndarray]:
        """What the believed vehicle leaves of every fitted stretch, (n, 6)."""
        return [np.nan_to_num(r.y) for r in self.model.rows]

    def account(self, findings: tuple[Finding, ...]) -> Analysis:
        """What the choice amounts to on every run, given the words on it so far."""
        model, seen, chain, named, refitted = self.model, self.seen, self.chain, self.named, self.refitted
        setup, of_speeds, whole = model.setup, self.chain_of_speeds, self.without_effects(named)
        # The most significant class first.
        step = next_flight(sorted(findings, key=lambda f: f.p_value), self.recordings)
        traces, before, after = _make_traces(seen, refitted.fit, named.fit)
        p_before, p_after, depends = dependence(seen, before, after)
        channels, description = leftover(seen, after, p_after, depends)
        if of_speeds is not None:
            traces += speed_traces(seen.setup, of_speeds)
            # Share of the rotor speeds' mismatch left on the runs held out from which it is said to be unexplained.
            lost_share = 0.15
            if _speed_left(seen.setup, of_speeds, traces) > lost_share:
                channels = (*channels, *(f"rotor_speed_{i + 1}" for i in range(setup.vehicle.rotor_count)))
                depends = [*depends, "battery_voltage_v"] if supply_reason(setup) else depends
                description = "; ".join([*([description] if description else []), _SPEED_LEFT])
        claimed_ids = {f.id for f in findings if f.status in CLAIMED}
        return Analysis(
            recordings=self.recordings,
            split=self.split,
            believed=self.believed,
            refitted=improved(self.believed, {**refitted.moved, **refitted.values}),
            improved=whole,
            named=whole,
            findings=findings,
            values=contract_values(self.believed, self.stated, VALUE_NAMES) | _full_speed_value(setup, chain),
            not_testable={k: v for k, v in self.reasons.items() if k not in claimed_ids},
            traces=traces,
            noise_floor=_noise_floors(setup, model, chain),
            p_values={c: (p_before[c], p_after[c]) for c in p_before},
            regimes=regimes(seen),
            unexplained_channels=channels,
            unexplained_depends_on=tuple(depends),
            unexplained_description=description,
            next_manoeuvre=step.manoeuvre,
            next_separates=step.separates,
            force_source="sensor",
            samples_per_row=setup.average,
            instrument=setup.instrument,
            loadings=seen.loadings,
            notes=(*self.corrected, *_notes_of(setup)),
            corrected=in_words(named.moved, VALUE_NAMES),
            without=_without_each(model, seen, self.values, of_speeds, findings, traces),
        )


def _with_terms(model: ReadingModel, active: Sequence[str]) -> ReadingModel:
    """A model with some of its terms alone at work, fitted anew."""
    always = [t.key for t in model.regression.terms if t.kind != "effect"]
    fit = model.regression.fit([*always, *active], jackknife=True)
    return replace(model, selection=replace(model.selection, active=list(active), fit=fit))


def _without_each(
    model: ReadingModel, seen: ReadingModel, values: Values, chain: ChainResult | None, findings: list[Finding], traces
) -> dict[str, tuple[np.ndarray, ...]]:
    """To the id of every stated effect what is left of every trace without it, all else fitted anew.

    `seen` is the model with the rows of every run, `chain` what lies between command and speed where both are measured.
    Where only commands are known, what lies between is not taken apart, nor is a mistake of the set.
    """
    out, active = {}, model.selection.active
    names = {f.id for f in findings if f.status in CLAIMED}
    for effect in dict.fromkeys(model.search.terms[k].effect for k in active):
        if effect in names:
            fewer = settled(model, values, [k for k in active if model.search.terms[k].effect != effect])[0]
            out[effect] = on_traces(traces, seen.rows, residuals_of(seen, fewer))
    for key in [] if chain is None else [k for k, _ in chain.result.fit.chain if k in names and k not in out]:
        own = speed_traces(seen.setup, chain.less([key]))
        left = {(t.run, t.channel, first_s(t.time_s)): t.named for t in own}
        out[key] = tuple(left.get((t.run, t.channel, first_s(t.time_s)), t.named) for t in traces)
    return out


def _speed_left(setup: PreparedInstrument, chain: ChainResult, traces: tuple[ChannelTrace, ...]) -> float:
    """Share of the rotor speeds' mismatch that is left on the held-out runs, beyond the noise; 0 without such runs."""
    own = [t for t in traces if t.channel.startswith("rotor_speed") and t.run in setup.split.held_out]
    if not own or not chain.findings or set(setup.split.held_out) & set(setup.split.training):
        return 0.0
    floor = float(np.mean(chain.result.noise**2)) * sum(len(t.before) for t in own)
    start, left = (sum(float(x @ x) for x in stage) for stage in ([t.before for t in own], [t.named for t in own]))
    return float(np.clip((left - floor) / max(start - floor, 1e-9), 0.0, 1.0)) if left > floor else 0.0


def _full_speed_value(
    setup: PreparedInstrument, chain: ChainResult | None
) -> dict[str, tuple[float, float, float, float]]:
    """The speed at full throttle, nothing believed, where no limits are stated."""
    if chain is None or not setup.estimated_full_speed:
        return {}
    full, reach = chain.full_speed, 1.96 * chain.full_speed_sd
    return {"rotor_speed_limits_rad_s": (float("nan"), full, full - reach, full + reach)}


def _noise_floors(setup: PreparedInstrument, model: ReadingModel, chain: ChainResult | None) -> dict[str, float]:
    """Noise of each channel."""
    out = {CHANNELS[c]: float(model.noise[c]) for c in setup.instrument.channels}
    if chain is not None and all(x.measured for x in setup.loadings):
        out |= {f"rotor_speed_{i + 1}": float(sd) for i, sd in enumerate(chain.result.noise)}
    return out


def _notes_of(setup: PreparedInstrument) -> list[str]:
    """What a reader must know of how the readings were used."""
    notes = []
    if setup.settling_s:
        notes.append(
            f"Loads were put on by hand: readings are left out for {setup.settling_s:.1f} s after each change, because "
            "they differ from one time to the next by more than their noise."
        )
    if setup.average > 1:
        notes.append(f"Readings are averaged over {setup.average} samples.")
    if setup.steady_points:
        notes.append("The recordings are steady points: nothing that takes time can be seen in them.")
    return notes


def improved(vehicle: Vehicle, values: dict[str, tuple[float, float]]) -> Vehicle:
    """The vehicle with values changed."""
    changed = changed_vehicle(vehicle, {k: v[0] for k, v in values.items() if not k.startswith("gain")})
    gain = [1.0 + sum(v[0] for k, v in values.items() if k in ("gain", f"gain_{a}")) for a in "xyz"]
    return changed if gain == [1.0, 1.0, 1.0] else changed.model_copy(update={"reading_gain": tuple(gain)})


def _make_traces(model: ReadingModel, refitted: Fit, fit: Fit):
    """Traces, and residuals (n, 6) of every part as believed, and with what is delivered."""
    before = [np.nan_to_num(r.y) for r in model.rows]
    again, after = ([np.nan_to_num(x) for x in residuals_of(model, f)] for f in (refitted, fit))
    traces = [
        ChannelTrace(r.run, CHANNELS[c], UNITS[c], r.time_s, y[:, c], values[:, c], left[:, c], left[:, c])
        for r, y, values, left in zip(model.rows, before, again, after, strict=True)
        for c in model.setup.instrument.channels
    ]
    return tuple(traces), before, after


def _on_every_run(model: ReadingModel, chain: ChainResult | None, unseen: RecordingSet) -> ReadingModel:
    """The model with the rows of every run: those fitted as they were, those held out by the same equations.

    Where only commands are known, `chain` says how the rotors turn.
    """
    setup, own = unseen_loadings(model.setup, unseen, chain)
    kept = [t for t in model.terms if t.kind != "effect" or t.key in model.selection.active]
    cols, width = model.regression.columns([t.key for t in kept]), model.rows[0].x.shape[2]
    rows = []
    for part in rows_of(model.setup, kept, own, whole_reading(model.terms, model.selection.active)):
        x = np.zeros((*part.y.shape, width))
        x[:, :, cols] = part.x
        rows.append(Rows(part.run, part.time_s, part.y, x))
    return replace(model, setup=setup, loadings=(*model.loadings, *own), rows=[*model.rows, *rows])


def reading_findings(model: ReadingModel) -> list[Finding]:
    """Findings of the terms of a reading, each with the channels that it shows in, the strongest first."""
    fit, search, active = model.selection.fit, model.search, model.selection.active
    alternatives = {key: search.alternatives(key, active) for key in active}
    together = _with_alternatives(model, {i for others in alternatives.values() for i in others})

    # A channel counts where the contribution is at least this share of its strongest, in units of the noise.
    shows = 0.33

    def report_of(key: str):
        size = search.ask.sizes_of(key, fit.beta[fit.places(model.regression.columns([key]))])
        order = np.argsort(-size)
        channels = tuple(CHANNELS[c] for c in order if size[c] > shows * size[order[0]])
        return active_values(model, key), _parameters_of(model, key, together), channels, alternatives[key]

    return findings_of(search, model.selection, report_of)


def _with_alternatives(model: ReadingModel, ids: Collection[str]) -> list[Fit]:
    """The model with each id that explains the same as one at work next to it: both may be at work.

    A displaced sensor and a displaced centre of mass move the weight alike, and the thrust not: a model with one of
    them gives it the sum, and pays for the thrust with unequal rotors.
    """
    search, selection = model.search, model.selection
    always = kept_values(search, selection.active)
    taken = {search.terms[k].effect for k in selection.active}
    fits = []
    for effect in sorted(set(ids) - taken):
        terms = [t for t in search.terms.values() if t.effect == effect and t.kind == "effect" and not t.run]
        if not terms:
            continue
        worth = search.worth_with([*selection.active], terms)
        best = terms[int(np.argmax(worth))]
        fits.append(model.regression.fit([*always, *selection.active, best.key]))
    return fits


def _parameters_of(model: ReadingModel, key: str, together: Iterable[Fit] = ()) -> tuple[Estimate, ...]:
    """Parameters of a term at work with 95 % intervals, which hold what it has in each of the fits `together`, too."""
    term = model.search.terms[key]
    if not term.form.nonlinear:
        regression, fit = model.regression, model.selection.fit
        stated = estimates(regression, fit, model.search, key)
        for other in together:
            wider = estimates(regression, fit, model.search, key, other)
            stated = tuple(
                replace(a, low=min(a.low, b.low), high=max(a.high, b.high)) for a, b in zip(stated, wider, strict=True)
            )
        return stated
    values, sd = active_values(model, key), nonlinear_deviation(model, key)
    reach = 1.96
    return tuple(
        Estimate(p.symbol, float(v), p.unit, float(v - reach * s), float(v + reach * s))
        for p, v, s in zip(term.form.parameters, values, sd, strict=True)
    )


def with_plainer_forms(model: ReadingModel, loadings: tuple[Loading, ...] | None) -> ReadingModel:
    """The model with a plainer form of the same id wherever all numbers of a form may be nothing.

    A form of two time constants explains more than one of one and says nothing of either. The search is run once more
    without it; `loadings` are those of `first_model`.
    """
    for key in list(model.selection.active):
        term = model.search.terms[key]
        if term.effect in UNKNOWNS or key not in model.selection.active:
            continue
        alike = [t for t in model.terms if t.kind == "effect" and t.effect == term.effect]
        others = {t.key for t in alike if len(t.form.parameters) >= len(term.form.parameters)}
        if len(others) == len(alike):
            continue
        if rules.PLAINER_FORM(all(p.low <= 0.0 <= p.high for p in _parameters_of(model, key))):
            terms = [t for t in model.terms if t.key not in others]
            active = [k for k in model.selection.active if k not in others]
            model = fitted_model(model.setup, terms, active, loadings, model.search.refused)
    return model


def hats(values: np.ndarray) -> np.ndarray:
    """Hat functions at KNOTS of values (n,) between 0 and 1, (n, 4): they add up to one."""
    knots = (0.0, 1 / 3, 2 / 3, 1.0)  # Where the hat functions stand, as shares of the largest.
    return np.stack([np.interp(values, knots, row) for row in np.eye(len(knots))], axis=1)


def _freed(model: ReadingModel, key: str, beta: np.ndarray, channels: list[int]) -> list[np.ndarray]:
    """Columns of a term's free form on the rows of every part, (n, 6, m), apart in each of the channels."""
    late_rows = (1, 2, 4, 8)  # Rows by which a free form may also be late.
    cols = model.regression.columns([key])
    parts = [r.x[:, :, cols] @ beta for r in model.rows]
    own_largest = np.maximum(np.max([np.abs(p).max(axis=0) for p in parts], axis=0), 1e-300)
    groups = [g for g in ([0, 1, 2], [3, 4, 5]) if set(g) & set(model.setup.instrument.loaded)]
    largest = np.array(model.setup.instrument.largest)
    out = []
    for part, load in zip(parts, _loads_of_rows(model), strict=True):
        gains = [np.ones((len(part), 1))]
        for g in groups:
            size = np.linalg.norm(load[:, g], axis=1) / np.linalg.norm(largest[g])
            gains.append(hats(np.minimum(size, 1.0))[:, 1:])
        block = []
        for c in channels:
            own = part[:, c, None]
            late = [np.concatenate([own[:1].repeat(min(rows, len(own)), axis=0), own[:-rows]]) for rows in late_rows]
            shapes = [own * g for g in (*gains, hats(np.abs(own[:, 0]) / own_largest[c])[:, 1:-1])]
            columns = np.concatenate([*shapes, np.gradient(own, axis=0), *late], axis=1)
            block.append(np.eye(6)[c][None, :, None] * columns[:, None, :])
        out.append(np.concatenate(block, axis=2))
    return out


def _with_free(model: ReadingModel, keys: list[str], free: list[np.ndarray]) -> Regression:
    """The regression of some terms with the columns of a free form, key FREE, added."""
    regression = model.regression
    kept = [t for t in regression.terms if t.key in keys or t.kind != "effect"]
    cols = regression.columns([t.key for t in kept])
    size = free[0].shape[2]
    term = Term(_FREE, "nuisance", size=size, prior_sd=(np.inf,) * size)
    rows = [
        Rows(r.run, r.time_s, r.y, np.concatenate([r.x[:, :, cols], f], axis=2))
        for r, f in zip(model.rows, free, strict=True)
    ]
    return regression_of(model.setup, rows, [*kept, term], regression.filters)


def _left_of(model: ReadingModel, value: str, strong: str, active: list[str], channels: list[int]) -> float:
    """Share of what a believed value explains that remains given a free form of `strong`; 0 if it is not significant.

    The value is as free as one that is called wrong.
    """
    fit, loose = model.regression.fit([*model.search.always, *active]), {value: WIDEST_TRUST}
    small = _with_free(model, active, _freed(model, strong, coefficients(model.regression, fit, strong)[0], channels))
    every = [*model.search.always, *active]
    rest = [k for k in every if k != value]
    with_it = small.fit([_FREE, *every], loose=loose)
    if small.wald(with_it, small.columns([value]), int(small.training.sum())) > KEEP_P:
        return 0.0
    before = small.fit(every, loose=loose).gain - small.fit(rest).gain
    return float((with_it.gain - small.fit([_FREE, *rest]).gain) / max(before, 1e-9))


def _stronger_ones(model: ReadingModel, value: str, active: list[str]) -> list[tuple[str, list[int]]]:
    """Terms at work that by themselves explain far more than a believed value adds to them, with the channels they
    share.

    Not by the sizes in the fit: two that make up for each other's form are both large.
    """
    search, regression, loose = model.search, model.regression, {value: WIDEST_TRUST}

    def size(key, fit):
        return search.ask.sizes_of(key, coefficients(regression, fit, key)[0])

    def gain(*keys):
        return regression.fit(list(keys), loose=loose if value in keys else None).gain

    every = [*search.always, *active]
    fit, own = regression.fit(every), size(value, regression.fit(every, loose=loose))
    out = []
    for other in active:
        effect = search.terms[other].effect
        if effect in UNKNOWNS or catalogue()[effect].exact:
            continue
        rest = [k for k in (*search.always, *active) if k not in (value, other)]
        explained, added = gain(*rest, other) - gain(*rest), gain(*rest, other, value) - gain(*rest, other)
        if gain(*rest, other) < gain(*rest, value) or added > _MOST_SHARE * explained:
            continue
        shared = [c for c in model.setup.instrument.channels if size(other, fit)[c] > own[c] * SHARE_OF_LARGEST]
        if shared:
            out.append((other, shared))
    return out


def _needless_values(model: ReadingModel, values: Iterable[str]) -> set[str]:
    """Of believed values that seem wrong those that only make up for the form of an effect at work.

    Also those that a form's own parameters say again: another power of the speed has no C_F to believe.
    """
    active = model.selection.active
    settled = {v for k in active for v in model.search.terms[k].form.takes_up}
    out = settled & set(values)
    # Any smooth characteristic has a slope of its own: of gains the curve itself is asked (`curved_gain`).
    for key in (v for v in set(values) - settled if not v.startswith(_GAIN)):
        if any(_left_of(model, key, s, active, c) < _MOST_SHARE for s, c in _stronger_ones(model, key, active)):
            out.add(key)
    return out if rules.NEEDLESS_VALUE(bool(out)) else set()


def _curved_gains(model: ReadingModel, values: Values) -> set[str]:
    """Gains called wrong given a curved characteristic that is right at small loads, or right over all of them.

    The gain of a curve is a convention: a reading that saturates is right at small loads, one with a dead band nearly
    so over all, and the slope that a polynomial has at no load is neither. A wrong calibration is off in both. A
    structure that gives way curves the reading of its own axis as a sensor does.
    """
    small_loads = 0.3  # Share of the largest load up to which a load is small.
    instrument = model.setup.instrument
    if not any(model.search.terms[k].effect in _curving() for k in model.selection.active):
        return set()
    out = set()
    for key, (change, _) in values.items():
        of_key = [c for c in instrument.loaded if c < 3 and key in ("gain", f"gain_{'xyz'[c]}")]
        for share in (small_loads, 1.0) if of_key else ():
            # Channels may curve to either side: what they have in common is the gain.
            slope = np.mean([_slope_of(model, c, share * instrument.largest[c]) for c in of_key])
            if np.sign(change) * slope < SMALLEST_CHANGE:
                out.add(key)
    return out if rules.CURVED_GAIN(bool(out)) else set()


def _curving() -> frozenset[str]:
    """Ids that curve a reading over its own load: a sensor's curves, and what of a rig is confused with them."""
    sensor = ids_of("curve_of_load") & ids_of("kind", "sensor")
    return sensor | {e.id for e in catalogue().values() if e.of_the_rig and sensor & set(e.confusers)}


def _slope_of(model: ReadingModel, channel: int, most: float) -> float:
    """Slope, less one, of a reading over loads up to `most` in size, less all effects that do not curve it."""
    fit, search = model.selection.fit, model.search
    others = [k for k in model.selection.active if search.terms[k].effect not in _curving()]
    known = np.isin(fit.columns, model.regression.columns(others))
    load, left = [], []
    for rows, loads in zip(model.rows, _loads_of_rows(model), strict=True):
        used = np.abs(loads[:, channel]) < most
        load.append(loads[used, channel])
        left.append((rows.y[:, channel] - rows.x[:, channel][:, fit.columns[known]] @ fit.beta[known])[used])
    columns = np.stack([np.concatenate(load), np.ones(sum(map(len, load)))], axis=1)
    return float(np.linalg.lstsq(columns, np.concatenate(left), rcond=1e-9)[0][0])


def _loads_of_rows(model: ReadingModel) -> list[np.ndarray]:
    """Loads (n, 6) of every part that has rows, in their order."""
    count = model.setup.average
    return [averaged(x.load, count)[p] for x in model.loadings for p in pieces_of(x, count)]
