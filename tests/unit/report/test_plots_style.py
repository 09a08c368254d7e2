"""Figures come out with the same bytes, and thinned traces keep their extremes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.report.plots import style


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_the_same_data_give_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    for name in ("one", "two"):
        fig, axes = style.figure(2.0)
        axes.plot([0, 1, 2], [0, 1, 4], label=r"$\omega^2$")
        axes.legend()
        style.save(fig, tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()


def test_thinning_keeps_order_and_extremes() -> None:
    trace = np.sin(np.linspace(0, 40, 100_000))
    trace[51_234] = 9.0
    kept = style.thin(trace, 1000)
    assert len(kept) <= 1000
    assert np.all(np.diff(kept) > 0)
    assert trace[kept].max() == 9.0
    assert trace[kept].min() == trace.min()


def test_thinning_leaves_short_traces_and_bears_missing_samples() -> None:
    assert style.thin(np.arange(5.0), 10).tolist() == [0, 1, 2, 3, 4]
    assert len(style.thin(np.full(100, np.nan), 10)) == 5


def test_a_placeholder_says_why(tmp_path: Path) -> None:
    style.placeholder(tmp_path / "empty.svg", "recordings not obtained")
    assert (tmp_path / "empty.svg").stat().st_size > 1000


def test_what_a_notebook_shows_is_what_it_saves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: executed notebooks held neither figure nor table."""
    displayed = []
    monkeypatch.setattr("IPython.display.display", displayed.append)
    fig, axes = style.figure(2.0)
    axes.plot([0, 1], [0, 1])
    style.show(fig, tmp_path / "new" / "line.svg")
    style.show(pd.DataFrame({"a": [1.5]}), tmp_path / "table.csv")
    style.show("recordings not obtained", tmp_path / "empty.svg")
    assert displayed[0].data.startswith(b"\x89PNG") and (tmp_path / "new" / "line.svg").stat().st_size > 1000
    assert displayed[1]["a"].item() == 1.5 and (tmp_path / "table.csv").read_text() == "a\n1.5\n"
    assert displayed[2] == "recordings not obtained" and (tmp_path / "empty.svg").stat().st_size > 1000
