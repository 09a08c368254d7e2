"""A package of somebody else's, installed for a test: a module and what it offers by entry points."""

from pathlib import Path

import pytest


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch, module: str, text: str, points: str) -> None:
    """Install the `module` with this text, found by the entry points `points`, until `monkeypatch` is undone."""
    (folder / f"{module}.py").write_text(text, encoding="utf-8")
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(points)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(__import__("sys").modules, module, raising=False)
