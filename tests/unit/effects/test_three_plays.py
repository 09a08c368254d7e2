"""Loops of hysteresis made of plays of several widths."""

import numpy as np
import pytest

from rotorid.effects.hysteresis import MIDDLE, NARROW, WIDE, play


def test_widths_are_evenly_spread_on_a_logarithmic_scale():
    assert MIDDLE / NARROW == pytest.approx(WIDE / MIDDLE)


def test_a_play_hangs_behind_by_its_half_width():
    load = np.array([0.0, 1.0, 2.0, 1.5, 1.0, 0.5])
    assert play(load, 0.5) == pytest.approx([0.0, 0.5, 1.5, 1.5, 1.5, 1.0])
