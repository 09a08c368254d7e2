"""Residuals for viewers: what the files hold adds up, and the layouts name what is in them."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import rotorid
from rotorid.report.series_files import (
    foxglove_layout,
    plain,
    plotjuggler_layout,
    series_of,
    topics_of,
    write_mcap,
    write_rrd,
)


@pytest.fixture(scope="module")
def series():
    drag = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": 2.0e-4}}
    made = rotorid.simulate(rotorid.template("thesis", effects=[drag]), seconds=8)
    named = replace(made, runs=tuple(replace(r, name=f"of {r.name}.a") for r in made.runs))
    return series_of(rotorid.verdict(named).analysis)


def test_effects_one_by_one_are_what_the_model_explains(series) -> None:
    force = next(s for s in series if s.topic.endswith("/force_x"))
    assert {"before", "refitted", "after", "model", "rotor_drag"} <= set(force.fields)
    assert force.fields["model"] == pytest.approx(force.fields["before"] - force.fields["after"])
    drag, model = force.fields["rotor_drag"], force.fields["model"]
    assert np.std(model - drag) < 0.2 * np.std(model)


def test_layouts_name_what_is_there(series) -> None:
    fields = {f"{topic}/{name}" for topic, names in topics_of(series).items() for name in names}
    curves = {c.get("name") for c in ElementTree.fromstring(plotjuggler_layout(series)).iter("curve")}
    assert curves == fields
    layout = json.loads(foxglove_layout(series))
    plots = {k: v for k, v in layout["configById"].items() if k.startswith("Plot!")}
    paths = {p["value"] for plot in plots.values() for p in plot["paths"]}
    assert paths == {f"{topic}.{name}" for topic, names in topics_of(series).items() for name in names}

    def leaves(node) -> set[str]:
        return {node} if isinstance(node, str) else leaves(node["first"]) | leaves(node["second"])

    tabs = layout["configById"][layout["layout"]]["tabs"]
    assert set.union(*(leaves(tab["layout"]) for tab in tabs)) == set(plots) and len(tabs) == 2
    assert plain("of flight_1.a") == "of_flight_1_a" and all(t.count("/") == 2 for t in topics_of(series))


def test_mcap_reads_back(series, tmp_path) -> None:
    pytest.importorskip("mcap")
    from mcap.reader import make_reader

    write_mcap(series, tmp_path / "x.mcap")
    with open(tmp_path / "x.mcap", "rb") as file:
        read = [(c.topic, m.log_time, json.loads(m.data)) for _, c, m in make_reader(file).iter_messages()]
    assert len(read) == sum(len(s.time_s) for s in series)
    first = min((s for s in series), key=lambda s: (s.topic, s.time_s[0]))
    own = [(t, v) for topic, t, v in read if topic == first.topic]
    assert own[5][0] == round(first.time_s[5] * 1e9)
    assert own[5][1]["after"] == pytest.approx(first.fields["after"][5])


def test_rerun_takes_the_series(series, tmp_path) -> None:
    pytest.importorskip("rerun")
    write_rrd(series, tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size > 10_000
