"""Effects of other packages: found where they are installed, refused where they are none or take another's id."""

import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from tests import packages

SQUARED = """
from dataclasses import replace
from rotorid.effects.frame_drag import EFFECT as OTHER
EFFECT = replace(OTHER, id={id!r}, name="drag of a parachute")
NONE = 3
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs a package whose effect has an id, under an entry point to one of its names."""

    def install(effect_id: str, name: str = "EFFECT") -> None:
        text, points = SQUARED.format(id=effect_id), f"[rotorid.effects]\nparachute = parachutes:{name}\n"
        packages.installed(tmp_path, monkeypatch, "parachutes", text, points)
        catalogue.cache_clear()

    yield install
    monkeypatch.undo()
    catalogue.cache_clear()
    assert "parachute" not in catalogue()


def test_an_effect_of_an_installed_package_is_in_the_catalogue(installed):
    before = set(catalogue())
    installed("parachute")
    assert set(catalogue()) == before | {"parachute"} and catalogue()["parachute"].name == "drag of a parachute"
    assert list(catalogue()) == sorted(catalogue())


def test_an_id_that_is_taken_is_refused(installed):
    installed("frame_drag")
    with pytest.raises(InputError, match="parachutes:EFFECT of rotorid.effects: .* frame_drag is in"):
        catalogue()


def test_what_is_no_effect_is_refused(installed):
    installed("parachute", "NONE")
    with pytest.raises(InputError, match="parachutes:NONE of rotorid.effects: expected an Effect, not int"):
        catalogue()
