"""The catalogue in words: a list, one effect in full, the page of all (`effects.md`), and what to record next."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import COLUMNS_OF, Effect, Form, Parameter, SetForm, SpeedForm
from rotorid.effects.loading import AXES, InstrumentFacts, forms_of
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet
from rotorid.recordings.vehicle import Vehicle

RECORDABLE: dict[str, tuple[str, Callable[[int], tuple[str, ...]]]] = {
    "position": ("the position", lambda rotors: c.POSITION),
    "rotor_speed": ("the rotor speeds", lambda rotors: c.rotor_columns("rotor_speed", rotors)),
    "temperature": ("the temperature", lambda rotors: (c.TEMPERATURE,)),
    "voltage": ("the battery's voltage", lambda rotors: (c.BATTERY_VOLTAGE,)),
}
"""What `Effect.separating_columns` may name: in words, and the columns of a run for a number of rotors."""
EXAMPLE = Vehicle(
    name="thesis",
    kind="flight",
    mass_kg=0.652,
    inertia_kg_m2={"xx": 2.489e-3, "yy": 2.5743e-3, "zz": 4.6838e-3},
    rotors=[
        {"x_m": 0.0884 * x, "y_m": 0.0884 * y, "spin": "ccw" if x == y else "cw"}
        for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ],
    thrust_coefficient_n_s2=1.3877e-6,
    torque_coefficient_n_m_s2=1.8558e-8,
    rotor_radius_m=0.0635,
)
"""The thesis's quadrotor: forms depend on the number of rotors, bounds on the vehicle's size."""

_ALL_CHANNELS = tuple(range(len(AXES)))
EXAMPLE_STAND = InstrumentFacts(
    vehicle=EXAMPLE.model_copy(update={"kind": "stand", "tared": False, "sensor_mount": "level"}),
    channels=_ALL_CHANNELS,
    loaded=_ALL_CHANNELS,
    rate_hz=100.0,
    duration_s=60.0,
    run_s=60.0,
    runs=("first", "second"),
    tilts=True,
    temperature=True,
    temperatures_c=(20.0, 30.0),
    session_s=200.0,
    session_clock=True,
    returns=_ALL_CHANNELS,
    distance="wall_distance_m",
)
"""A stand that shows what stands show: its forms' parameters depend on its channels, bounds on rate and duration."""

_FORCES = (0, 1, 2)
EXAMPLE_BENCH = replace(
    EXAMPLE_STAND,
    vehicle=Vehicle(name="bench", kind="bench"),
    channels=_FORCES,
    loaded=_FORCES,
    returns=_FORCES,
    tilts=False,
    distance="",
)
"""A bench with three channels of force, for the effects that a stand cannot show."""

EXCITATION = {
    "rotor_speed": "rotors that turn",
    "rotor_acceleration": "rotors that speed up or slow down",
    "angular_velocity": "turning",
    "angular_acceleration": "angular acceleration",
    "specific_force": "thrust",
    "accelerometer": "thrust",
    "velocity": "motion through the air",
    "height": "the ground's nearness",
    "always": "always there",
    "command": "any command",
    "change": "commands that change",
    "voltage": "a voltage below the largest",
    "limit": "commands beyond the limit",
    "time": "time since the start",
    "load": "any load",
    "load_change": "a load that changes",
    "tilt": "a tilted mount",
}
_KINDS = {"physics": "physics", "sensor": "sensor or logging", "mistake": "mistake in the set"}
_INTRODUCTION = """\
# The catalogue of effects

Made of the code (`rotorid effects --markdown` prints it). Symbols and axes as in the
[conventions](conventions.md): body x forward, y right, z down; v velocity through the air, Ω body rates, R attitude
(body to world), ω_i rotor speed, T_i thrust C_F ω_i², Q_i torque C_Q ω_i², r_i place of a hub, v_i = v + Ω × r_i its
velocity. The number after "catalogue" in a source is the row of the project's list of omitted physics. Ranges are
physical bounds for the thesis's quadrotor (0.652 kg, 0.125 m arms); they scale with the vehicle. Forms "on an
instrument" are those of kinds `stand` and `bench`: F is the load that the believed values predict at the sensor, y the
reading, f a frequency; their ranges are those of a stand read at 100 Hz for 60 s, in a session of 200 s between 20 °C
and 30 °C.

An effect is one file of `src/rotorid/effects/`; the forms inside one id compete. Any form can be switched on in a
vehicle file and is then simulated and recorded:

```yaml
effects:
  - {id: rotor_drag, form: at the hubs, parameters: {k_d: 6.0e-5}}
```

How they are distinguished: [the mismatch stage](mismatch.md).
"""


_FormRow = tuple[tuple[str, ...], str, tuple[Parameter, ...], tuple[str, ...], tuple[str, ...]]
"""Forms of one equation: names, equation, parameters, the columns that they need, and what they show with."""


def _columns_of(form: Form | SpeedForm | SetForm) -> tuple[str, ...]:
    """Columns of a run that a form needs (or, for a fault, spoils)."""
    if isinstance(form, SetForm):
        return tuple(dict.fromkeys(re.sub(r"\d+", "*", name) for name in form.columns))
    if isinstance(form, SpeedForm):
        needed = ["rotor_command_*_rad_s, or throttle_*"]
        return tuple(needed + [COLUMNS_OF[name] for name in form.requires])
    return tuple(dict.fromkeys(COLUMNS_OF[name] for name in form.requires))


def instrument_forms(effect: Effect) -> tuple[Form, ...]:
    """Forms that an effect has for instruments alone: a stand's, else (where a stand cannot show it) a bench's."""
    if effect.reading_forms is None:
        return ()
    return forms_of(effect, EXAMPLE_STAND) or forms_of(effect, EXAMPLE_BENCH)


def _reading_rows(effect: Effect) -> list[_FormRow]:
    """Forms of an effect on a stand or bench, those of one equation in one row."""
    found: dict[str, list[Form]] = {}
    for form in instrument_forms(effect):
        found.setdefault(form.equation, []).append(form)
    return [
        (
            tuple(form.name for form in forms),
            equation,
            tuple(dict.fromkeys(p for form in forms for p in form.parameters)),
            ("force_*_n, moment_*_n_m", *(COLUMNS_OF[n] for n in dict.fromkeys(n for f in forms for n in f.requires))),
            effect.excitation(forms[0]),
        )
        for equation, forms in found.items()
    ]


def rows(effect: Effect, vehicle: Vehicle = EXAMPLE) -> list[_FormRow]:
    """Forms of an effect, those that differ by a number or a sensor alone in one row."""
    found: dict[tuple, _FormRow] = {}
    for form in (*effect.forms(vehicle), *effect.speed_forms, *effect.set_forms(vehicle)):
        excited = effect.excitation(form) if isinstance(form, Form) else (getattr(form, "excited_by", ""),)
        alike = (re.sub(r"(?<=[_,])\d+", "i", form.equation), len(form.parameters), type(form), form.parameters[0].unit)
        if alike in found and isinstance(form, SetForm | Form):
            names, _, parameters, columns, shows = found[alike]
            columns = tuple(dict.fromkeys((*columns, *_columns_of(form))))
            found[alike] = (*names, form.name), alike[0], parameters, columns, shows
        else:
            row = (form.name,), form.equation, form.parameters, _columns_of(form), tuple(filter(None, excited))
            found[(*alike, form.name) if isinstance(form, SpeedForm) else alike] = row
    return list(found.values())


def number(value: float) -> str:
    """A bound, three digits."""
    return f"{value:.3g}"


def _parameter_text(parameter: Parameter) -> str:
    """Symbol, range, unit and meaning."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    bounded = math.isfinite(parameter.low) and math.isfinite(parameter.high)
    span = f" from {number(parameter.low)} to {number(parameter.high)}{unit}" if bounded else f" in {parameter.unit}"
    return f"{parameter.symbol}{span}: {parameter.meaning}" + (", fitted" if parameter.nonlinear else "")


def _parameter_texts(parameters: tuple[Parameter, ...]) -> list[str]:
    """Parameters of a row, a long series of one letter, range and meaning by its ends."""
    series: dict[tuple, list[Parameter]] = {}
    for p in parameters:
        series.setdefault((p.symbol.split("_")[0], p.low, p.high, p.meaning), []).append(p)
    texts = []
    for same in series.values():
        if len(same) > 3:
            units = " or ".join(dict.fromkeys(p.unit for p in same))
            whole = replace(same[0], symbol=f"{same[0].symbol} … {same[-1].symbol}", unit=units)
            texts.append(_parameter_text(whole))
        else:
            texts += [_parameter_text(p) for p in same]
    return texts


def _names_text(names: tuple[str, ...]) -> str:
    """Names of forms, a long list by its ends."""
    return "; ".join(names) if len(names) <= 8 else f"{'; '.join(names[:3])}; … ; {names[-1]} ({len(names)} in all)"


def _excitation_text(keys: tuple[str, ...]) -> str:
    return " or ".join(dict.fromkeys(EXCITATION[key] for key in keys))


def listing() -> str:
    """A line for every effect: id, kind and how it shows."""
    effects = catalogue().values()
    wide = max(len(e.id) for e in effects)
    return "".join(f"{e.id:<{wide}}  {_KINDS[e.kind]:<18}  {e.sentence}\n" for e in effects)


def _formless(effect: Effect) -> str:
    """Why an effect lists no form."""
    if effect.reading_forms is not None:
        return "it has no form to fit: it is recognised from the readings themselves"
    return "its forms are made for windows that the data show (`F = Rᵀ f(t)`, linear between knots 0.6 s apart)"


def in_full(effect: Effect, vehicle: Vehicle = EXAMPLE) -> str:
    """One effect as plain text."""
    out = [f"{effect.id}: {effect.name} ({_KINDS[effect.kind]})", f"  {effect.sentence}", ""]
    every = [("form", row) for row in rows(effect, vehicle)]
    every += [("on an instrument", row) for row in _reading_rows(effect)]
    for kind, (names, equation, parameters, columns, excited) in every:
        out += [f"  {kind} {_names_text(names)}", f"    {equation}"]
        out += [f"    {text}" for text in _parameter_texts(parameters)]
        out.append(f"    columns: {'; '.join(columns)}")
        if excited:
            out.append(f"    shows with: {_excitation_text(excited)}")
        out.append("")
    if not every:
        out += [f"  {_formless(effect)}", ""]
    out += [
        f"  sign: {effect.sign}",
        f"  validity: {effect.validity}",
        f"  source: {effect.source}",
        f"  imitated by: {', '.join(effect.confusers) or 'nothing known'}",
        f"  what to fly: {advice(effect)}",
    ]
    return "\n".join(out) + "\n"


def _section(effect: Effect, vehicle: Vehicle = EXAMPLE) -> str:
    """One effect as a section of the page."""
    out = [f"### `{effect.id}`: {effect.name}\n", f"{_KINDS[effect.kind].capitalize()}: {effect.sentence}.\n"]
    table = [("", *row) for row in rows(effect, vehicle)]
    table += [("on an instrument: ", *row) for row in _reading_rows(effect)]
    if table:
        out.append("| form | equation | parameters | columns | shows with |\n| --- | --- | --- | --- | --- |")
        for where, names, equation, parameters, columns, excited in table:
            needed = "<br>".join(f"`{c}`" if " " not in c else c for c in columns)
            texts = "<br>".join(_parameter_texts(parameters))
            cells = (where + _names_text(names), equation, texts, needed, _excitation_text(excited))
            out.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        out.append("")
    else:
        text = _formless(effect)
        out.append(f"{text[0].upper()}{text[1:]}.\n")
    confusers = ", ".join(f"`{c}`" for c in effect.confusers) or "nothing known"
    out += [
        f"- Sign: {effect.sign}.",
        f"- Validity: {effect.validity}.",
        f"- Confused with: {confusers}. What distinguishes them: {advice(effect)}.",
        f"- Source: {effect.source}.\n",
    ]
    return "\n".join(out)


def markdown() -> str:
    """The whole page."""
    parts = [_INTRODUCTION]
    for kind, title in (("physics", "Physics"), ("sensor", "Sensors and logging"), ("mistake", "Mistakes in the set")):
        parts.append(f"## {title}\n")
        parts += [_section(e) for e in catalogue().values() if e.kind == kind]
    return "\n".join(parts).rstrip() + "\n"


def advice(effect: Effect, recordings: RecordingSet | None = None) -> str:
    """What would distinguish an effect from its confusers, one clause; it asks for no column that every run has.

    Without recordings it asks for every column that helps.
    """
    wanted = [name for name in effect.separating_columns if recordings is None or not _recorded(name, recordings)]
    words = " and ".join(RECORDABLE[name][0] for name in wanted)
    return f"{effect.separating_manoeuvre}; record {words} as well" if words else effect.separating_manoeuvre


def _recorded(name: str, recordings: RecordingSet) -> bool:
    """Whether every run has the columns."""
    columns = RECORDABLE[name][1](recordings.vehicle.rotor_count)
    return all(run.has(*columns) for run in recordings.runs)
