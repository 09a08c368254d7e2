"""Which concealed cases a proof takes."""

from pathlib import Path

import pytest
import yaml

from rotorid_proof import plan
from rotorid_proof.concealed.build import index_text
from rotorid_proof.concealed.cases import with_names

ROOT = Path(__file__).parents[3]
INDEX = ROOT / "proof/rotorid_proof/concealed/cases.tsv"


def test_the_list_of_cases_is_current() -> None:
    assert INDEX.read_text() == index_text(), "python -m rotorid_proof.concealed.build --write-index"


def test_names_of_sets_say_nothing_and_are_unique() -> None:
    entries = plan.read_index(INDEX)
    assert len({e.set for e in entries}) == len(entries)
    assert all(e.family not in e.set for e in entries)


def test_seeds_and_patterns_choose() -> None:
    entries = [plan.Entry(f"{f}/x/{k}", f"set-{f}{k}") for f in ("single", "clean") for k in range(3)]
    assert [e.case for e in plan.choose(entries, {"single": 2}, ["*"])] == ["single/x/0", "single/x/1"]
    assert [e.case for e in plan.choose(entries, {"single": 3, "clean": 3}, ["clean/*/2"])] == ["clean/x/2"]


def test_an_instruments_family_is_its_kind_and_the_kind_of_case() -> None:
    entries = [
        plan.Entry(f"{case}/{k}", f"set-{k}") for case in ("stand/clean", "bench/single/creep/weak") for k in (0, 1)
    ]
    chosen = plan.choose(entries, {"stand-clean": 2, "bench-single": 1, "clean": 9, "single": 9}, ["*"])
    assert [e.case for e in chosen] == ["stand/clean/0", "stand/clean/1", "bench/single/creep/weak/0"]
    assert [name.rsplit("-", 1)[0] for name in plan.batches(chosen, 8)] == ["stand-clean-000", "bench-single-000"]


@pytest.mark.parametrize("part", ["config.yaml", "tests/configs/proof_hour.yaml"])
def test_every_family_of_the_list_is_asked_for(part: str) -> None:
    seeds = yaml.safe_load((ROOT / part).read_text())["proof"]["seeds"]
    assert set(seeds) == {e.family for e in plan.read_index(INDEX)}


def test_the_small_proof_holds_stands_and_benches() -> None:
    patterns = yaml.safe_load((ROOT / "tests/configs/small.yaml").read_text())["proof"]["cases"]
    seeds = yaml.safe_load((ROOT / "config.yaml").read_text())["proof"]["seeds"]
    chosen = {e.family for e in plan.choose(plan.read_index(INDEX), seeds, patterns)}
    assert {"stand-single", "stand-clean", "bench-single"} <= chosen


def test_a_release_draws_the_listed_families_anew_with_its_date() -> None:
    entries = plan.read_index(INDEX)
    drawn = plan.released(entries, "2026-11-30")
    assert {e.family for e in drawn} == {f"{s}{c}" for s in plan.DRAWN for c in ("", "-clean")}
    assert all("/2026-11-30/" in e.case for e in drawn) and not {e.case for e in drawn} & {e.case for e in entries}
    assert plan.released(entries, "") == []
    cases = with_names([drawn[0].case, entries[0].case])
    assert [c.name for c in cases] == [drawn[0].case, entries[0].case]


@pytest.mark.parametrize("part", ["seeds", "released"])
def test_a_quarter_of_the_drawn_cases_is_clean(part: str) -> None:
    settings = yaml.safe_load((ROOT / "config.yaml").read_text())["proof"]
    entries = [e for e in plan.read_index(INDEX) if plan.DEVELOPMENT in e.case]
    for simulator in plan.DRAWN:
        own = [e for e in plan.choose(entries, settings[part], ["*"]) if e.family.startswith(simulator)]
        assert 4 * sum(e.family.endswith("clean") for e in own) >= len(own) > 0


def test_time_is_foretold_by_kind() -> None:
    stand, flight = plan.Entry("stand/clean/0", "a"), plan.Entry("clean/0", "b")
    jobs = 2 * plan.START_S
    assert plan.estimate_s([[stand, stand]], peers=False, cores=1) == 2 * plan.INSTRUMENT_S + jobs
    assert plan.estimate_s([[flight]], peers=False, cores=1) == plan.BUILD_S + plan.JUDGE_S + jobs


def test_more_seeds_leave_full_batches_as_they_were() -> None:
    entries = [plan.Entry(f"single/{effect}/{k}", "s") for effect in "abcd" for k in range(3)]
    few = plan.batches(plan.choose(entries, {"single": 1}, ["*"]), 2)
    many = plan.batches(plan.choose(entries, {"single": 3}, ["*"]), 2)
    assert all(many[name] == own for name, own in few.items())
    assert sum(map(len, many.values())) == 12


def test_a_batch_of_other_cases_has_another_name() -> None:
    """What was judged under another plan must not be taken for it."""
    entries = [plan.Entry(f"single/{effect}/0", "s") for effect in "abc"]
    assert not set(plan.batches(entries[:2], 2)) & set(plan.batches(entries[1:], 2))


def test_the_announcement_counts_what_is_done() -> None:
    chosen = plan.batches([plan.Entry(f"single/a/{k}", "s") for k in range(4)], 2)
    said = plan.announcement(chosen, [next(iter(chosen))], peers=False)
    assert "4 concealed cases in 2 batches, 2 judged before" in said
