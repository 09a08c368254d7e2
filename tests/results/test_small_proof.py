"""The small proof's outcome, once `snakemake proof --configfile tests/configs/small.yaml` has made it."""

from pathlib import Path

import pandas as pd
import pytest

CASES = Path(__file__).parents[2] / "results/proof/cases.csv"
NAMED = (
    "single/rotor_drag/strong/0", "single/motor_lag/strong/0", "mistake/rotor_order/all/1",
    "stand/single/com_offset/moderate/0", "bench/single/crosstalk/moderate/0",
)  # fmt: skip
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not CASES.is_file(), reason="no proof has been run here")]


@pytest.fixture(scope="module")
def cases() -> pd.DataFrame:
    return pd.read_csv(CASES).set_index("case")


def test_nothing_stopped(cases: pd.DataFrame) -> None:
    assert not cases["failed"].any()


@pytest.mark.parametrize("name", NAMED)
def test_the_hidden_effect_is_named(cases: pd.DataFrame, name: str) -> None:
    assert cases.loc[name, "named"] and cases.loc[name, "false_count"] == 0


@pytest.mark.parametrize("name", ["clean/000", "stand/clean/000"])
def test_a_clean_recording_raises_no_alarm(cases: pd.DataFrame, name: str) -> None:
    assert not cases.loc[name, "false_alarm"]


def test_stands_and_benches_have_rows_of_their_own(cases: pd.DataFrame) -> None:
    rows = pd.read_csv(CASES.with_name("summary.csv")).set_index("id")["value"]
    assert rows["stand_clean_alarms"] == 0 and rows["stand_single_named"] == 1 and rows["bench_single_named"] == 1


@pytest.mark.parametrize("name", ["wrong/mass_kg/1", "wrong/inertia_zz_kg_m2/2"])
def test_a_wrong_value_is_not_called_physics(cases: pd.DataFrame, name: str) -> None:
    assert pd.isna(cases.loc[name, "claims"]) and isinstance(cases.loc[name, "values_claimed"], str)


def test_a_cause_outside_the_catalogue_gets_no_name(cases: pd.DataFrame) -> None:
    assert cases.loc["outside/tether/0", "false_count"] == 0
    assert cases.loc["outside/tether/0", "word"] in ("unexplained", "partly_explained")
