"""From a recording set to what is off in it: the whole analysis in its order.

1. mistakes in the set, 2. what lies between command and rotor speed, 3. the grouped search over force, moment and
sensor effects with the believed values free, 4. refinement of nonlinear parameters and of the wind, 5. a word on
each id: established, ambiguous, absorbed or not established.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form
from rotorid.effects.thrust_curve import SQUARE
from rotorid.mismatch import within_trust
from rotorid.mismatch.decide import SMALLEST_CHANGE, VALUE_Z, exchangeable, wrench_findings, wrong_values
from rotorid.mismatch.dependence import dependence
from rotorid.mismatch.findings import Analysis, Estimate, Finding, Trace
from rotorid.mismatch.gusts import gust_finding, with_gusts
from rotorid.mismatch.harmless import REASON as HARM
from rotorid.mismatch.harmless import (
    Values,
    believed_residuals,
    held_out_masks,
    residuals_of,
    without_harm,
    without_useless,
)
from rotorid.mismatch.leftover import leftover
from rotorid.mismatch.mistakes import find_mistakes
from rotorid.mismatch.motion import full_speed, stretches
from rotorid.mismatch.next_flight import next_flight
from rotorid.mismatch.prepare import Prepared, prepare
from rotorid.mismatch.regime import regime_variables
from rotorid.mismatch.rows import CHANNELS, PARAMETER_NAMES, RUN_SCALE, Term
from rotorid.mismatch.select import COST_PER_EFFECT, COST_PER_PARAMETER, Selection
from rotorid.mismatch.speedpath import SpeedFit, SpeedResult, commanded_path, nothing_between, taken_back
from rotorid.mismatch.unknowns import UNKNOWNS
from rotorid.mismatch.within_trust import beyond_trust, settled
from rotorid.mismatch.wrench import (
    WrenchModel,
    after_residual,
    chosen,
    nonlinear_intervals,
    path_segments,
    refine_nonlinear,
    reverse_regression,
    speed_path,
    with_wind,
    wrench_model,
)
from rotorid.recordings import RecordingSet, Vehicle, columns

ABSORBED_P = 1e-6
RUN_P = 1e-6
RUN_SPREAD = 0.007
"""Relative spread of the thrust coefficient between runs below which one number serves all."""
RUN_TRUST = 0.02
"""Relative one-sigma of a run's own thrust about the common one."""
UNITS = {"force": "N", "moment": "N m"}
SURELY_HEAVIER = 2.0
"""Standard errors by which a vehicle must be heavier than believed to carry a payload."""
NEEDS_COMMAND = ("motor_lag", "throttle_curve", "battery_sag", "command_saturation")
IN_QUESTION = {"payload": {"mass", "thrust"}, "throttle_curve": {"thrust", "torque", "speed"}}
"""Values that an id would change by itself; thrust in a payload's is its ratio to the mass."""


def analyse(recordings: RecordingSet, cutoff_hz: float = 20.0) -> Analysis:
    """The whole analysis of a set of kind `flight`."""
    recordings, mistakes, remarks = find_mistakes(recordings)
    prepared = prepare(recordings, cutoff_hz)
    notes = [*remarks]
    findings = list(mistakes)
    reasons = dict(prepared.not_testable)
    measured = all(s.measured_speed for s in prepared.segments)

    found = speed_path(prepared)
    segments, noisy = prepared.segments, prepared.noisy_segments
    if found is not None and not measured:
        cutoff = prepared.thinner.cutoff_hz
        segments = path_segments(segments, *found, cutoff)
        noisy = path_segments(noisy, *found, cutoff)
    model = refined_model(prepared, segments, noisy)
    if found is not None and not measured and model.selection.active:
        # The wrench effects found change what the commands must explain: once more with them known.
        found = speed_path(prepared, chosen(model))
        segments = path_segments(prepared.segments, *found, cutoff)
        noisy = path_segments(prepared.noisy_segments, *found, cutoff)
        model = refined_model(prepared, segments, noisy)
    if found is not None and not measured and [k for k, _ in found[0].fit.chain] == ["throttle_curve"]:
        # A curve alters differences between rotors too: unequal rotors at one throttle look like one.
        plain = refined_model(prepared, prepared.segments, prepared.noisy_segments)
        # A thrust curve in its place is the same column over again, with the torque's share left to a wrong value.
        renamed = any(plain.search.terms[k].effect == "thrust_curve" for k in plain.selection.active)
        limit = cost_of(model, model.regression.filters) + curve_cost(found[0])
        if not renamed and cost_of(plain, model.regression.filters) < limit:
            segments, noisy, model = prepared.segments, prepared.noisy_segments, plain
            found = (nothing_between(found[0]), *found[1:])

    commanded = found is not None and not measured
    model, values, values_of, harm = without_harm(prepared, model, values_called_wrong, commanded)
    if harm and commanded and found[0].fit.chain:
        # Fitted with every value free, a curve of the throttle may need values that nothing else bears out.
        for result in taken_back(found[0], HARM):
            found = (result, *found[1:])
            segments, noisy = prepared.segments, prepared.noisy_segments
            if result.fit.chain:
                segments, noisy = (path_segments(s, *found, cutoff) for s in (segments, noisy))
            model = refined_model(prepared, segments, noisy)
            model, values, values_of, harm = without_harm(prepared, model, values_called_wrong, commanded)
            if not harm:
                break
    model, values = without_useless(prepared, model, values, values_of)

    segments, noisy = model.segments, model.noisy_segments
    if model.wind is not None:
        findings.append(wind_finding(model))
    if model.gusts:
        findings.append(gust_finding(model.gusts))
    if found is None:
        reasons.update({k: "no rotor commands recorded" for k in NEEDS_COMMAND})
    else:
        findings += speed_findings(found[0], prepared, measured, found[1])
        if found[2] is None:
            reasons.setdefault("battery_sag", "no battery voltage")
    findings += wrench_findings(
        model.rows,
        model.search.regression,
        model.search,
        model.selection,
        model.noise,
        held_out_masks(prepared, model, segments),
        nonlinear_intervals(prepared, model, segments),
        values,
    )

    if found is not None and not measured:
        findings = [throttle_or_thrust(f) for f in findings]

    scale: dict[str, tuple[float, float, float, float]] = {}
    told = values
    if only_throttle(recordings):
        told = speed_for_coefficients(values, prepared.vehicle)
        if prepared.vehicle.rotor_speed_limits_rad_s is None:
            told, scale = throttle_scale(values, model, full_speed(recordings.runs, prepared.vehicle))
    fit, moved = settled(prepared, model, values, model.selection.active)
    findings = rectified(payload_or_offset(findings, {**moved, **values}))
    findings += absorbed_findings(model, values, findings)
    plain_values = {}
    if model.wind is None:
        nothing = Selection([], model.selection.fit)
        plain_values = wrong_values(model.search.regression, model.search, nothing, None, size_of_value(model))
    plain_fit, plainly = settled(prepared, model, plain_values, ())
    refitted = changed_vehicle(prepared.vehicle, {k: v[0] for k, v in {**plainly, **plain_values}.items()})
    improved = changed_vehicle(prepared.vehicle, {k: v[0] for k, v in {**moved, **told}.items()})
    for _, full, _, _ in scale.values():
        improved = improved.model_copy(update={"rotor_speed_limits_rad_s": (0.0, full)})
    notes += run_scale_notes(model)
    if found is not None and found[0].lag_alone is not None:
        notes.append(lag_alone_note(found[0].lag_alone))
    delivered = residuals_of(model, fit)
    traces = make_traces(prepared, model, found, measured, residuals_of(model, plain_fit), delivered)
    findings, told = with_square_term(findings, told, model)
    told = without_values_in_question(findings, told)
    if commanded and any(f.id == "battery_sag" and f.status in ("established", "ambiguous") for f in findings):
        # At which voltage the believed values hold is not stated: the largest in the set is only a guess.
        told = without_common_scale(told)
    before, after, depends = dependence(prepared, model, segments, noisy)
    strained = beyond_trust(model, values, model.selection.active)
    claimed = bool(values) or any(f.status in ("established", "ambiguous") for f in findings)
    left = leftover(prepared, model, segments, noisy, after, depends, delivered if strained else None, claimed)
    findings = together(findings)
    fly = next_flight(findings, prepared, model.noise)
    known = {f.id for f in findings if f.status in ("established", "ambiguous")}
    return Analysis(
        recordings=recordings,
        split=prepared.split,
        believed=prepared.vehicle,
        refitted=refitted,
        improved=improved,
        findings=tuple(findings),
        values={**contract_values(prepared.vehicle, told), **scale},
        not_testable={k: v for k, v in reasons.items() if k not in known},
        traces=traces,
        noise_floor=noise_floors(prepared, model, found, measured),
        p_values={c: (before[c], after[c]) for c in before},
        regimes=regimes_by_run(segments, prepared),
        unexplained_share=left.share,
        unexplained_channels=left.channels,
        unexplained_depends_on=left.depends_on,
        unexplained_description=left.description,
        next_manoeuvre=fly.manoeuvre,
        next_separates=fly.separates,
        next_sigma=fly.sigma,
        force_source=segments[0].force_source,
        notes=tuple(notes),
        instead=instead_of(model, values),
        put_right=within_trust.in_words(moved),
    )


def size_of_value(model: WrenchModel) -> Callable[[str, float], float]:
    """Function of a value and its relative change that gives the change's size in units of the noise."""

    def size(key: str, change: float) -> float:
        return float(model.search.sizes_of(key, np.array([change])).max())

    return size


def values_called_wrong(model: WrenchModel, refused: Sequence[str]) -> Values:
    """Believed values that the model's recordings contradict, less those refused."""
    reverse, search = reverse_regression(model.prepared, model, model.segments), model.search
    size = size_of_value(model)
    return wrong_values(search.regression, search, model.selection, reverse, size, refused=refused)


def instead_of(model: WrenchModel, values: Values) -> dict[str, tuple[str, ...]]:
    """Contract name of a wrong value to others, in words, that would explain as much in its place."""
    found = exchangeable(model.search.regression, model.selection, values)
    return {PARAMETER_NAMES[key]: within_trust.in_words(others) for key, others in found.items()}


def refined_model(prepared: Prepared, segments, noisy) -> WrenchModel:
    """The search, then nonlinear parameters refined and the search repeated from there."""
    model = wrench_model(prepared, prepared.terms, segments=segments, noisy_segments=noisy)
    terms = list(prepared.terms)
    if thrust_differs(model):
        terms = with_run_scales(terms, prepared)
        model = wrench_model(prepared, terms, segments=segments, noisy_segments=noisy)
    for _ in range(2 if any(changes_its_columns(model.search.terms[k].form) for k in model.selection.active) else 0):
        refined = refine_nonlinear(prepared, model, segments)
        terms = [replace(t, values=tuple(refined[t.key])) if t.key in refined else t for t in terms]
        again = wrench_model(prepared, terms, chosen(model), model.selection.active, segments, noisy)
        same = set(again.selection.active) == set(model.selection.active)
        model = again
        if same:
            break
    model = with_wind(prepared, model, segments, noisy, terms)
    if model.wind is not None:
        terms = list(model.terms)
    return with_gusts(prepared, model, terms)


def changes_its_columns(form: Form) -> bool:
    """Whether a form's columns hang on what the model holds: nonlinear parameters, or the accelerations predicted."""
    return bool(form.nonlinear) or not {"angular_acceleration", "specific_force"}.isdisjoint(form.requires)


def thrust_differs(model: WrenchModel) -> bool:
    """Whether the thrust coefficient is not the same in every run, beyond doubt and by more than RUN_SPREAD."""
    if "thrust" not in model.search.terms or not all(s.measured_speed for s in model.prepared.segments):
        return False
    regression = model.search.regression
    fit = regression.fit(model.search.always + model.selection.active)
    spread, p = regression.between_runs(fit, "thrust")
    runs = len(np.unique(regression.run[regression.training]))
    return p < RUN_P and float(np.sqrt(spread[0] * runs)) > RUN_SPREAD


def lag_alone_note(fit: SpeedFit) -> str:
    """The lag as others state it, who fit neither a delay nor a throttle curve beside it."""
    tau, reach = float(fit.values[0]), 1.96 * float(np.sqrt(fit.covariance[0, 0]))
    return (
        "The lateness of the rotors is shared by a lag and what was found beside it; a lag alone would be "
        f"{1000 * tau:.0f} ms ({1000 * (tau - reach):.0f} to {1000 * (tau + reach):.0f} ms)."
    )


def run_scale_notes(model: WrenchModel) -> list[str]:
    """What was done about a thrust that differs between runs."""
    regression = model.search.regression
    terms = [t for t in regression.terms if t.key.startswith(RUN_SCALE)]
    if not terms:
        return []
    fit = regression.fit(model.search.always + model.selection.active)
    found = [fit.beta[fit.columns == regression.start[t.key]][0] for t in terms]
    parts = ", ".join(f"{t.run} {100 * b:+.1f} %" for t, b in zip(terms, found, strict=True))
    return [f"The thrust coefficient is not the same in every run; each has its own scale ({parts})."]


def with_run_scales(terms: list[Term], prepared: Prepared) -> list[Term]:
    """Terms with a thrust scale for each run: air density, other propellers, a tachometer's own error."""
    runs = dict.fromkeys(s.run for s in prepared.segments)
    return [*terms, *(Term(f"{RUN_SCALE}{r}", "nuisance", prior_sd=(RUN_TRUST,), run=r) for r in runs)]


def cost_of(model: WrenchModel, filters: dict[int, np.ndarray]) -> float:
    """Whitened squares that a model leaves, and what its ids and parameters cost."""
    left = 0.0
    for part in after_residual(model):
        for channel, taps in filters.items():
            left += float((lfilter(taps, [1.0], part[:, channel])[len(taps) :] ** 2).sum())
    terms = [model.search.terms[k] for k in model.selection.active]
    return left + sum(COST_PER_EFFECT + COST_PER_PARAMETER * t.size for t in terms)


def curve_cost(result: SpeedResult) -> float:
    """What the forms between command and rotor speed cost."""
    return sum(COST_PER_EFFECT + COST_PER_PARAMETER * len(form.parameters) for _, form in result.fit.chain)


def wind_finding(model: WrenchModel) -> Finding:
    """The steady wind as a velocity, fitted through the drag."""
    effect = catalogue()["steady_wind"]
    w, sd = model.wind, model.wind_sd
    drag = next(
        (v for k, v in zip(model.selection.active, chosen(model), strict=True) if k.startswith("rotor_drag/")), None
    )
    form = next(f for f in effect.forms(model.prepared.vehicle) if f.name == "on the rotors")
    k_d = 0.0 if drag is None or "independent" in drag[0].name else float(np.mean(drag[1]))
    return Finding(
        id="steady_wind",
        status="established",
        form=form if k_d else None,
        values=tuple(float(k_d * x) for x in w),
        equation="v_air = v − Rᵀ w",
        sentence="the vehicle flew through air that moves over the ground",
        parameters=tuple(
            Estimate(f"w_{axis}", float(x), "m/s", float(x - 1.96 * s), float(x + 1.96 * s))
            for axis, x, s in zip(("north", "east"), w, sd, strict=True)
        ),
        p_value=float(np.exp(-0.5 * min(1400.0, np.sum((w / sd) ** 2)))),
        channels=("force_x", "force_y"),
    )


def speed_findings(result: SpeedResult, prepared: Prepared, measured: bool, full_speed: float) -> list[Finding]:
    """Findings between command and rotor speed."""
    effects = catalogue()
    out = []
    channels = tuple(f"rotor_speed_{i + 1}" for i in range(prepared.vehicle.rotor_count)) if measured else ("force_z",)
    for key, form in result.fit.chain:
        where = result.fit.slice_of(key)
        values = result.fit.values[where]
        sd = np.sqrt(np.diag(result.fit.covariance)[where])
        parameters = tuple(
            Estimate(p.symbol, float(v), p.unit, float(v - 1.96 * s), float(v + 1.96 * s))
            for p, v, s in zip(form.parameters, values, sd, strict=True)
        )
        alternatives = result.alternatives[key]
        beyond = ()
        if key == "command_saturation":
            beyond = saturation_windows(prepared.segments, values[0] * full_speed, form.name == "upper limit")
        out.append(
            Finding(
                id=key,
                status="ambiguous" if alternatives else "established",
                values=tuple(float(v) for v in values),
                equation=form.equation,
                sentence=effects[key].sentence,
                parameters=parameters,
                p_value=result.p_values[key],
                channels=channels,
                alternatives=tuple(sorted({key, *alternatives})) if alternatives else (),
                windows=beyond,
            )
        )
    for key, reason in result.dropped.items():
        if key not in {f.id for f in out}:
            out.append(
                Finding(id=key, status="not_established", sentence=f"{effects[key].name} did not hold: {reason}")
            )
    return out


def rectified(findings: list[Finding]) -> list[Finding]:
    """An error of the accelerometer beside a vibration is what the sensor makes of the vibration."""
    if not any(f.id == "vibration" for f in findings):
        return findings
    why = "an error of the accelerometer did not hold: a vibration that the sensor rectifies looks the same"
    held = ("established", "ambiguous")
    return [
        Finding(id=f.id, status="not_established", sentence=why)
        if f.id == "accelerometer_error" and f.status in held
        else f
        for f in findings
    ]


def payload_or_offset(findings: list[Finding], values: dict) -> list[Finding]:
    """A centre of mass off its place on a vehicle that is heavier than believed may be a payload as well.

    The payload would bring products of inertia along: found beside such an offset they belong to the same question.
    """
    sure = {key: change for key, (change, sd) in values.items() if abs(change) > SURELY_HEAVIER * sd}
    heavier = sure.get("mass", 0.0) > 0 or sure.get("thrust", 0.0) < 0
    stated = [f for f in findings if f.status in ("established", "ambiguous")]
    offset = next((f for f in stated if "com_offset" in (f.id, *f.alternatives)), None)
    if offset is None or not heavier:
        return findings
    out = []
    for f in findings:
        if f is offset or (f.id == "inertia_products" and f in stated):
            f = replace(f, status="ambiguous", alternatives=tuple(sorted({f.id, "payload", *f.alternatives})))
        out.append(f)
    return out


def with_square_term(findings: list[Finding], values: dict, model: WrenchModel) -> tuple[list[Finding], dict]:
    """Beside a thrust curve the coefficient of its square is the curve's own parameter c_2, and no wrong value.

    C_F and what the curve adds to it trade off against each other; their sum is what the recording knows.
    """
    curve = next((f for f in findings if f.id == "thrust_curve" and f.status in ("established", "ambiguous")), None)
    key = next((k for k in model.selection.active if model.search.terms[k].effect == "thrust_curve"), None)
    if curve is None or key is None:
        return findings, values
    fit, coefficient = model.selection.fit, believed_value(model.prepared.vehicle, "thrust")
    share = np.zeros(len(fit.columns))
    share[fit.columns == model.regression.start["thrust"]] = coefficient
    symbols = [curve.form.parameters[i].symbol for i in curve.form.linear]
    if SQUARE in symbols:
        share[fit.columns == model.regression.start[key] + symbols.index(SQUARE)] = 1.0
    elif "thrust" not in values:
        return findings, values
    value, sd = coefficient + share @ fit.beta, np.sqrt(share @ fit.covariance @ share)
    square = Estimate("c_2", float(value), "N s2/rad2", float(value - 1.96 * sd), float(value + 1.96 * sd))
    told = replace(curve, parameters=(*(p for p in curve.parameters if p.symbol != SQUARE), square))
    return [told if f is curve else f for f in findings], {k: v for k, v in values.items() if k != "thrust"}


def without_values_in_question(findings: list[Finding], values: dict) -> dict:
    """Values less those that would be right, or others, if another member of an open class were at work."""
    members = {i for f in findings if f.status == "ambiguous" for i in f.alternatives}
    open_values = {key for i, keys in IN_QUESTION.items() if i in members for key in keys}
    return {k: v for k, v in values.items() if k not in open_values}


def only_throttle(recordings: RecordingSet) -> bool:
    """Whether rotor speeds are known from the throttle and a believed full speed alone."""
    count = recordings.vehicle.rotor_count
    return all(
        run.has(*columns.rotor_columns("throttle", count))
        and not run.has(*columns.rotor_columns("rotor_command", count))
        and not run.has(*columns.rotor_columns("rotor_speed", count))
        for run in recordings.runs
    )


def speed_for_coefficients(values: dict, vehicle: Vehicle) -> dict:
    """Thrust and torque coefficients off by one factor are one speed at full throttle off by its root."""
    if not {"thrust", "torque"} <= set(values) or vehicle.rotor_speed_limits_rad_s is None:
        return values
    (thrust, thrust_sd), (torque, torque_sd) = values["thrust"], values["torque"]
    if abs(thrust - torque) > 2.0 * np.hypot(thrust_sd, torque_sd) + 0.005:
        return values
    weight = 1.0 / np.square([thrust_sd, torque_sd])
    change = float(weight @ [thrust, torque] / weight.sum())
    factor = np.sqrt(1.0 + change)
    rest = {k: v for k, v in values.items() if k not in ("thrust", "torque")}
    return {**rest, "speed": (float(factor - 1.0), float(0.5 / factor / np.sqrt(weight.sum())))}


def throttle_scale(values: Values, model: WrenchModel, full_rad_s: float):
    """Values less what only says how fast rotors turn at full throttle, and that speed, which nobody stated.

    The scale of the throttle rests on the believed thrust coefficient and mass: it is known as well as they are.
    """
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    full = full_rad_s * float(np.sqrt(1 + values.get("thrust", (0.0, 0.0))[0]))
    reach = 1.96 * full * 0.5 * float(np.hypot(trust.get("thrust", 0.0), trust.get("mass", 0.0)))
    return without_common_scale(values), {PARAMETER_NAMES["speed"]: (float("nan"), full, full - reach, full + reach)}


def without_common_scale(values: Values) -> Values:
    """Values where the scale of the rotors' speed is not known: a thrust, and a torque less its part in the scale."""
    (thrust, thrust_sd), (torque, torque_sd) = (values.get(k, (0.0, 0.0)) for k in ("thrust", "torque"))
    kept = {k: v for k, v in values.items() if k not in ("thrust", "torque", "speed")}
    change, sd = (1 + torque) / (1 + thrust) - 1, float(np.hypot(thrust_sd, torque_sd))
    if "torque" in values and abs(change) > max(VALUE_Z * sd, SMALLEST_CHANGE):
        kept["torque"] = (change, sd)
    return kept


def throttle_or_thrust(finding: Finding) -> Finding:
    """Where no rotor speed is measured, a thrust curve and a throttle curve are one and the same column."""
    if finding.id != "thrust_curve" or finding.status not in ("established", "ambiguous"):
        return finding
    both = tuple(sorted({"thrust_curve", "throttle_curve", *finding.alternatives}))
    return replace(finding, status="ambiguous", alternatives=both)


def absorbed_findings(model: WrenchModel, values: dict, findings: list[Finding]) -> list[Finding]:
    """Effects that look significant while the wrong values are held at their belief, and vanish with them."""
    if not values:
        return []
    search, regression = model.search, model.search.regression
    held = [k for k in search.always if k not in values]
    base = regression.fit(held + model.selection.active)
    taken = {f.id for f in findings}
    out: dict[str, Finding] = {}
    for term in regression.terms:
        if term.kind != "effect" or term.effect in taken or term.effect in out or term.effect in UNKNOWNS:
            continue
        fit = regression.fit([*held, *model.selection.active, term.key])
        p = regression.wald(fit, regression.columns([term.key]), search.blocks)
        if p < ABSORBED_P and fit.gain - base.gain > 50:
            name = catalogue()[term.effect].name
            out[term.effect] = Finding(
                id=term.effect,
                status="absorbed",
                sentence=f"{name} looked significant with the believed values; the refitted values explain it",
                p_value=p,
            )
    return list(out.values())


def contract_values(vehicle: Vehicle, values: dict) -> dict[str, tuple[float, float, float, float]]:
    """Wrong values under the names of vehicle.yaml: believed, refitted and its interval."""
    out = {}
    for key, (relative, sd) in values.items():
        believed = believed_value(vehicle, key)
        out[PARAMETER_NAMES[key]] = tuple(
            float(believed * (1 + x)) for x in (0.0, relative, relative - 1.96 * sd, relative + 1.96 * sd)
        )
    return out


def believed_value(vehicle: Vehicle, key: str) -> float:
    """The number that a value's name stands for (the mean over rotors of coefficients)."""
    if key == "mass":
        return vehicle.mass_kg
    if key == "thrust":
        return float(vehicle.thrust_coefficients_n_s2().mean())
    if key == "torque":
        return float(vehicle.torque_coefficients_n_m_s2().mean())
    if key == "speed":
        return vehicle.rotor_speed_limits_rad_s[1]
    if key == "arm":
        return 1.0
    return getattr(vehicle.inertia_kg_m2, key[-2:])


def changed_vehicle(vehicle: Vehicle, relative: dict[str, float]) -> Vehicle:
    """The vehicle with values changed by relative amounts."""
    change = {}
    for key, name in (("thrust", "thrust_coefficient_n_s2"), ("torque", "torque_coefficient_n_m_s2")):
        if key in relative:
            old = getattr(vehicle, name)
            factor = 1 + relative[key]
            change[name] = tuple(v * factor for v in old) if isinstance(old, tuple) else old * factor
    if "mass" in relative:
        change["mass_kg"] = vehicle.mass_kg * (1 + relative["mass"])
    inertia = {k[-2:]: 1 + v for k, v in relative.items() if k.startswith("inertia")}
    if inertia:
        old = vehicle.inertia_kg_m2
        change["inertia_kg_m2"] = old.model_copy(update={k: getattr(old, k) * f for k, f in inertia.items()})
    if "speed" in relative:
        low, high = vehicle.rotor_speed_limits_rad_s
        change["rotor_speed_limits_rad_s"] = (low, high * (1 + relative["speed"]))
    if "arm" in relative:
        f = 1 + relative["arm"]
        change["rotors"] = tuple(r.model_copy(update={"x_m": r.x_m * f, "y_m": r.y_m * f}) for r in vehicle.rotors)
    return vehicle.model_copy(update=change)


def make_traces(
    prepared, model: WrenchModel, found, measured: bool, refitted: list[np.ndarray], delivered: list[np.ndarray]
) -> tuple[Trace, ...]:
    """Residual of every channel before refitting, after refitting and with the effects, (n, 12) each per stretch."""
    believed_left = believed_residuals(prepared, model, found is not None and not measured)
    out = []
    parts = (model.rows, prepared.segments, believed_left, refitted, delivered)
    for r, segment, before, plain, after in zip(*parts, strict=True):
        for c in range(6):
            if np.isfinite(r.y[:, c]).all():
                unit = UNITS[CHANNELS[c].split("_")[0]]
                out.append(Trace(r.run, CHANNELS[c], unit, r.time_s, before[:, c], plain[:, c], after[:, c]))
        if found is not None and measured:
            result: SpeedResult = found[0]
            path = commanded_path(segment, result.fit.chain, result.fit.values, result.fit.shift_s, *found[1:])
            believed = prepared.thinner(segment.motion.rotor_speed - segment.command)
            left = prepared.thinner(segment.motion.rotor_speed - path)
            for i in range(believed.shape[1]):
                name = f"rotor_speed_{i + 1}"
                out.append(Trace(r.run, name, "rad/s", r.time_s, believed[:, i], believed[:, i], left[:, i]))
    return tuple(out)


def noise_floors(prepared: Prepared, model: WrenchModel, found, measured: bool) -> dict[str, float]:
    """Noise of each channel in the band of the traces: what is left where the whole catalogue is free to explain."""
    out = {CHANNELS[c]: float(model.floor[c]) for c in range(6) if np.isfinite(model.floor[c])}
    if found is not None and measured and found[0].noise_rad_s is not None:
        gain = float(np.sqrt((prepared.thinner.kernel**2).sum()))
        for i in range(prepared.vehicle.rotor_count):
            out[f"rotor_speed_{i + 1}"] = found[0].noise_rad_s * gain
    return out


def regimes_by_run(segments, prepared: Prepared) -> dict[str, dict[str, np.ndarray]]:
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


def saturation_windows(segments, limit_rad_s: float, upper: bool) -> tuple[tuple[str, float, float], ...]:
    """Stretches in which a command goes beyond a limit, closer than 0.3 s taken together."""
    out = []
    for s in segments:
        beyond = (s.command > limit_rad_s if upper else s.command < limit_rad_s).any(axis=1)
        times = s.motion.time_s
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
