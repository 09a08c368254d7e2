"""Tables, figure and page of a fleet from verdicts written by hand."""

import html
import json
import re
from pathlib import Path

import pytest

from rotorid.report.fleet import by_effect, by_vehicle, collect, day_of, make_page
from rotorid.report.plots.mismatch import draw_fleet


def effect(name: str, status: str, value: float = 1.0, share: float | None = 0.5) -> dict:
    parameters = [{"symbol": "k", "value": value, "unit": "N", "interval_95": [value - 0.1, value + 0.1]}]
    return {"id": name, "status": status, "share": share, "parameters": parameters}


@pytest.fixture
def fleet(tmp_path: Path) -> tuple[list[Path], Path]:
    """Verdicts on five sets of two vehicles."""
    said = {
        "heron-2026-11-03": ("explained", 0.02, [effect("rotor_drag", "established", 1.0)], {}),
        "heron-2026-11-09": ("explained", 0.01, [effect("rotor_drag", "established", 1.4)], {}),
        "swift_20261101": (
            "partly_explained",
            0.3,
            [effect("rotor_drag", "established", 2.0), effect("payload", "ambiguous"), effect("delay", "absorbed")],
            {"mass_kg": {"believed": 1.0, "refitted": 1.1, "interval_95": [1.05, 1.15]}},
        ),
        "swift_20261102": ("unexplained", 0.9, [effect("frame_drag", "suggested", share=None)], {}),
        "swift_later": ("explained", 0.0, [effect("axis_sign", "established")], {}),
    }
    recordings, out = tmp_path / "sets", tmp_path / "verdicts"
    for name, (word, left, effects, values) in said.items():
        (out / name).mkdir(parents=True)
        (recordings / name).mkdir(parents=True)
        (recordings / name / "vehicle.yaml").write_text(f"name: {name[:5]}\n")
        content = {
            "verdict": word,
            "sentence": f"what is said of <{name}>",
            "unexplained": {"share": left},
            "effects": effects,
            "parameters": values,
        }
        (out / name / "verdict.json").write_text(json.dumps(content))
    (out / "broken").mkdir()
    (out / "broken" / "failed.json").write_text(json.dumps({"reason": "run.csv: empty", "fault": False}))
    return sorted(out.iterdir()), recordings


def page_of(collected, figure: Path, links: dict[str, str] | None = None) -> str:
    """The page on what was collected, its figure drawn anew."""
    sets, effects, parameters = collected
    counts = by_effect(effects, sets)
    draw_fleet(counts, parameters, sets, figure)
    return make_page("sets", sets, counts, by_vehicle(effects, sets), links or {}, figure)


def test_what_needs_a_person_and_what_stands_by_itself(fleet) -> None:
    sets, _, _ = collect(*fleet)
    why = dict(zip(sets["set"], sets["person"], strict=True))
    assert why["heron-2026-11-03"] == why["heron-2026-11-09"] == ""
    assert why["broken"] == "the set cannot be judged"
    unclear = "cannot be distinguished from another cause: payload"
    assert why["swift_20261101"] == f"30% of the mismatch unexplained; {unclear}"
    assert why["swift_20261102"] == ("a mismatch that nothing of the catalogue explains; only suggested: frame_drag")
    assert why["swift_later"] == "a mistake in the set: axis_sign"
    assert dict(zip(sets["set"], sets["vehicle"], strict=True))["swift_later"] == "swift"


def test_effects_are_counted_and_numbers_listed_with_their_intervals(fleet) -> None:
    sets, effects, parameters = collect(*fleet)
    counts = by_effect(effects, sets).set_index("effect")
    assert counts.index[0] == "rotor_drag" and "delay" not in counts.index
    assert counts.loc["rotor_drag", ["of_sets", "established", "vehicles"]].tolist() == [5, 3, 2]
    assert counts.loc["payload", ["established", "ambiguous"]].tolist() == [0, 1]
    drag = parameters[parameters["parameter"] == "rotor_drag.k"]
    assert drag[["day", "value", "low_95"]].values.tolist() == [
        ["2026-11-03", 1.0, 0.9],
        ["2026-11-09", 1.4, pytest.approx(1.3)],
        ["2026-11-01", 2.0, 1.9],
    ]
    assert parameters[parameters["parameter"] == "mass_kg"]["value"].tolist() == [1.1]


def test_each_vehicle_with_what_its_sets_establish(fleet) -> None:
    sets, effects, _ = collect(*fleet)
    table = by_vehicle(effects, sets).set_index("vehicle")
    assert table.loc["heron", ["sets", "failed", "person", "effects"]].tolist() == [2, 0, 0, "rotor_drag 2"]
    assert table.loc["swift", ["sets", "person", "effects"]].tolist() == [3, 3, "axis_sign 1, rotor_drag 1"]
    assert table.loc["swift", "last"] == "unexplained"
    assert table.loc["broken", ["failed", "effects", "last"]].tolist() == [1, "", "failed"]


@pytest.mark.parametrize(
    ("name", "day"),
    [("a-2026-11-03-b", "2026-11-03"), ("20261103", "2026-11-03"), ("run12026110399", ""), ("2026-13-01", "")],
)
def test_days_in_names(name: str, day: str) -> None:
    assert day_of(name) == day


def test_the_page_shows_everything_and_the_same_twice(fleet, tmp_path: Path) -> None:
    links = {"swift_later": "there/report.html"}
    pages = [page_of(collect(*fleet), tmp_path / f"{name}.svg", links) for name in ("one", "two")]
    assert pages[0] == pages[1]
    assert "6 sets of 3 vehicles" in pages[0] and "<b>4</b> need a person" in pages[0]
    assert "&lt;swift_20261102&gt;" in pages[0] and "<svg" in pages[0]
    assert 'href="there/report.html"' in pages[0]


def test_no_script_runs_on_the_page_and_it_fetches_nothing(fleet, tmp_path: Path) -> None:
    page = page_of(collect(*fleet), tmp_path / "f.svg")
    head = page[: page.index("<style>")]
    policy = html.unescape(re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', head)[1])
    assert "default-src 'none'; script-src 'none'; " in policy


def test_a_fleet_without_any_verdict(tmp_path: Path) -> None:
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "failed.json").write_text(json.dumps({"reason": "empty", "fault": True}))
    assert "0 sets" not in page_of(collect([tmp_path / "broken"], tmp_path), tmp_path / "f.svg")
