"""The catalogue in words: the page holds every effect, the command prints it."""

import re

import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.describe import in_full, listing, markdown, rows
from tests.command_line import invoke
from tests.hooks import hook


def test_the_page_is_the_catalogue():
    page = markdown()
    assert hook("site").pages()["effects.md"] == page
    assert sorted(re.findall(r"^### `(\w+)`", page, flags=re.M)) == sorted(catalogue())
    for effect in catalogue().values():
        own = page.split(f"### `{effect.id}`")[1].split("\n### ")[0]
        assert effect.sign in own and effect.source in own
        assert all(row[1].replace("|", "\\|") in own for row in rows(effect)), effect.id


def test_the_list_has_a_line_for_every_effect():
    lines = listing().splitlines()
    assert [line.split()[0] for line in lines] == list(catalogue())


def test_one_in_full_says_equation_range_columns_and_what_to_fly():
    text = in_full(catalogue()["rotor_drag"])
    # 5 1/s · 0.652 kg / (4 · 1073.3 rad/s) = 7.59e-4
    assert "k_d from 0 to 0.000759 N s2/(rad m): in-plane drag per rotor speed and airspeed" in text
    assert "F_i = −k_d ω_i v_i,⊥" in text
    assert "rotor_speed_*_rad_s, or rotor_command_*_rad_s, or throttle_*" in text
    assert "fly a speed sweep beyond 10 m/s" in text and "Faessler" in text


def test_forms_that_differ_by_a_number_share_a_row():
    assert rows(catalogue()["unequal_rotors"])[0][0] == ("rotor 1", "rotor 2", "rotor 3", "rotor 4")
    assert sum(len(names) for names, *_ in rows(catalogue()["sensor_dropout"])) == 27
    assert len(rows(catalogue()["motor_lag"])) == 3


@pytest.mark.parametrize(
    ("arguments", "code", "shown"),
    [
        (["effects"], 0, "translational_lift"),
        (["effects", "delay"], 0, "positive T is late"),
        (["effects", "--markdown"], 0, "# The catalogue of effects"),
        (["effects", "magic"], 1, "no effect is called 'magic'"),
    ],
)
def test_the_command(arguments, code, shown):
    result = invoke(*arguments)
    assert result.exit_code == code and shown in result.output
