"""The page: a headline that can be read at a glance, numbers that come back, names that cannot break it."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotorid.mismatch.deliver import verdict_of, write_files
from rotorid.mismatch.headline import MOST_WORDS, headline, tiles
from rotorid.mismatch.page import by_share, make_page
from rotorid.mismatch.page_data import packed
from rotorid.mismatch.verdict import main_channel
from tests.unit.mismatch.synthetic import analysis, drag_finding

NASTY = '</script><img src=x onerror="document.title=1">&'


def data_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])


def page_of(made) -> str:
    return make_page(made, verdict_of(made))


CLASS = drag_finding(status="ambiguous", alternatives=("frame_drag", "rotor_drag", "translational_lift"))
OTHERS = [
    drag_finding(id=i, form=None, values=())
    for i in ("motor_lag", "ground_effect", "steady_wind", "unequal_rotors", "com_offset")
]


@pytest.mark.parametrize("findings", [(), (drag_finding(),), (CLASS,), (drag_finding(), *OTHERS), (CLASS, *OTHERS)])
@pytest.mark.parametrize("share", [0.0, 0.4, 0.95])
def test_the_headline_has_at_most_25_words_and_is_a_sentence(findings, share):
    made = analysis(findings=findings, dash=bool(findings), unexplained_share=share)
    verdict = verdict_of(made)
    text = headline(verdict, main_channel(made, verdict.locations, verdict.channels))
    assert 4 <= len(text.split()) <= MOST_WORDS
    assert text[0].isupper() and text.endswith(".")
    if findings and verdict.verdict == "partly_explained":
        assert "%" in text


def test_the_tiles_say_what_where_and_how_much():
    made = analysis(findings=[drag_finding()], dash=True)
    verdict = verdict_of(made)
    what, where, how_much = tiles(verdict, main_channel(made, verdict.locations, verdict.channels))
    assert what.large == "Rotor drag"
    assert "force" in where.large
    assert "→" in how_much.large and "noise" in how_much.small


def test_the_figures_hold_the_traces():
    made = analysis(findings=[drag_finding()], dash=True)
    data = data_of(page_of(made))
    shown = next(t for t in data["traces"] if t["channel"] == "force_x")
    trace = next(t for t in made.traces if (t.run, t.channel) == (shown["run"], "force_x"))
    values = np.frombuffer(base64.b64decode(shown["before"]["data"]), "<i2") * shown["before"]["scale"]
    np.testing.assert_allclose(values, trace.before[:: data["every"]], atol=shown["before"]["scale"])
    assert data["correlation"]["force_x"]["before"][0] == pytest.approx(1.0)


def test_missing_values_and_a_silent_channel_are_packed():
    assert packed(np.array([np.nan, 0.0]))["scale"] == 1.0
    whole = np.frombuffer(base64.b64decode(packed(np.array([np.nan, -2.0, 0.5]))["data"]), "<i2")
    assert whole.tolist() == [-32768, -32767, 8192]


def test_effects_come_in_the_order_of_their_share():
    class Shared:
        def __init__(self, share):
            self.share = share

    assert [e.share for e in by_share([Shared(0.1), Shared(None), Shared(0.7)])] == [0.7, 0.1, None]


def test_names_with_markup_cannot_leave_their_place():
    made = analysis(findings=[drag_finding()], dash=True)
    recordings = replace(made.recordings, name=NASTY)
    page = page_of(replace(made, recordings=recordings, notes=(NASTY,)))
    assert "<img src=x" not in page
    assert page.count("</script>") == 3


def test_a_ledger_is_shown_on_demand():
    made = analysis(findings=[drag_finding()])
    rows = [{"rule": "enter", "on": "rotor_drag", "sentence": "It explains enough.", "numbers": {"p": 1e-9}}]
    page = make_page(made, verdict_of(made), ledger=rows)
    assert "<details>" in page and "It explains enough." in page
    assert "<details>" not in page_of(made)


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.parametrize("width", [360, 800, 1280])
def test_chromium_draws_the_figures_without_an_error(tmp_path: Path, width: int):
    made = analysis(findings=[drag_finding()], dash=True)
    page = tmp_path / "report.html"
    write_files(made, tmp_path / "verdict.json", page, tmp_path / "v.yaml")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"]
    done = subprocess.run([*command, f"--window-size={width},900", page.as_uri()], capture_output=True, text=True)
    assert "CONSOLE" not in done.stderr
    assert done.stdout.count('class="u-over"') >= 2
