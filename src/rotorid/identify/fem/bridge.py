"""From a cell's strain to the converter's counts (thesis 2.1, 2.2 and 2.7.2).

Four active gauges in a full bridge give V = V_e k ε: excitation V_e, gauge factor k, and ε the mean of their strains,
each with its sign. The ADS1256 resolves V in steps of 2 V_ref / gain / (2²³ - 1).
"""

from __future__ import annotations

from rotorid.identify.bench.reconstruct import GF_N
from rotorid.identify.fem.sizes import Sizes
from rotorid.io.wire.bench import VOLTS_PER_COUNT

PRINTED_STEP_V = 1e-5
"""Unit of table 2.7's readings and of table 2.8's slopes."""


def volts_per_newton(sizes: Sizes, strain_per_newton: float) -> float:
    """Voltage of the bridge per newton across the cell's end [V/N]."""
    return sizes.excitation_v * sizes.gauge_factor * strain_per_newton


def counts_per_newton(volts_per_n: float) -> float:
    """Counts of the converter per newton [1/N]."""
    return volts_per_n / VOLTS_PER_COUNT


def printed_slope(volts_per_n: float) -> float:
    """The same sensitivity as table 2.8 prints it [gf per 1e-5 V]."""
    return PRINTED_STEP_V / (volts_per_n * GF_N)


def from_printed_slope(slope_gf: float) -> float:
    """Sensitivity [V/N] of a slope as table 2.8 prints it [gf per 1e-5 V]."""
    return PRINTED_STEP_V / (slope_gf * GF_N)
