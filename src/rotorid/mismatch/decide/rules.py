"""Rules of the decision: what the comparison of two models cannot know by itself.

A rule has a name, says in one sentence what it decides, and holds its limits, each with the reason for its value. The
code calls it with whether its condition holds; the answer is that, or no where the rule is switched off. What fired is
counted for the ledger of a verdict and for `snakemake ablation`, which judges sets without each rule in turn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from rotorid.errors import InputError


@dataclass
class _Asked:
    """Which rules are switched off during an analysis, and how often each rule fired."""

    off: frozenset[str] = frozenset()
    fired: Counter[str] = field(default_factory=Counter)


_ASKED: ContextVar[_Asked | None] = ContextVar("asked", default=None)


@dataclass(frozen=True)
class _Rule:
    """One rule of the decision."""

    name: str
    decides: str
    """What it decides, one sentence."""
    limits: Mapping[str, tuple[float, str]]
    """Numbers that it compares with, each with why it has this value."""

    @property
    def on(self) -> bool:
        """Whether the rule is not switched off."""
        asked = _ASKED.get()
        return asked is None or self.name not in asked.off

    def __getitem__(self, limit: str) -> float:
        return self.limits[limit][0]

    def __call__(self, holds: bool) -> bool:
        """Whether the rule decides here: its condition holds and it is not switched off."""
        asked = _ASKED.get()
        if asked is None:
            return bool(holds)
        if holds:
            asked.fired[self.name] += 1
        return bool(holds) and self.name not in asked.off


RULES: dict[str, _Rule] = {}


def rule(name: str, decides: str, **limits: tuple[float, str]) -> _Rule:
    """A new rule, known under its name."""
    made = _Rule(name, decides, limits)
    RULES[name] = made
    return made


@contextmanager
def asking(off: Iterable[str] = ()) -> Iterator[_Asked]:
    """Count what fires inside, with some rules switched off.

    Raises InputError for a name that no rule has.
    """
    names = frozenset(off)
    if unknown := sorted(names - set(RULES)):
        raise InputError(f"rules.off: no rule is named {', '.join(unknown)}; the rules are {', '.join(RULES)}")
    asked = _Asked(names)
    token = _ASKED.set(asked)
    try:
        yield asked
    finally:
        _ASKED.reset(token)


# What a term must be to stay in a model

SIZE = rule(
    "size",
    "An effect is not kept if its strongest tenth of the seconds is small compared with the channel's noise.",
    least=(0.15, "an effect of a seventh of the noise changes the error by one percent"),
)
OVERSHADOWED = rule(
    "overshadowed",
    "A contribution counts only in channels without a far larger effect, whose form would not be exact enough.",
    share=(0.04, "forms of the catalogue and blade-element rotors differ by 2 to 4 %"),
    share_of_burst=(0.15, "the error of a strong effect's form comes in bursts, too"),
    times_for_burst=(3.0, "of hundreds of windows the largest is by chance three times as large as usual"),
)
BOUNDS = rule(
    "bounds", "Coefficients lie within the bounds of their form, or outside by less than 1.5 standard errors."
)
MUST_SHOW = rule(
    "must_show",
    "The parameters that distinguish a form from another one differ from zero by two standard errors.",
)
NEGLIGIBLE = rule("negligible", "At least one parameter is larger than the effect's file calls negligible.")
OWN_PART = rule(
    "own_part",
    "A contribution is neither collinear with other terms up to a form's error, nor mostly noise of its regressors.",
)
STRAIN = rule(
    "strain",
    "A term does not push a believed value far beyond its trust that stays near its belief without the term.",
    deviations=(4.0, "standard deviations of trust: beyond, the user's number would have to be a mistake"),
)
TRANSFER = rule(
    "transfer",
    "The gain that a term predicts is realised on environments to which it was not fitted.",
    share=(0.6, "effects at work realised 0.88 to 1.18 of it, terms that fit unmodelled residual 0.3 to 0.55"),
    won=(0.7, "times the share of environments expected of its strength: effects at work gained in 0.88 to 1.00"),
    promise=(25.0, "whitened squares: a smaller predicted gain may fail by chance"),
)
STEADY = rule(
    "steady",
    "A coefficient of a flight is the same in every run.",
    p_value=(1e-6, "some fifty terms in some ten runs are tested"),
    spread=(0.4, "share of itself: coefficients of slightly wrong forms vary by less between manoeuvres"),
)
CANCELS = rule(
    "cancels",
    "A term is not cancelled by another in its strongest channel.",
    share=(0.1, "what remains of either: such a pair fits amplified noise of another channel"),
)

# Moves of the search

EXCHANGE = rule(
    "exchange",
    "An id gives way to another that explains more, a free form of an id to a plain one and another id.",
)
FREE_VALUES = rule("free_values", "An effect is significant given believed values that are free.")

# Classes

SUPPORT = rule(
    "support",
    "A name that most draws of the recording's own seconds do not keep is a class with what replaces it, or none.",
    share=(0.8, "of the draws' posterior: no true name of 26 drawn flights had less"),
)
PAYLOAD_OR_OFFSET = rule("payload_or_offset", "An offset of the centre of mass on a heavier vehicle may be a payload.")
ROTORS_OR_OFFSET = rule(
    "rotors_or_offset",
    "Rotors that differ and an offset of the centre of mass are a class where they roll and pitch a vehicle alike.",
    share=(
        0.997,
        "of the squares of one's moment that the other makes: no form is known better than a twentieth",
    ),
)
THROTTLE_OR_THRUST = rule("throttle_or_thrust", "Without measured rotor speeds a thrust curve may be a throttle curve.")

# Believed values

VALUE_IN_QUESTION = rule(
    "value_in_question", "A value that a member of an open class would change is not called wrong."
)
SETTLED = rule("settled", "Values not called wrong move within their trust where the error on left-out runs falls.")

# Flights

OWN_SCALES = rule("own_scales", "Where thrust differs between runs each run has its own scale.")
PAYLOAD_WINDOWS = rule("payload_windows", "A load with two plateaus is a payload that is on board for a part of a run.")
COLOURED_NOISE = rule(
    "coloured_noise", "Noise of speeds and gyroscope in the band analysed may be more than its white part."
)

# Stands and benches

NEEDLESS_VALUE = rule(
    "needless_value", "A wrong value is still significant where an effect's form is free or has more parameters."
)
CURVED_GAIN = rule(
    "curved_gain", "A gain given a curved characteristic is wrong at small loads and over all loads together."
)
ELSEWHERE = rule(
    "elsewhere",
    "Another effect that predicts left-out runs far worse is no alternative.",
    squares=(12.0, "whitened squares: one and a half times an id's cost"),
)
PLAINER_FORM = rule("plainer_form", "A form without a significant parameter is replaced by a form of fewer parameters.")
ONE_LOAD = rule("one_load", "On one rotor that does not tilt, thrust and reading are curves of one load.")

# Statuses

BELOW_LEFTOVER = rule(
    "below_leftover",
    "An effect smaller than the unmodelled residual, or than half a step of a coarse reading, is not established.",
)
SLIGHT = rule(
    "slight",
    "An effect with next to no share of the explained error and no large gain in any channel, or with next to no gain "
    "at all, is not established.",
)
MAY_BE_NOTHING = rule("may_be_nothing", "An effect without a significant parameter is not established.")


def markdown() -> str:
    """The rules as a table, for the site's reference of the decision."""
    lines = ["| rule | decides | limits |", "| --- | --- | --- |"]
    for one in RULES.values():
        limits = "; ".join(f"`{name}` {value:g}: {why}" for name, (value, why) in one.limits.items())
        lines.append(f"| `{one.name}` | {one.decides} | {limits} |")
    return "\n".join(lines) + "\n"
