"""The gate: parts go, one after the other, until no channel is predicted worse where it was not fitted."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.delivery import gate as module
from rotorid.mismatch.delivery.gate import Offer, Settled, gate, without_worse, worse_than

RATE, SECONDS = 20, 60


def noise(seed: int, scale=1.0) -> list[np.ndarray]:
    """What a model leaves of one stretch, (n, 6)."""
    return [np.random.default_rng(seed).normal(size=(RATE * SECONDS, 6)) * scale]


def model(*keys: str):
    """A model with these terms, each of an effect of the same name."""
    terms = {k: SimpleNamespace(effect=k) for k in keys}
    return SimpleNamespace(search=SimpleNamespace(terms=terms), rows_per_block=RATE)


@pytest.fixture(autouse=True)
def every_row_is_judged(monkeypatch):
    monkeypatch.setattr(module, "judged_rows", lambda m: [np.ones(RATE * SECONDS, bool)])


def settling(monkeypatch, spoils: dict[str, float], cures: dict[str, float]):
    """Make an offer leave noise, times what its parts spoil in the vertical force and cure in the sideways one."""

    def settle(m, offer, reference=None):
        scale = np.ones(6)
        for part in (*offer.active, *offer.values):
            scale[2] *= spoils.get(part, 1.0)
            scale[1] *= cures.get(part, 1.0)
        return Settled(offer, None, {}, noise(2, scale))

    monkeypatch.setattr(module, "settle", settle)


def test_a_channel_is_worse_by_more_than_chance():
    reference = noise(1)
    larger = [part * np.array([1, 1, 1.3, 1, 1, 1]) for part in reference]
    (worse,) = worse_than(model(), reference, larger)
    assert worse.channel == "force_z" and worse.ratio == pytest.approx(1.3)
    assert worse_than(model(), noise(1), noise(2)) == []


def test_the_part_that_makes_a_channel_worse_goes_and_the_others_stay(monkeypatch):
    settling(monkeypatch, spoils={"bad": 2.0}, cures={"good": 0.5})
    offer = Offer({}, ("good", "bad"))
    found = gate(model("good", "bad"), offer, {}, noise(3))
    assert found.settled.offer.active == ("good",) and set(found.withheld) == {"bad"}
    assert "vertical force" in found.withheld["bad"] and not found.withheld_values and not found.passes_whole


def test_a_wrong_value_that_makes_a_channel_worse_is_withheld(monkeypatch):
    settling(monkeypatch, spoils={"thrust": 4.0}, cures={})
    found = gate(model(), Offer({"thrust": (0.5, 0.1)}, ()), {}, noise(3))
    assert found.settled.offer.values == {} and set(found.withheld_values) == {"thrust"}


def test_refitted_values_that_make_a_channel_worse_fall_back_to_what_was_believed(monkeypatch):
    settling(monkeypatch, spoils={"mass": 2.0}, cures={})
    monkeypatch.setattr(module, "delivered_fit", lambda m, keys, values: ([], None))
    found = gate(model(), Offer({}, ()), {"mass": (0.3, 0.01)}, noise(3))
    assert found.refitted.offer.values == {} and set(found.fell_back) == {"mass"}


def test_what_helps_passes_whole(monkeypatch):
    settling(monkeypatch, spoils={}, cures={"good": 0.5})
    found = gate(model("good"), Offer({}, ("good",)), {}, noise(3))
    assert found.passes_whole and found.settled.offer.active == ("good",)


def test_where_nothing_helps_all_go(monkeypatch):
    def settle(m, offer, reference=None):
        return Settled(offer, None, {}, noise(2, 2.0))

    monkeypatch.setattr(module, "settle", settle)
    last = Settled(Offer({"mass": (0.1, 0.01)}, ()), None, {}, noise(2))
    found, gone = without_worse(model("a", "b"), settle(None, Offer({}, ("a", "b"))), noise(3), last)
    assert found is last and set(gone) == {"a", "b"}


def test_of_two_that_spoil_a_channel_together_one_stays(monkeypatch):
    """Each alone is sound; beside each other they make the vertical force twice as bad, and so does the third."""

    def settle(m, offer, reference=None):
        bad = {"a", "b"} <= set(offer.active) or "c" in offer.active
        return Settled(offer, None, {}, noise(2, np.array([1, 1, 2.0 if bad else 1.0, 1, 1, 1])))

    monkeypatch.setattr(module, "settle", settle)
    found, gone = without_worse(model("a", "b", "c"), settle(None, Offer({}, ("a", "b", "c"))), noise(3))
    assert len(found.offer.active) == 1 and "c" in gone and len(gone) == 2


def test_a_vehicle_that_is_not_usable_loses_the_part_that_makes_it_so(monkeypatch):
    settling(monkeypatch, spoils={}, cures={})

    def unusable(settled):
        return "it cannot hover" if "weak" in settled.offer.active else ""

    found = gate(model("weak", "sound"), Offer({}, ("weak", "sound")), {}, noise(2), unusable)
    assert found.settled.offer.active == ("sound",) and found.withheld == {"weak": "it cannot hover"}
