"""The numbers of the decision, each with its unit and its reason.

Cost of an id, leftover and least size were chosen among a few on the bench for decisions (`snakemake decisions`), by
what is new and lost in planted flights and wrong in drawn ones; the others are those of a first sketch. How many of the
statements hold that they make is for the bench to measure (docs/proof/README.md).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Prior:
    """What is believed before a recording is looked at."""

    effect_nats: float = 6.0
    """Nats that an id costs in addition to the logarithm of its number of forms: one of the catalogue's in four hundred
    is at work by belief, so that the fifty of them together are found by chance in one flight of eight."""
    nameless_nats: float = 6.0
    """Further nats of an empirical term without a name: one of the catalogue explains as much more often."""
    value_reach: float = 3.0
    """Trusts (the user's one-sigma) that a believed value may move as long as it is not called wrong."""
    freed_nats: float = 2.0
    """Nats that a believed value costs which may be wrong by more than that."""
    freed_sd: tuple[float, float] = (0.15, 0.5)
    """Least and largest relative one-sigma of such a value, else `value_reach` times its trust."""
    right_sd: float = 0.004
    """Relative one-sigma of a believed value that is right: nobody knows one better."""
    most_freed: int = 3
    """Values that are called wrong at once at most."""
    gain_bias: tuple[float, float] = (0.14, 0.10)
    """One-sigma that a gain between force or moment and motion is biased by, over √(residual / own part of its column),
    where all of the residual is leftover: of all frequencies, and of those of `model.gains.VALUE_BAND`. Measured on 44
    sets: right values are biased by 0.2 % (rms) where that root is below 0.03, by 3 % up to 0.3, by 25 % above."""
    gain_freedom: float = 30.0
    """Degrees of freedom of a gain's variance."""
    freed_reach: float = 0.6
    """Relative change that such a value may have at most: one further off is a mistake of its own (`doubts`)."""
    change_reach: float = 5.0
    """One-sigma of a change between two sets of flights at least, in units of what it looks like where nothing changed:
    an estimate that nothing else limits shrinks by four hundredths. Ten lets large changes be found that cancel."""
    slack: float = 1.5
    """Standard errors by which a coefficient may lie beyond its physical bound, as an estimate of one on the bound."""
    shown: float = 2.0
    """Standard errors from zero of a parameter without which its form is another effect."""
    small_nats: float = 20.0
    """Nats that a form costs with every parameter negligible, or with one that must show and does not."""
    attenuation: float = 0.3
    """Largest share of a column's energy that is taken for the noise of its regressor."""
    leftover_nats: float = 10.0
    """Nats by which a smaller leftover must be more probable to be believed: of a few environments its size is hardly
    known, and every real flight has one."""
    least_size: float = 0.03
    """Squares of a contribution over those of the noise above which it matters: less changes an error by one and a half
    percent at most."""
    form_error: float = 0.15
    """Share of an effect's contribution that its form is wrong by: what is less than that of another one in the same
    channel may be what is wrong with that one's form. Chosen on 22 drawn flights (docs/proof/README.md)."""
    open_nats: float = 5.0
    """Nats that a model with another id in its place may be worse for that id to be looked at."""
