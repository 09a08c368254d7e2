"""What each rule is worth: which sets it is left out of, and what that changes."""

import json

from rotorid_proof import ablation
from rotorid_proof.without_rules import Judged, fires_in, read_stored, stored

ANSWER = {
    "case": "single/drag/0", "expected": ["rotor_drag"], "wrong_parameters": {}, "outside_catalogue": [],
    "effects": [{"id": "rotor_drag", "form": "drag", "parameters": [], "equivalent": [], "size_over_noise": 3.0}],
    "locations": [], "verdict": ["explained"],
}  # fmt: skip


def verdict(*names: str, word: str = "explained") -> dict:
    effects = [{"id": n, "status": "established", "alternatives": [], "p_value": 1e-9, "parameters": []} for n in names]
    return {"verdict": word, "effects": effects, "parameters": {}, "locations": [], "channels": {}}


def judged(name: str, *names: str, fired=(), seconds: float = 1.0) -> Judged:
    return Judged(name, verdict(*names), {rule: 1 for rule in fired}, 1, seconds)


def test_a_rule_is_left_out_where_it_fired_evenly_over_the_sets():
    base = [judged(str(k), fired=["size"] if k % 2 else []) for k in range(12)]
    assert [j.name for j in fires_in(base, "size", 3)] == ["1", "5", "9"]
    assert [j.name for j in fires_in(base, "size", 99)] == ["1", "3", "5", "7", "9", "11"]
    assert fires_in(base, "cancels", 3) == []


def test_what_leaving_a_rule_out_changes(tmp_path):
    base = [judged(n, "rotor_drag", fired=["size"]) for n in ("a", "b")] + [judged("c", "gust", fired=["size"])]
    for j in base:
        (tmp_path / f"{j.name}.json").write_text(json.dumps({**ANSWER, "set": j.name}))
    without = [judged("a", "rotor_drag", "gust", seconds=3.0), judged("b", "rotor_drag"), judged("c", "rotor_drag")]
    row = ablation.row("size", base, without, tmp_path)
    assert (row["fired"], row["judged"], row["righted"], row["wronged"]) == (3, 3, 1, 1)
    assert row["words_righted"] == row["words_wronged"] == 0 and row["seconds_saved"] == 0.67
    assert ablation.table([row]).decides[0].startswith("An effect is not kept if its strongest tenth")


def test_the_share_righted_has_an_interval():
    assert ablation.share_interval(0, 0) == (0.0, 1.0)
    assert ablation.share_interval(5, 0) == (0.478, 1.0)  # 1 - 0.975^... : 0.025^(1/5)
    assert ablation.share_interval(0, 5) == (0.0, 0.522)


def test_verdicts_are_read_back_as_written(tmp_path):
    path = tmp_path / "all.jsonl"
    path.write_text(stored([judged("a", "rotor_drag", fired=["size"])]))
    assert read_stored(path) == [judged("a", "rotor_drag", fired=["size"])]
