"""Importers of other packages: found where they are installed, refused where they are none or take another's name."""

import re
from pathlib import Path

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid.recordings.importers.logfile import importers, read_log, set_of_logs
from tests import packages

ROOT = Path(__file__).parents[4]
OWN = re.search(r"```\n(\"\"\"Logs.*?)```", (ROOT / "docs/own-log.md").read_text(encoding="utf-8"), re.DOTALL)[1]
"""The importer that the documentation shows."""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs a package with an importer of a name, under an entry point to one of its names."""

    def install(name: str = "hangar", point: str = "IMPORTER") -> None:
        text = OWN.replace('    "hangar",', f"    {name!r},") + "\nNONE = 3\n"
        packages.installed(tmp_path, monkeypatch, "hangars", text, f"[rotorid.importers]\nhangar = hangars:{point}\n")
        importers.cache_clear()

    yield install
    monkeypatch.undo()
    importers.cache_clear()
    assert "hangar" not in importers()


def test_a_log_is_read_by_the_importer_of_an_installed_package(installed, tmp_path):
    installed()
    path, time_s = tmp_path / "first.hgr", np.arange(1500) / 100
    rows = [f"{t:.2f},{4 * np.degrees(np.sin(7 * t)):.6f},0,-2" for t in time_s]
    path.write_text("\n".join(["HANGAR1", "t,p,q,r", *rows, ""]))
    found = read_log(path)
    (run,) = found.runs.values()
    assert found.format == "hangar" and len(run) > 1000
    np.testing.assert_allclose(run["angular_velocity_x_rad_s"], 2 * np.sin(7 * run["time_s"]), atol=1e-6)
    np.testing.assert_allclose(run["angular_velocity_z_rad_s"], np.radians(1))
    assert set_of_logs([path], "hangar").axes == "body forward-left-up, turned into FRD"
    path.write_text("HANGAR1\nt,p,q\n0,1,2\n")
    with pytest.raises(InputError, match="first.hgr: expected columns t, p, q and r, found t, p, q"):
        read_log(path)


def test_a_name_that_is_taken_is_refused(installed):
    installed("px4")
    with pytest.raises(InputError, match="hangars:IMPORTER of rotorid.importers: an importer px4 is there already"):
        importers()


def test_what_is_no_importer_is_refused(installed):
    installed(point="NONE")
    with pytest.raises(InputError, match="hangars:NONE of rotorid.importers: expected an Importer, not int"):
        importers()


@pytest.mark.parametrize("importer", importers().values(), ids=lambda importer: importer.name)
def test_each_importer_says_what_the_documentation_needs(importer):
    assert importer.title and importer.holds and "|" not in importer.title + importer.known_by + importer.holds
