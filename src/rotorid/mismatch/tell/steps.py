"""The top of the verdict's page: how much of the error each step takes off (believed → values → named physics →
derivatives → noise), and three tiles below its sentence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from rotorid.effects.catalogue import before_the_rotors, catalogue
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.decide.words import capital, channel_words, effect_words, listed, number, parameter_words
from rotorid.mismatch.tell.consistency import quoted
from rotorid.mismatch.tell.places import range_words
from rotorid.mismatch.tell.sentences import MOST_NAMES, names_of, surest_location
from rotorid.mismatch.tell.verdict import Channel, Location, Verdict
from rotorid.recordings import Vehicle
from rotorid.vehicle.derivatives import CHANNELS, QUANTITIES
from rotorid.vehicle.simulator import at_rest

_SWING = {**dict.fromkeys("uvw", 5.0), **dict.fromkeys("pqr", 2.0)}
"""Of each quantity, m/s and rad/s, how far a catalogue form is moved to see what it makes of it."""


@dataclass(frozen=True)
class _Steps:
    """Errors of one channel, or of several in the geometric mean, each over the believed vehicle's."""

    values: float
    named: float
    """With named physics; as `values` where a vehicle without is delivered."""
    delivered: float
    noise: float


def steps_of(channels: Mapping[str, Channel], model: str) -> dict[str, _Steps]:
    """Steps of every channel of force and moment, on the runs held out where there are any."""
    out = {}
    for name, channel in channels.items():
        errors = quoted(channel)
        if name in CHANNELS and errors.before and None not in (errors.refitted, errors.named, errors.after):
            values = errors.before if model == "believed" else errors.refitted
            named = errors.named if model == "named" else values
            floor = channel.noise_floor or 0.0
            out[name] = _Steps(*(x / errors.before for x in (values, named, errors.after, floor)))
    return out


def together(steps: Mapping[str, _Steps]) -> _Steps | None:
    """The geometric mean over channels; None of none."""
    if not steps:
        return None
    rows = np.array([[s.values, s.named, s.delivered, s.noise] for s in steps.values()])
    return _Steps(*np.exp(np.log(np.maximum(rows, 1e-9)).mean(axis=0)))


def steps_sentence(verdict: Verdict) -> str:
    """What each step takes off the error on flights not used for fitting; empty where nothing is compared."""
    worth_saying = 0.02  # Share of the error below which a step takes nothing off that is worth a word.
    at_the_noise = 1.1  # Error over the noise floor up to which what is left is called noise.
    compared = steps_of(verdict.channels, verdict.delivered.model)
    whole = together(compared)
    if whole is None or verdict.kind != "flight":
        return ""
    # The geometric mean: one channel may lose nearly all of its error and another none.
    errors = f"errors of the {len(compared)} forces and moments on average" if len(compared) > 1 else "error"
    held = any(c.rmse.held_out.after is not None for c in verdict.channels.values())
    claimed = {e.id: names_of((e.id, *e.alternatives), "or") for e in verdict.effects if e.delivered}
    values = min(whole.values, 1.0)  # values alone that do not help take nothing off
    named, take = _counted(list(claimed.values())) or "named physics", "takes" if len(claimed) < 2 else "take"
    parts: list[str] = []
    for name, verb, share in (("values", "take", 1.0 - values), (named, take, values - whole.named)):
        if share >= worth_saying:
            what = f"{100 * share:.0f} %"
            parts.append(f"{name} another {what}" if parts else f"{name} {verb} {what} off the {errors}")
    nameless = whole.named - whole.delivered
    if nameless >= worth_saying:
        parts.append(f"{100 * nameless:.0f} % {'more ' if parts else ''}is predictable{_nameless(verdict, claimed)}")
    if not parts:
        parts.append(f"nothing that was found takes a part off the {errors}")
    left = (
        "the rest is noise"
        if whole.delivered <= at_the_noise * whole.noise
        else f"{100 * whole.delivered:.0f} % is left (noise alone: {100 * whole.noise:.0f} %)"
    )
    where = "On flights not used for fitting" if held else "On the flight that was fitted"
    return f"{where}, {', '.join(parts)}; {left}."


def _nameless(verdict: Verdict, claimed: Mapping[str, str]) -> str:
    """What is said of the part that named physics does not take; `claimed`: ids of what is claimed, in words."""
    measured = any(name.startswith("rotor_speed") for name in verdict.channels)
    path = [words for i, words in claimed.items() if i in before_the_rotors()]
    if path and not measured and verdict.delivered.model == "refitted":
        return f": {_counted(path)}, and what has no name yet"  # refitted values fly behind the path that was found
    return " and has no name yet"


def _counted(names: list[str]) -> str:
    """The first of some names and how many more there are."""
    return listed(names if len(names) <= MOST_NAMES else [*names[: MOST_NAMES - 1], f"{len(names) - 1} more effects"])


@cache
def _moved_by() -> dict[str, frozenset[tuple[str, str]]]:
    """To each id of physics or sensor the derivatives that one of its forms can make about a hover of some vehicle."""
    arm = 0.1
    vehicle = Vehicle.model_validate(
        dict(
            name="any",
            kind="flight",
            mass_kg=1.0,
            inertia_kg_m2=dict(xx=0.01, yy=0.011, zz=0.02),
            rotors=[
                dict(x_m=x * arm, y_m=y * arm, z_m=-0.02, spin=s)
                for x, y, s in ((1, 1, "ccw"), (1, -1, "cw"), (-1, -1, "ccw"), (-1, 1, "cw"))
            ],
            thrust_coefficient_n_s2=1e-5,
            torque_coefficient_n_m_s2=1e-7,
            rotor_radius_m=0.06,
            rotor_inertia_kg_m2=1e-5,
            ground_z_m=0.0,
        )
    )
    quantities = [q for q in QUANTITIES if q in _SWING]
    n = 1 + 2 * len(quantities)
    velocity, rates = np.zeros((n, 3)), np.zeros((n, 3))
    for k, q in enumerate(quantities):
        for row, sign in ((1 + 2 * k, 1.0), (2 + 2 * k, -1.0)):
            (velocity if q in "uvw" else rates)[row, k % 3] = sign * _SWING[q]
    hovering = at_rest(vehicle, 0.01 * np.arange(n), np.full((n, 4), np.sqrt(9.81 / 4e-5)), height_m=1.0)
    motion = replace(hovering, velocity=velocity, angular_velocity=rates, voltage=np.ones(n))
    out = {}
    for effect_id, effect in catalogue().items():
        found, moving = set(), effect.fitted and effect.kind == "physics" and not effect.of_the_rig
        for form in effect.forms(vehicle) if moving else ():
            if form.memory or form.on_loading:
                continue
            values = np.array([p.starts[0] if p.starts else 1.0 for p in form.parameters])
            added = form.contribution(motion, vehicle, values)
            parts = [np.zeros((n, 3)) if x is None else np.nan_to_num(x) for x in (added.force, added.moment)]
            table = np.concatenate(parts, axis=1)
            largest = np.abs(table).max(axis=0) + 1e-30
            made = {q: table[1 + 2 * k] - table[2 + 2 * k] for k, q in enumerate(quantities)} | {"constant": table[0]}
            for q, row in made.items():
                found |= {(c, q) for c, size in zip(CHANNELS, np.abs(row) / largest, strict=True) if size > 0.05}
        out[effect_id] = frozenset(found)
    return out


def would_explain(channel: str, quantity: str, verdict: Verdict) -> list[str]:
    """Ids of the catalogue, tested and not claimed, that make such a derivative."""
    open_ids = [e.id for e in verdict.effects if e.status != "established"] + [a.id for a in verdict.absent]
    return [i for i in dict.fromkeys(open_ids) if (channel, quantity) in _moved_by().get(i, ())]


@dataclass(frozen=True)
class _Tile:
    """A heading, what it says in large letters, and a line below."""

    heading: str
    large: str
    small: str = ""


def claims(verdict: Verdict) -> list[str]:
    """What is claimed, in words that fit before "left out": effects, a class as "a or b", each once."""
    said, seen = [], set()
    for effect in verdict.effects:
        members = {effect.id, *effect.alternatives}
        if effect.status in CLAIMED and not members & seen:
            seen |= members
            others = [effect_words(i) for i in effect.alternatives if i != effect.id and effect.status == "ambiguous"]
            others = others if len(others) < 2 else [f"one of {len(others)} others"]
            said.append(" or ".join([effect_words(effect.id), *others]))
    return said


def tiles(verdict: Verdict, main: str) -> list[_Tile]:
    """What, where, and how large the error was before and after relative to the noise."""
    return [_what(verdict), _where(verdict, main), _how_much(verdict, main)]


def _what(verdict: Verdict) -> _Tile:
    named = claims(verdict)
    wrong = [parameter_words(n)[0].rstrip(",") for n in verdict.parameters]
    if not named and not wrong:
        if verdict.verdict == "no_mismatch":
            return _Tile("What", "Nothing left out", f"{len(verdict.not_testable)} effects could not be tested")
        return _Tile("What", "Not known", "none of the known effects explains it")
    first, *rest = [*map(capital, named), *(f"{capital(w)} wrong" for w in wrong)]
    return _Tile("What", first, f"and {listed([r[0].lower() + r[1:] for r in rest])}" if rest else "")


def _where(verdict: Verdict, main: str) -> _Tile:
    here = [loc for loc in verdict.locations if loc.channel == main] or list(verdict.locations)
    if not here:
        return _Tile("Where", "Nowhere", "no error above the sensors' noise")
    channels = list(dict.fromkeys(loc.channel for loc in verdict.locations))
    best = surest_location(here)
    large = capital(channel_words(best.channel))
    others = f"; also in {len(channels) - 1} other channels" if len(channels) > 1 else ""
    return _Tile("Where", large, f"{_when(best, here)}{others}")


def _when(best: Location, here: Sequence[Location]) -> str:
    regime = best.regime
    if regime is not None and regime.low is not None and regime.high is not None:
        return range_words(regime)
    if best.energy_share < 0.99 and best.start_s is not None and best.stop_s is not None:
        more = f" and {len(here) - 1} more stretches" if len(here) > 1 else ""
        return f"{best.start_s:.1f} to {best.stop_s:.1f} s of {best.run}{more}"
    return f"all through {best.run}" if len({loc.run for loc in here}) == 1 else "in every run"


def _how_much(verdict: Verdict, main: str) -> _Tile:
    if main not in verdict.channels:
        return _Tile("How much", "–")
    channel = verdict.channels[main]
    errors = quoted(channel)
    where = "on the runs fitted" if channel.rmse.held_out.after is None else "on runs held out"
    large = f"{number(errors.before)} → {number(errors.after)} {channel.unit}"
    size = verdict.size
    metres = size.metres_after_half_a_second if size is not None and size.channel == main else None
    led = "" if metres is None else f"; as believed {number(metres)} m off after half a second of simulation"
    noise = f"noise {number(channel.noise_floor)} {channel.unit}, " if channel.noise_floor else ""
    return _Tile("Error before and after", large, f"{channel_words(main)}; {noise}{where}{led}")
