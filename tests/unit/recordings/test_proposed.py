"""Values of a vehicle file that nobody measured are said to be so."""

import pytest

from rotorid.recordings.files import proposed_in

TEXT = """# Proposed from log. Lines marked PROPOSED are guesses.
name: "log"
mass_kg: 1.5   # as you stated it
inertia_kg_m2: {xx: 1e-3, yy: 1e-3, zz: 2e-3}   # PROPOSED: template x500, scaled by mass and arm squared
rotors:   # PROPOSED: template x500; check order and turning senses
  - {x_m: 0.1, y_m: 0.1, spin: ccw}   # 1 front right
torque_coefficient_n_m_s2: 1.0e-08   # PROPOSED: 0.016 m times C_F, template x500
"""


def test_each_proposed_value_is_a_doubt_that_does_not_stop():
    found = proposed_in(TEXT)
    assert [d.what for d in found] == ["inertia_kg_m2", "rotors", "torque_coefficient_n_m_s2"]
    assert not any(d.stops for d in found)
    assert found[0].sentence == "inertia_kg_m2 is only proposed (template x500, scaled by mass and arm squared)."


@pytest.mark.parametrize("text", ["", "mass_kg: 1.5\n", TEXT.replace("PROPOSED:", "measured,")])
def test_a_value_that_someone_stated_is_none(text):
    assert proposed_in(text) == ()
