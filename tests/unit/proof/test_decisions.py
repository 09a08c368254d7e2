"""The bench for decisions: what is counted of a decision on a set, and in which order sets are kept."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rotorid_proof.decisions import truths
from rotorid_proof.decisions.bench import rows_of
from rotorid_proof.decisions.collect import Made, collect
from rotorid_proof.decisions.decisions import ideal_observer, posterior, selection
from rotorid_proof.decisions.label import Label
from rotorid_proof.decisions.plan import Item, drawn, in_order
from rotorid_proof.decisions.score import Counts, score_drawn, score_planted, score_real, statements
from rotorid_proof.decisions.store import Kept, read_all, write
from rotorid_proof.decisions.table import markdown, sets, table
from rotorid_proof.plan import Entry
from rotorid_proof.plantings.kinds import Ratio, Size, named
from tests.unit.mismatch.decide.test_posterior import effect as term
from tests.unit.mismatch.decide.test_posterior import flight

DRAG = {"id": "rotor_drag", "form": "", "equivalent": [], "size_over_noise": 1.0}
ANSWER = {
    "set": "set-1", "case": "mixture/00/0", "expected": ["mass_kg", "rotor_drag"],
    "effects": [DRAG | {"parameters": [{"symbol": "k_d", "value": 2.0, "unit": "N"}]}],
    "wrong_parameters": {"mass_kg": {"true": 1.1, "believed": 1.0}}, "outside_catalogue": [], "locations": [],
    "verdict": ["explained"],
}  # fmt: skip
NOTHING = {"expected": [], "effects": [], "wrong_parameters": {}, "verdict": ["no_mismatch"]}
CLEAN = ANSWER | NOTHING | {"case": "clean/000"}


def effect(name, status="established", probability=None, value=2.0, symbol="k_d", alternatives=()):
    """An effect as a verdict states it."""
    parameter = {"symbol": symbol, "value": value, "unit": "N", "interval_95": [value - 0.5, value + 0.5]}
    out = {"id": name, "status": status, "alternatives": list(alternatives), "p_value": 1e-9, "parameters": [parameter]}
    return out if probability is None else {**out, "probability": probability}


def said(*effects, values=()):
    """A decision's effects and values."""
    mass = {"believed": 1.0, "refitted": 1.1, "interval_95": [1.05, 1.15]}
    return {"effects": list(effects), "parameters": dict.fromkeys(values, mass), "verdict": "explained"}


def test_a_drawn_set_that_is_right_counts_so():
    counts = score_drawn(said(effect("rotor_drag"), values=["mass_kg"]), ANSWER).counts
    assert (counts.right, counts.named, counts.causes, counts.wrong) == (1, 1, 1, 0)
    assert (counts.values_right, counts.values_true, counts.values_wrong) == (1, 1, 0)
    assert (counts.covered, counts.intervals) == (2, 2)
    assert (counts.held_99, counts.said_99) == (1, 1)


def test_wrong_names_and_values_count_and_what_is_missed_is_said():
    scored = score_drawn(said(effect("payload", value=9.0), values=["arm_scale"]), ANSWER)
    assert (scored.counts.right, scored.counts.named, scored.counts.wrong, scored.counts.values_wrong) == (0, 0, 1, 1)
    assert (scored.counts.held_99, scored.counts.said_99) == (0, 1)
    assert scored.words["missed"] == ["rotor_drag"] and scored.words["wrong"] == ["payload"]


def test_a_name_on_a_clean_set_is_an_alarm():
    quiet = {"effects": [], "parameters": {}, "verdict": "no_mismatch"}
    assert score_drawn(quiet, CLEAN).counts.alarmed == 0
    loud = score_drawn(said(effect("payload")), CLEAN).counts
    assert (loud.clean, loud.alarmed, loud.right) == (1, 1, 0)


def test_statements_count_at_the_probability_that_they_state():
    sure, likely = effect("rotor_drag", "suggested", 0.95), effect("payload", "suggested", 0.97)
    counts = score_drawn(said(sure, likely, effect("gust", "suggested")), ANSWER).counts
    assert (counts.said_90, counts.held_90, counts.said_99) == (2, 1, 0)
    both = said(effect("gust", "ambiguous", 0.6, alternatives=["gust", "payload"]))
    assert statements(both) == [(frozenset({"gust", "payload"}), 0.6)]


def test_a_planted_set_is_compared_with_its_flight_untouched():
    truth = named("com_offset", sizes=((Size("com_offset", "x", 1.0),),))
    untouched = said(effect("rotor_drag"), effect("gust"))
    planted = said(effect("rotor_drag"), effect("com_offset", symbol="x", value=1.2), effect("payload"))
    scored = score_planted(planted, untouched, [truth])
    assert (scored.counts.named, scored.counts.causes, scored.counts.covered) == (1, 1, 1)
    assert (scored.counts.new, scored.counts.lost, scored.counts.right) == (1, 1, 0)
    assert scored.words["new"] == ("payload",) and scored.words["lost"] == ("gust",)
    # The drag is in both: nobody knows whether it is there. The payload is not, what was planted is.
    assert (scored.counts.said_99, scored.counts.held_99) == (2, 1)
    clean = score_planted(said(*untouched["effects"], effect("com_offset", symbol="x")), untouched, [truth])
    assert clean.counts.right == 1


def test_a_planted_value_counts_as_a_value():
    truth = named("mass_kg", ratio=Ratio({"mass_kg": 1.0}, float(np.log(1.1))))
    counts = score_planted(said(values=["mass_kg"]), said(), [truth]).counts
    assert (counts.values_true, counts.values_right, counts.causes, counts.right) == (1, 1, 0, 1)


def test_a_cause_that_cannot_be_seen_is_asked_of_nobody():
    counts = score_planted(said(effect("payload")), said(), [named("com_offset", unseen="no body rates")]).counts
    assert (counts.causes, counts.rated, counts.new, counts.compared) == (0, 0, 0, 0)


def test_a_stage_that_stopped_is_right_in_nothing():
    failed = {"failed": "ValueError: no"}
    assert score_drawn(failed, ANSWER).counts == Counts(sets=1, failed=1, rated=1, causes=1, values_true=1)
    assert score_planted(failed, said(), []).counts == Counts(sets=1, failed=1)
    assert score_real(failed, ["rotor_drag"]).counts == Counts(sets=1, failed=1)


def test_of_a_real_set_one_expected_id_is_asked_for():
    assert score_real(said(effect("gust")), ["rotor_drag", "gust"]).counts.named == 1
    assert score_real(said(effect("payload")), ["rotor_drag", "gust"]).counts == Counts(sets=1, causes=1)


def items(count, seconds, laboratory):
    """Sets of one laboratory."""
    return [Item(Label(f"planted/{laboratory}/{k}", "flight", laboratory, "values"), seconds) for k in range(count)]


def test_groups_share_the_time_and_what_others_are_compared_with_comes_first():
    base = Item(Label("untouched/slow", "flight", "slow", "untouched"), 50.0, first=True)
    order = in_order([*items(3, 50.0, "slow"), *items(20, 5.0, "fast"), base])
    assert order[0] == base
    laboratories = [i.label.laboratory for i in order[1:]]
    assert laboratories.index("slow") == 9 and len(order) == 24


def test_sets_are_labelled_by_simulator_and_family():
    cases = ["continuous/blades/development/001", "single/gust/weak/0", "stand/rig/clean/development/000"]
    labels = [i.label for i in drawn(Entry(c, "") for c in [*cases, "bench/single/crosstalk/weak/0"])]
    said = [f"{x.plant}, {x.laboratory}, {x.family}" for x in labels]
    assert said[:2] == ["flight, continuous, blades", "flight, richsim, single"]
    assert said[2:] == ["stand, rig, clean", "bench, ground, single"]


def test_a_collection_goes_on_where_it_stopped_and_one_bad_set_does_not_end_it(tmp_path, monkeypatch):
    class Runs:
        runs = ()

    made = []

    def make(item):
        made.append(item.label.name)
        if item.label.name.endswith("/1"):
            raise ValueError("no such file")
        return Made(Runs(), {"expected": []})

    monkeypatch.setattr("rotorid_proof.decisions.collect.judged", lambda recordings: ({"verdict": "explained"}, None))
    wanted = items(3, 5.0, "somewhere")

    def go(engine):
        collect(wanted, tmp_path, make, lambda item: "source", engine, lambda line: None)
        return [name[-1] for name in made]

    assert go("now") == ["0", "1", "2"]
    assert go("now") == ["0", "1", "2", "1"]
    assert go("later") == ["0", "1", "2", "1", "0", "1", "2"]
    assert len(read_all(tmp_path)) == 4


def kept(name, origin_family, chosen, plant="flight"):
    """A set whose verdict says nothing and whose selection says `chosen`."""
    label = Label(name, plant, "somewhere", origin_family)
    verdict = {"effects": [], "parameters": {}, "verdict": "no_mismatch"}
    effects = {"effects": chosen, "outside": [], "parameters": {}, "commanded": False} if plant == "flight" else None
    return Kept(label, name.replace("/", ""), "source", "now", 1.0, 30.0, verdict, effects)


def test_every_decision_is_scored_on_everything_that_is_kept(tmp_path):
    truth = named("com_offset")
    write(tmp_path, kept("untouched/somewhere", "untouched", []), None, {})
    told = kept("planted/somewhere/geometry/x/large/0", "geometry", [effect("com_offset")])
    write(tmp_path, told, None, {"truths": [truths.as_json(truth)]})
    write(tmp_path, kept("drawn/clean/000", "clean", [effect("payload")]), None, {"answer": CLEAN})
    on_stand = {"answer": {**CLEAN, "case": "stand/x/0"}}
    write(tmp_path, kept("drawn/stand/clean/000", "clean", [], "stand"), None, on_stand)
    rows = rows_of(tmp_path, "later", cores=1)
    # Three decisions on each flight, on the drawn one the ideal observer too, the engine's on the stand.
    assert len(rows) == 3 * 3 + 1 + 1
    found = table(rows).set_index(["name", "decision"])
    assert found.loc[("flight planted", "engine"), "named"] == 0
    assert found.loc[("flight planted", "selection"), "named"] == 1
    assert found.loc[("flight drawn", "selection"), "alarmed"] == 1
    assert found.loc[("flight", "selection"), "sets"] == found.loc[("flight", "selection"), "older"] == 3
    assert ("stand", "selection") not in found.index
    assert "1 of 1" in markdown(table(rows))
    lines = sets(rows).set_index(["name", "decision"])
    assert lines.loc[("planted/somewhere/geometry/x/large/0", "engine"), "missed_names"] == "com_offset"
    assert lines.loc[("drawn/clean/000", "selection"), ["wrong", "wrong_names"]].tolist() == [1, "payload"]


def test_without_evidence_the_posterior_says_what_the_verdict_says():
    stopped = Kept(Label("drawn/x", "flight", "a", "b"), "k", "s", "e", 1.0, 1.0, {"failed": "no"}, None)
    assert posterior(stopped) == selection(stopped) == {"failed": "no"}


def test_the_ideal_observer_names_what_a_search_from_nothing_cannot_find():
    # Two columns that are nearly the same, and act against each other: by itself neither explains anything.
    terms = (term("drag/plain"), term("lift/plain"))
    seen = flight([0.0, 0.0], terms, alike=30.0)
    made = replace(seen, y=seen.y + 0.3 * (seen.x[:, :, 0] - seen.x[:, :, 1])).evidence()
    own = replace(kept("drawn/x/0", "x", []), evidence=made)
    answer = {**CLEAN, "effects": [{"id": "drag"}, {"id": "lift"}]}
    assert [e["id"] for e in posterior(own)["effects"]] == []
    assert {e["id"] for e in ideal_observer(own, answer)["effects"]} == {"drag", "lift"}
    # It is told where to start, not what to say.
    nothing = replace(own, evidence=seen.evidence())
    assert ideal_observer(nothing, answer)["effects"] == []


def test_selection_is_said_with_a_word_of_its_own():
    assert selection(kept("drawn/x/0", "x", []))["verdict"] == "no_mismatch"
    assert selection(kept("drawn/x/0", "x", [effect("gust")]))["verdict"] == "explained"
    assert json.dumps(selection(kept("drawn/x/0", "x", [])))


@pytest.mark.parametrize("status", ["not_established", "absorbed"])
def test_what_is_not_claimed_is_no_statement(status):
    for probability in (None, 1.0):
        unclaimed = {**effect("payload", status), "probability": probability}
        assert score_drawn(said(unclaimed), ANSWER).counts.said_99 == 0
