"""Drawn sets."""

from rotorid_proof.concealed import drawn
from rotorid_proof.concealed.continuous.equations import Strayed


def test_a_vehicle_that_no_controller_holds_is_drawn_anew(monkeypatch):
    tried = []

    def make(family, seed):
        tried.append(seed)
        if len(tried) == 1:
            raise Strayed("not held")
        return "recording", {}, {}

    monkeypatch.setattr(drawn.continuous, "make", make)
    assert drawn.make("continuous/frame/development/000", 7)[0] == "recording"
    assert tried[0] == 7 and len(set(tried)) == 2
