"""The answers of the proof are opened by the scoring rule alone."""

import re
from pathlib import Path

import pytest
from test_rules import RULES, WORKING

from rotorid.report.provenance import Code

ROOT = Path(__file__).parents[2]
OPENS = {"score_proof", "score_ablation", "score_campaign"}
WRITES = {"conceal"}


def part(text: str, name: str) -> str:
    """The `input:`, `params:` ... of a rule."""
    found = re.search(rf"^    {name}:\n((?:        .*\n)+)", text, flags=re.MULTILINE)
    return found[1] if found else ""


@pytest.mark.parametrize("name", RULES)
def test_no_rule_but_the_scoring_takes_an_answer(name: str) -> None:
    taken = part(RULES[name], "input") + part(RULES[name], "params")
    assert ("sealed" in taken) == (name in OPENS)


@pytest.mark.parametrize("name", WORKING)
def test_no_script_but_these_and_no_module_knows_of_the_sealed_folder(name: str) -> None:
    script = re.search(r"scripts/(\w+)\.py", WORKING[name])[1]
    text = (ROOT / "workflow/scripts" / f"{script}.py").read_text()
    assert script in OPENS | WRITES or "sealed" not in text


def test_the_mismatch_stage_does_not_know_that_there_are_answers() -> None:
    code = Code(ROOT)
    reached = code.reached_modules(ROOT / "workflow/scripts/mismatch.py")
    assert len(reached) > 50
    for path in reached:
        text = path.read_text()
        assert "sealed" not in text and "concealed" not in text, path
    judging = code.reached_modules(ROOT / "workflow/scripts/judge.py")
    assert {path.stem for path in judging if path.parent.name == "rotorid_proof"} == {"__init__", "judge"}
    ablating = code.reached_modules(ROOT / "workflow/scripts/ablate.py")
    assert {path.stem for path in ablating if path.parent.name == "rotorid_proof"} == {"__init__", "without_rules"}


def test_judging_and_the_mismatch_rule_never_see_case_names() -> None:
    for name in ("judge", "mismatch", "ask_peers", "judge_with_all_rules", "judge_without_rule"):
        assert "cases_of" not in RULES[name]
        assert "answers" not in part(RULES[name], "input") + part(RULES[name], "params")
