"""Limits of a flight: what is stated wrongly is said in one sentence."""

from pathlib import Path

import pytest

from rotorid.plan.candidates import Limits, SessionLimits, read_limits
from tests.refusals import refused


def refused_in_one_sentence(file: Path, text: str, said: str, kind: type = Limits) -> None:
    file.write_text(text, encoding="utf-8")
    told = refused(said, read_limits, file, kind)
    assert "\n" not in told and str(file) in told


def test_without_a_file_the_usual_ones_hold() -> None:
    assert read_limits(None) == Limits()


def test_a_file_is_read_and_what_it_leaves_out_is_as_usual(tmp_path: Path) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text("speed_m_s: 5\nheight_m: [1, 8]\nwall_margin_m: 1\n", encoding="utf-8")
    limits = read_limits(file)
    assert (limits.speed_m_s, limits.tilt_deg) == (5.0, Limits().tilt_deg)
    assert limits.room_m == (2.0, 2.0, 3.0) and limits.middle_m == (0.0, 0.0, 4.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed: 3\n", "speed is no limit"), ("duratoin_s: 3\n", "; did you mean duration_s?"),
        ("speed_m_s: -1\n", "speed_m_s"), ("speed_m_s: fast\n", "speed_m_s"),
        ("x_m: [2, -2]\n", "lower number first"), ("x_m: [1, 4]\n", "must hold 0"),
        ("height_m: [-1, 3]\n", "below the ground"), ("wall_margin_m: 5\n", "no room"),
        ("duration_s: 1\n", "duration_s"), ("- speed\n", "expected lines such as"), ("", "found nothing"),
        ("speed_m_s: yes\n", "found yes or no"), ("height_m: 3\n", "height_m"), ("height_m: [1, 2, 3]\n", "height_m"),
        ("tilt_deg: 90\n", "tilt_deg"), ("speed_m_s: .nan\n", "speed_m_s"),
        ("position_bandwidth_rad_s: 8\n", "does not hold"), ("home_deg: [120, 7]\n", "latitude and longitude"),
        ("3: 4\n", "limit"), ("speed_m_s: 3\nspeed_m_s\n", "not valid YAML"), ("speed_m_s: [1\n", "not valid YAML"),
        ("speed_m_s: 03\n", "line 1: found 03, which YAML takes for 3"), ("speed_m_s: 1:30\n", "takes for 90"),
        ("speed_m_s: '3'\n", "found '3', expected a number"), ("speed_m_s: 3\nspeed_m_s: 4\n", "is there twice"),
    ],
)  # fmt: skip
def test_a_wrong_limit_ends_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    refused_in_one_sentence(tmp_path / "limits.yaml", text, said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed_m_s: 3\n", "speed_m_s is no limit; known are duration_s"),
        ("load_share: 3\n", "load_share"),
        ("wait_s: no\n", "found yes or no"),
        ("duration_s: -1\n", "duration_s"),
    ],
)
def test_a_wrong_limit_of_a_session_ends_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    refused_in_one_sentence(tmp_path / "limits.yaml", text, said, SessionLimits)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    refused("file is missing", read_limits, tmp_path / "room.yaml")
