"""Which concealed cases a proof takes."""

from pathlib import Path

from rotorid.proof import plan
from tests.concealed.build import index_text

ROOT = Path(__file__).parents[3]
INDEX = ROOT / "tests/concealed/cases.tsv"


def test_the_list_of_cases_is_current() -> None:
    assert INDEX.read_text() == index_text(), "python -m tests.concealed.build --write-index"


def test_names_of_sets_say_nothing_and_are_unique() -> None:
    entries = plan.read_index(INDEX)
    assert len({e.set for e in entries}) == len(entries)
    assert all(e.family not in e.set for e in entries)


def test_seeds_and_patterns_choose() -> None:
    entries = [plan.Entry(f"{f}/x/{k}", f"set-{f}{k}") for f in ("single", "clean") for k in range(3)]
    assert [e.case for e in plan.choose(entries, {"single": 2}, ["*"])] == ["single/x/0", "single/x/1"]
    assert [e.case for e in plan.choose(entries, {"single": 3, "clean": 3}, ["clean/*/2"])] == ["clean/x/2"]


def test_more_seeds_leave_full_batches_as_they_were() -> None:
    entries = [plan.Entry(f"single/{effect}/{k}", "s") for effect in "abcd" for k in range(3)]
    few = plan.batches(plan.choose(entries, {"single": 1}, ["*"]), 2)
    many = plan.batches(plan.choose(entries, {"single": 3}, ["*"]), 2)
    assert all(many[name] == own for name, own in few.items())
    assert sum(map(len, many.values())) == 12


def test_the_announcement_counts_what_is_done() -> None:
    entries = [plan.Entry(f"single/a/{k}", "s") for k in range(4)]
    said = plan.announcement(plan.batches(entries, 2), ["single-000"], peers=False)
    assert "4 concealed cases in 2 batches, 2 judged before" in said
