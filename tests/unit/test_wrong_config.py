"""Wrong configurations: one sentence that names the key, what stands there and what is expected."""

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rotorid.errors import InputError
from rotorid_lab.black_box import conformal_coverage, folds
from rotorid_lab.config import check, from_command_line
from rotorid_proof import plan
from tests.refusals import refused

ROOT = Path(__file__).parents[2]
SOUND = yaml.safe_load((ROOT / "config.yaml").read_text())
CASES = plan.read_index(ROOT / "proof" / "rotorid_proof" / "concealed" / "cases.tsv")
INF, NAN = float("inf"), float("nan")
WRONG = [
    ("recordings", 7, "expected text"),
    ("recordings", "", "at least 1 character"),
    ("recordings", None, "expected text"),
    ("recordings", ["a"], "expected text"),
    ("recordings", True, "expected text"),
    ("raw", 7, "expected text"),
    ("filter", 5, "expected keys with values"),
    ("filter.bench", [], "expected keys with values"),
    ("filter.bench.low_pass_hz", -1.0, "0.01 or more"),
    ("filter.bench.low_pass_hz", 0.0, "0.01 or more"),
    ("filter.bench.low_pass_hz", 25.0, "less than 25"),
    ("filter.bench.low_pass_hz", INF, "a finite number"),
    ("filter.bench.low_pass_hz", NAN, "a finite number"),
    ("filter.bench.low_pass_hz", "1.5", "expected a number"),
    ("filter.bench.low_pass_hz", "1e-3", "with a point and a sign: 1.0e-3"),
    ("filter.bench.low_pass_hz", True, "expected a number"),
    ("filter.bench.low_pass_hz", None, "expected a number"),
    ("filter.bench.spike_window", 2, "3 or more"),
    ("filter.bench.spike_window", 5.5, "a whole number"),
    ("filter.jr3.steady_tolerance", INF, "a finite number"),
    ("bench.noise_n", -0.1, "0 or more"),
    ("bench.matrix_largest_n", INF, "a finite number"),
    ("stand.clock_error", 0.5, "less than 0.1"),
    ("stand.speed_noise_relative", 0.3, "less than 0.2"),
    ("residuals.cutoff_hz", 200.0, "less than 190"),
    ("residuals.seed", -1, "0 or more"),
    ("simulation.step_s", 0.02, "at most 0.01"),
    ("simulation.duration_s", NAN, "a finite number"),
    ("grey_box.rotor_epochs", 0, "1 or more"),
    ("grey_box.speed_limits_rad_s", [1900.0, 300.0], "expected [low, high] with 0 <= low < high"),
    ("grey_box.speed_limits_rad_s", [-300.0, 300.0], "expected [low, high] with 0 <= low < high"),
    ("grey_box.speed_limits_rad_s", [300.0, 300.0], "expected [low, high] with 0 <= low < high"),
    ("grey_box.speed_limits_rad_s", [0.0, INF], "a finite number"),
    ("grey_box.speed_limits_rad_s", [1.0], "grey_box.speed_limits_rad_s"),
    ("grey_box.speed_limits_rad_s", 5.0, "a list"),
    ("grey_box.design_limits_rad_s", [550.0, NAN], "a finite number"),
    ("grey_box.design_harmonics", [80, 10], "0 <= low < high"),
    ("grey_box.design_harmonics", [-10, 10], "0 <= low < high"),
    ("grey_box.band_hz", [-5.0, 15.0], "0 <= low < high"),
    ("grey_box.band_hz", [15.0, 5.0], "0 <= low < high"),
    ("grey_box.design_tilt_deg", 80.0, "less than 60"),
    ("black_box.hidden", [20, -20], "1 or more"),
    ("black_box.hidden", [20, 0], "1 or more"),
    ("black_box.hidden", [], "at least one entry"),
    ("black_box.hidden", 20, "a list"),
    ("black_box.hidden", [20.5], "a whole number"),
    ("black_box.share", 1.0, "less than 1"),
    ("proof.seeds", 5, "keys with values"),
    ("proof.seeds.single", -1, "0 or more"),
    ("proof.seeds.single", 1.5, "a whole number"),
    ("proof.cases", [], "at least one entry"),
    ("proof.cases", "*", "a list"),
    ("proof.batch", 0, "1 or more"),
    ("proof.peers", "yes", "true or false"),
    ("proof.peers", 1, "true or false"),
    ("filter.bench.spike_window", 4, "an odd number"),
    ("filter.jr3.spike_window", 303, "at most 301"),
    ("filter.bench.steady_window", 10**9, "at most 301"),
    ("residuals.airspeed_bin_m_s", 1e-9, "0.01 or more"),
    ("residuals.block_s", 1e-9, "0.1 or more"),
    ("residuals.block_s", 1e9, "at most 60"),
    ("simulation.duration_s", 1.0, "greater than 1"),
    ("simulation.duration_s", 1e9, "at most 3600"),
    ("simulation.step_s", 1e-12, "1e-05 or more"),
    ("simulation.moment_n_m", 1e9, "at most 1"),
    ("simulation.force_n", 1e9, "at most 10"),
    ("simulation.correlation_s", 1e9, "at most 3600"),
    ("simulation.rate_noise_rad_s", 0.0, "1e-06 or more"),
    ("grey_box.rotor_rate", 100.0, "at most 10"),
    ("grey_box.inertia_rate", 100.0, "at most 10"),
    ("grey_box.rotor_epochs", 10**12, "at most 1e+07"),
    ("grey_box.inertia_epochs", 10**12, "at most 1e+07"),
    ("grey_box.rotor_hidden", -4, "1 or more"),
    ("grey_box.rotor_hidden", 10**6, "at most 1000"),
    ("grey_box.inertia_every", 10**6, "at most 100"),
    ("grey_box.design_period_s", 1e6, "at most 3600"),
    ("grey_box.design_candidates", 10**9, "at most 1e+06"),
    ("grey_box.flight_s", 1e6, "at most 3600"),
    ("grey_box.flight_step_s", 10.0, "a step of which a whole number makes up 0.004 s"),
    ("grey_box.flight_step_s", 0.003, "a step of which a whole number makes up 0.004 s"),
    ("grey_box.motor_time_s", 30.0, "at most 1"),
    ("grey_box.draws", 10**6, "at most 1000"),
    ("grey_box.block_s", 0.001, "0.1 or more"),
    ("black_box.rate", 1e3, "at most 10"),
    ("black_box.epochs", 10**12, "at most 1e+07"),
    ("black_box.hidden", [20, 10**6], "at most 1000"),
    ("proof.release", "2026-02-30", "a day of the calendar"),
    ("proof.release", "20261130", "a day of the calendar"),
    ("proof.release", "tomorrow", "a day of the calendar"),
    ("report.title", 5, "expected text"),
    ("report.chapters", [], "at least one entry"),
    ("report.chapters", ["../../etc"], "small letters"),
    ("report.chapters", ["A b"], "small letters"),
    # before: taken, and every sample was steady, or a spike
    ("filter.bench.steady_tolerance", 1.0, "at most 1e-05"),
    ("filter.bench.steady_tolerance", 1e-12, "1e-10 or more"),
    ("filter.jr3.steady_tolerance", 500.0, "at most 10"),
    ("filter.bench.spike_threshold", 0.001, "2 or more"),
    ("filter.bench.spike_threshold", 1e9, "at most 1000"),
    ("filter.bench.zero_phase_hz", 1e-12, "0.01 or more"),
    ("bench.noise_n", 1e9, "at most 10"),
    ("bench.matrix_largest_n", 1e-12, "0.1 or more"),
    ("bench.reference_noise_n", 250.0, "at most 10"),
    ("stand.clock_error", 1e-12, "1e-07 or more"),
    ("stand.force_noise_n", 1e9, "at most 10"),
    ("stand.moment_noise_n_m", 1e9, "at most 1"),
    ("stand.thrust_noise_n", 1e9, "at most 10"),
    ("rotor.outlying_above", 0.0035, "1 or more"),
    ("rotor.outlying_above", 3500.0, "at most 100"),
    ("residuals.cutoff_hz", 1e-12, "0.1 or more"),
    ("grey_box.rotor_rate", 1e-12, "1e-06 or more"),
    ("grey_box.design_tilt_deg", 1e-12, "0.1 or more"),
    ("black_box.hidden", [20] * 50, "at most 10 entries"),
    ("black_box.held_out_samples", 1, "2 or more"),
    ("black_box.held_out_samples", 10**9, "at most 10000"),
    ("black_box.folds", 10**9, "at most 1000"),
    ("black_box.share", 1e-3, "0.5 or more"),
    ("proof.batch", 10**9, "at most 10000"),
    ("proof.cases", [" "], "text that is not blank"),
    ("proof.tables", "a\nb", "one line without control characters"),
    ("report.title", " ", "text that is not blank"),
    ("report.title", "Two\nlines", "one line without control characters"),
    ("report.subtitle", "red \x1b[31m", "one line without control characters"),
    ("report.title", "x" * 5000, "at most 200 characters, not 5000"),
]


TOGETHER = [
    ("design_limits_rad_s", [250.0, 1550.0], "to lie within speed_limits_rad_s, [300.0, 1900.0]"),
    ("design_limits_rad_s", [550.0, 2000.0], "to lie within speed_limits_rad_s, [300.0, 1900.0]"),
    ("design_harmonics", [0, 80], "low of 1 or more and three harmonics"),
    ("design_harmonics", [10, 11], "low of 1 or more and three harmonics"),
    ("design_harmonics", [10, 5000], "less than 125 Hz, half the rate of the readings"),
    ("flight_s", 5.0, "flight_s is 5, expected at least design_period_s, 10"),
    ("band_hz", [0.0, 15.0], "within 0 and 200 Hz, both not in it"),
    ("band_hz", [5.0, 200.0], "within 0 and 200 Hz, both not in it"),
    ("band_hz", [5.0, 5.01], "1 Hz between them or more"),
    ("speed_limits_rad_s", [300.0, 1e9], "reaches 1e+09, expected at most 100000"),
    ("design_limits_rad_s", [550.0, 551.0], "5 % above the lower or more"),
]


def with_value(key: str, value: Any) -> dict[str, Any]:
    """The project's own configuration with one value changed."""
    changed = copy.deepcopy(SOUND)
    *path, last = key.split(".")
    section = changed
    for part in path:
        section = section[part]
    section[last] = value
    return changed


def told(values: dict[str, Any]) -> str:
    """The one sentence on a wrong configuration."""
    with pytest.raises(InputError) as error:
        check(values)
    (sentence,) = str(error.value).splitlines()
    return sentence


@pytest.mark.parametrize(("key", "value", "said"), WRONG, ids=lambda x: repr(x)[:40])
def test_a_wrong_value_is_named(key: str, value: Any, said: str) -> None:
    text = told(with_value(key, value))
    assert text.startswith(f"config.yaml: {key}") and said in text
    foreign = ("Input should", "valid integer", "valid string", "pydantic", "NoneType")
    assert not any(words in text for words in foreign), text


@pytest.mark.parametrize(("key", "value", "said"), TOGETHER)
def test_values_that_do_not_go_together_are_named(key: str, value: Any, said: str) -> None:
    text = told(with_value(f"grey_box.{key}", value))
    assert text.startswith("config.yaml: grey_box: ") and key in text and said in text


@pytest.mark.parametrize("section", [k for k, v in SOUND.items() if isinstance(v, dict)])
def test_a_misspelled_key_of_each_section_gets_the_right_one(section: str) -> None:
    changed = copy.deepcopy(SOUND)
    key = next(iter(changed[section]))
    changed[section][key + "x"] = changed[section].pop(key)
    with pytest.raises(InputError) as error:
        check(changed)
    assert f"{section}.{key}x: no such key is known; did you mean {key}?" in str(error.value)


def test_an_unknown_family_of_the_proof_is_named() -> None:
    plan.check_families(CASES, SOUND["proof"]["seeds"])
    said = refused(r"proof\.seeds\.singel is no family of concealed cases", plan.check_families, CASES, {"singel": 1})
    assert "cases; did you mean single?" in said
    refused(r"proof\.released\.singel is no family", plan.check_families, CASES, {"singel": 1}, "proof.released")


def test_more_repetitions_than_a_family_has_are_named() -> None:
    """Before: three were taken in place of 300, without a word."""
    said = r"proof\.seeds\.single is 300, expected at most 3, all that there are"
    refused(said, plan.check_families, CASES, {"single": 300})


def test_a_proof_without_a_case_is_named() -> None:
    """Before: tables of no case were made, and the report's chapter shown from them."""
    entry = CASES[:1]
    plan.check_chosen(entry, [], "")
    plan.check_chosen([], entry, "2026-11-30")
    refused(r"proof\.seeds and proof\.cases leave no case; expected", plan.check_chosen, [], [], "")
    said = r"proof\.release is '2026-11-30', but proof\.released and proof\.cases leave"
    refused(said, plan.check_chosen, entry, [], "2026-11-30")


def test_a_folder_of_tables_that_is_not_there_is_named(tmp_path: Path) -> None:
    plan.check_tables(str(ROOT / "docs" / "proof"), ["summary.csv", "state.json"])
    plan.check_tables("results/proof/", ["summary.csv"])
    none, both = str(tmp_path / "none"), ["summary.csv", "state.json"]
    refused(r"proof\.tables is '.*/none', expected a folder", plan.check_tables, none, ["summary.csv"])
    refused(r"a folder that lacks summary\.csv and state\.json$", plan.check_tables, str(tmp_path), both)


def given(text: str) -> dict[str, Any]:
    """What Snakemake makes of `--config TEXT`: in braces every value is text."""
    from snakemake.cli import parse_config

    return parse_config([text])


def over(text: str) -> dict[str, Any]:
    """The project's configuration with that laid over it."""
    from snakemake.utils import update_config

    values = copy.deepcopy(SOUND)
    update_config(values, given(text))
    return from_command_line(values, given(text))


def test_numbers_in_braces_on_the_command_line_are_read() -> None:
    """Before: fleet={batch: 3} was refused with "found '3', expected a whole number (without quotes)"."""
    assert check(over("fleet={batch: 3}")).fleet.batch == 3
    assert check(over("bench={noise_n: 1e-3}")).bench.noise_n == 1e-3
    assert check(over("proof={peers: false}")).proof.peers is False
    assert check(over("black_box={hidden: [4, 5]}")).black_box.hidden == (4, 5)
    assert check(over("proof={released: {multibody: 1}}")).proof.released["multibody"] == 1
    assert check(over('proof={release: "2026-11-30"}')).proof.release == "2026-11-30"
    assert check(over('report={title: "5"}')).report.title == "5"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fleet={batch: 0}", "fleet.batch: found 0, expected a number of 1 or more"),
        ("fleet={batch: 010}", "fleet.batch: found '010', expected a whole number"),
        ("fleet={batch: 3x}", "fleet.batch: found '3x', expected a whole number"),
        ("fleet={batch: " + "9" * 5000 + "}", "fleet.batch: found '999"),
        ("fleet={bacth: 3}", "fleet.bacth: no such key is known; did you mean batch?"),
        ("proof={relased: {multibody: 1}}", "proof.relased: no such key is known; did you mean released?"),
    ],
)
def test_a_wrong_value_in_braces_is_named(text: str, said: str) -> None:
    assert told(over(text)).startswith(f"config.yaml: {said}")


def test_a_misspelled_family_in_braces_gets_the_right_one() -> None:
    """Before: "found '1', expected a whole number", of a family that there is not."""
    released = check(over("proof={released: {multibdy: 1}}")).proof.released
    said = r"proof\.released\.multibdy is no family .*; did you mean multibody\?"
    refused(said, plan.check_families, CASES, released, "proof.released")


def test_the_library_reads_yaml_in_one_place() -> None:
    """Another reader would take 0652 for 426 and the last of two equal keys."""
    others = [
        path.relative_to(ROOT).as_posix()
        for path in sorted((ROOT / "src").rglob("*.py"))
        if re.search(r"yaml\.(safe_load|load|full_load|unsafe_load)\b", path.read_text(encoding="utf-8"))
    ]
    assert others == []


def test_a_pattern_that_fits_no_case_is_named() -> None:
    cases = [entry.case for entry in CASES]
    plan.check_patterns(cases, SOUND["ablation"]["cases"], "ablation.cases")
    said = r"proof\.cases has 'singel/\*', expected a pattern that fits a name, as "
    refused(said, plan.check_patterns, cases, ["*", "singel/*"], "proof.cases")


def test_more_folds_than_experiments_are_refused() -> None:
    said = r"black_box\.folds is 4, expected at most the 3 experiments"
    refused(said, folds, np.array([1, 1, 2, 3]), 4, np.random.default_rng(0))


def test_an_interval_that_nothing_can_promise_is_refused() -> None:
    """Before: its width was infinite, and the report called that a calibrated interval."""
    experiments, values = np.repeat(np.arange(12), 2), np.zeros((24, 6))
    masks = [experiments % 3 == k for k in range(3)]
    conformal_coverage(values, values, experiments, masks, 0.88)
    said = r"black_box\.share is 0\.95, expected at most 0\.889, .* 8 experiments"
    refused(said, conformal_coverage, values, values, experiments, masks, 0.95)
