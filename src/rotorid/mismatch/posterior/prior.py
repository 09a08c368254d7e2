"""The numbers of the decision, each with its unit and its reason.

They are those of a first sketch, tried on plantings in three real flights and on 42 simulated ones, and not calibrated:
how many of the statements hold that they make is the bench's to measure (`snakemake decisions`).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Prior:
    """What is believed before a recording is looked at."""

    effect_nats: float = 3.0
    """Nats that an id costs in addition to the logarithm of its number of forms: one id in twenty is at work."""
    nameless_nats: float = 6.0
    """Further nats of an empirical term without a name: one of the catalogue explains as much more often."""
    form_error: float = 0.05
    """Relative one-sigma by which a contribution is wrong, differently in each environment: forms of the catalogue and
    blade-element rotors differ by 2 to 4 %, and a form is seldom alone."""
    value_reach: float = 3.0
    """Trusts (the user's one-sigma) that a believed value may move as long as it is not called wrong."""
    slack: float = 1.5
    """Standard errors by which a coefficient may lie beyond its physical bound, as an estimate of one on the bound."""
    shown: float = 2.0
    """Standard errors from zero of a parameter without which its form is another effect."""
    small_nats: float = 20.0
    """Nats that a form costs with every parameter negligible, or with one that must show and does not."""
    attenuation: float = 0.3
    """Largest share of a column's energy that is taken for the noise of its regressor."""
    first_power: float = 32.0
    """Power of the leftover over white noise with which a first mode is looked for, 1."""
    judged_power: float = 8.0
    """Power under which that mode's leftover is measured, 1."""
    powers: tuple[float, float] = (1.0, 100.0)
    """Least and largest power that is believed of a leftover, 1."""
    said_nats: float = 6.0
    """Log odds of an id against the model without it above which it is stated: 400 to 1."""
    said_share: float = 0.01
    """Share of the leftover's squares that its own part explains above which it is stated: less changes an error by
    half a percent at most."""
    open_nats: float = 3.0
    """Nats that a model with another id in its place may be worse for both to form a class: 20 to 1."""
