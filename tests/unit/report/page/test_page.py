"""The page: a headline that can be read at a glance, numbers that come back, names that cannot break it."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rotorid.mismatch.decide.findings import Delivery, ValueRow
from rotorid.mismatch.decide.sizes import segments_of
from rotorid.mismatch.tell.sentences import MOST_WORDS
from rotorid.mismatch.tell.steps import tiles
from rotorid.mismatch.tell.verdict import DerivativeOf, main_channel
from rotorid.recordings import Run
from rotorid.recordings.run import Doubt
from rotorid.report.deliver import verdict_of, write_files
from rotorid.report.page import by_share, make_page, next_text, pretty, strip
from rotorid.report.page.data import _first_shown, fit_percent, measured, packed
from tests.browser import CHROMIUM, Browser
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
def test_the_page_opens_with_the_sentence_of_the_verdict(findings):
    made = analysis(findings=findings, dash=bool(findings))
    verdict = verdict_of(made)
    assert f"<h1>{pretty(verdict.sentence)}</h1>" in make_page(made, verdict)
    assert 4 <= len(verdict.sentence.split()) <= MOST_WORDS
    assert verdict.sentence[0].isupper() and verdict.sentence.endswith(".")


def test_the_page_begins_with_doubts_and_shows_warnings_values_and_what_is_withheld():
    made = analysis(findings=[drag_finding(withheld="a plainer vehicle predicts as well")], dash=True)
    made = replace(
        made,
        doubts=(Doubt("mass_kg", "The mass is <in grams>.", stops=True),),
        believed_values=(
            ValueRow("mass_kg", 0.652, 0.70, 0.68, 0.72, 0.652),
            ValueRow("thrust_coefficient_n_s2", 6.0e-5, 6.25e-5, float("nan"), float("nan"), 6.0e-5),
        ),
        traces=tuple(replace(t, after=1.5 * t.after, refitted=t.after) for t in made.traces),
    )
    page = page_of(made)
    doubts, heading = page.index("Before you believe this"), page.index("<h1>")
    assert page.index("The verdict rests on 120 s in the air; none of it is on the ground; not recorded:") < doubts
    assert doubts < heading and "The mass is &lt;in grams&gt;." in page and 'class="word not_judged"' in page
    assert "What is delivered makes worse" in page and "is larger with the improved vehicle" in page
    assert "All believed values" in page and "0.700 ± 0.020" in page and page.count("(held by its bound)") == 1
    assert "Not delivered: a plainer vehicle predicts as well." in page


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


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory):
    if CHROMIUM is None:
        pytest.skip("needs Chromium")
    with Browser(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page whose names hold markup."""
    folder = tmp_path_factory.mktemp("page")
    made = analysis(findings=[drag_finding()], dash=True)
    made = replace(made, recordings=replace(made.recordings, name=NASTY), notes=(NASTY,))
    write_files(made, folder)
    return folder / "report.html"


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 800, 1280])
@pytest.mark.parametrize("dark", [False, True])
def test_chromium_draws_the_page_at_any_width_without_an_error(browser, written: Path, width: int, dark: bool):
    browser.said.clear()
    browser.open(written, width, dark=dark)
    assert browser.said == []
    assert browser.value("document.querySelectorAll('.u-over').length") == 4
    assert browser.value("document.documentElement.scrollWidth") <= width
    assert "made" not in browser.value("document.title") and browser.value("document.images.length") == 0
    background = browser.value("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", background))) < 200) == dark
    # Something is drawn on the replay's canvas.
    drawn = "new Set(document.getElementById('replay').getContext('2d').getImageData(0, 0, 300, 300).data).size"
    assert browser.value(drawn) > 3


@pytest.mark.slow
def test_the_page_can_be_used_by_keyboard(browser, written: Path):
    browser.open(written, 1280)
    shown = "(() => { const c = document.querySelector('#time .u-legend'); return c !== null; })()"
    assert browser.value(shown)
    order = []
    for _ in range(12):
        browser.press("Tab")
        order.append(browser.value("document.activeElement.id || document.activeElement.tagName"))
    assert [name for name in order if name in ("run", "channel", "whole", "time", "play", "frame", "replay")] == [
        "run", "channel", "whole", "time", "play", "frame", "replay"
    ]  # fmt: skip
    picture = "document.getElementById('replay').toDataURL()"
    before = browser.value(picture)
    browser.value("document.getElementById('replay').focus()")
    browser.press("ArrowLeft")
    assert browser.value(picture) != before
    browser.press(" ")
    assert browser.value("document.getElementById('play').textContent") == "pause"


@pytest.mark.slow
def test_no_other_script_runs_in_the_page(browser, written: Path, tmp_path: Path):
    page = tmp_path / "report.html"
    page.write_text(written.read_text().replace("</main>", "<script>document.title = 'taken'</script></main>"))
    browser.open(page, 800)
    assert browser.value("document.title") != "taken"
    browser.said.clear()


def test_measured_less_simulated_is_what_is_left():
    """On a recording whose force is mass times acceleration, the measured side is that, on the traces' instants."""
    made = analysis(findings=[drag_finding()], dash=True)
    readings = measured(made, segments_of(made))
    for trace, reading in zip(made.traces, readings, strict=True):
        if trace.channel == "force_z":
            np.testing.assert_allclose(reading, -made.believed.mass_kg * 9.81, rtol=1e-6)


def test_the_fit_is_a_hundred_where_nothing_is_left_and_nothing_where_the_mean_would_do():
    made = analysis(findings=[drag_finding()], dash=True)
    signal = [np.sin(t.time_s) for t in made.traces]
    perfect = [replace(t, before=s - s.mean(), after=0 * s) for t, s in zip(made.traces, signal, strict=True)]
    fits = fit_percent(replace(made, traces=tuple(perfect)), signal)
    for before, after in fits.values():
        assert after == pytest.approx(100)
        assert before == pytest.approx(0, abs=1e-6)


@pytest.mark.filterwarnings("error")
def test_runs_that_are_shorter_than_a_cell_of_the_strip_are_shown():
    """Before: IndexError on a bench or stand of ten rows a run."""
    made = analysis(findings=(drag_finding(),))
    rows = slice(0, 10)
    short = [
        replace(t, time_s=t.time_s[rows], before=t.before[rows], after=t.after[rows], refitted=t.refitted[rows])
        for t in made.traces
    ]
    picture, _, _ = strip(replace(made, traces=short), verdict_of(made))
    assert "svg" in picture


def test_the_strip_is_well_formed_whatever_a_run_is_called() -> None:
    made = analysis(findings=(drag_finding(),))
    name = 'a<b & "c" $\\frac{1}{$'
    runs = {run: f"{name} {k}" for k, run in enumerate(dict.fromkeys(t.run for t in made.traces))}
    picture, _, _ = strip(replace(made, traces=[replace(t, run=runs[t.run]) for t in made.traces]), verdict_of(made))
    drawn = ElementTree.fromstring(picture)
    assert len(drawn.findall("image")) == 2 * len(runs)
    shown = [text.text for text in drawn.findall("text")]
    assert [text for text in shown if text.startswith("a<b & ")], shown


@pytest.mark.parametrize(("kind", "what"), [("flight", "flight"), ("bench", "session")])
def test_what_to_do_next_names_the_plan_and_no_number(kind: str, what: str) -> None:
    made = analysis(findings=[CLASS], next_manoeuvre="fly fast", next_separates=("rotor_drag", "frame_drag"))
    verdict = verdict_of(made).model_copy(update={"kind": kind})
    said = next_text(verdict, made.recordings)
    assert said.startswith("Fly fast. It is meant to distinguish rotor drag and ")
    assert f"<code>rotorid plan</code> says which {what} within your limits" in said
    assert not re.search(r"\d", said) and said in make_page(made, verdict)


def test_a_suggested_effect_asks_for_no_column_that_is_there() -> None:
    made = analysis(findings=[drag_finding(id="battery_sag", form=None, values=(), status="suggested")])
    verdict = verdict_of(made)
    assert "record the battery's voltage as well" in next_text(verdict, made.recordings)
    runs = tuple(Run(r.name, r.table.assign(battery_voltage_v=12.0)) for r in made.recordings.runs)
    said = next_text(verdict, replace(made.recordings, runs=runs))
    assert said.startswith("Rest the battery and repeat the same hover.") and "record" not in said


def test_a_vehicle_with_derivatives_is_shown_with_and_without_them_where_most_was_removed():
    made = analysis(findings=[drag_finding()], dash=True)
    plain = data_of(page_of(made))
    assert all("without" not in t for t in plain["traces"])
    start, stop = plain["main"]["shown_s"]
    (trace,) = [
        t for t in made.traces if (t.run, t.channel) == (plain["main"]["run"], plain["main"]["channel"])
    ][:1]  # fmt: skip
    removed = trace.before**2 - trace.after**2
    inside = (trace.time_s >= start - 1e-3) & (trace.time_s < stop)
    assert stop - start == pytest.approx(10.0) and removed[inside].mean() >= removed.mean()
    with_them = data_of(page_of(replace(made, delivery=Delivery("named", True, made.delivery.scores))))
    forces = [t for t in with_them["traces"] if t["channel"].startswith(("force", "moment"))]
    assert forces and all("without" in t for t in forces)


def test_derivatives_whose_interval_holds_zero_are_grey_and_stand_last():
    made = analysis(findings=[drag_finding()], dash=True)
    numbers = {"unit": "N s/m", "value": -0.1, "low": -3.0, "high": 4.0}
    doubtful = DerivativeOf(channel="force_x", quantity="u", interval_95=(-0.2, 0.05), **numbers)
    clear = DerivativeOf(channel="force_y", quantity="v", interval_95=(-0.2, -0.05), **numbers)
    page = make_page(made, verdict_of(made).model_copy(update={"derivatives": (doubtful, clear)}))
    first, last = re.findall(r"<tr[^>]*><td class=\"text\"><em>[XY]<sub>", page)
    assert "soft" not in first and 'class="soft"' in last and "Y" in first


def test_a_run_of_less_than_ten_seconds_is_shown_whole():
    made = analysis(findings=[drag_finding()], dash=True)
    short = replace(made, traces=tuple(
        replace(t, time_s=t.time_s[:20], before=t.before[:20], refitted=t.refitted[:20], named=t.named[:20],
                after=t.after[:20]) for t in made.traces))  # fmt: skip
    assert _first_shown([t for t in short.traces if t.channel == "force_x"]) is None
