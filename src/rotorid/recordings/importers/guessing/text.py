"""A mapping file in which each line has its evidence."""

from __future__ import annotations

import yaml

from rotorid.recordings.importers.guessing.guess import Guess
from rotorid.recordings.importers.mapping import BODY, OPEN, WORLD


def as_text(found: Guess, source: str) -> str:
    """A mapping file in which each line has its evidence, and what is open is marked."""
    mapping = found.mapping
    lines = [f"# What the columns of {source} are, proposed by rotorid from names and numbers. Look through it, then:"]
    lines += [f"#   rotorid import {source} --mapping THIS_FILE --mass-kg … --like …"]
    if found.open:
        lines += [
            f"# Nothing is imported while a {OPEN!r} is left: write the answer in its place, or remove the channel."
        ]
    lines += [f"# {sentence}" for sentence in found.left_out]
    for key, words in (("body", " | ".join(BODY)), ("world", " | ".join(WORLD))):
        lines += _comment(found, key, "")
        value = getattr(mapping, key)
        lines.append(f"{key}: {value if value != OPEN else repr(OPEN)}   # {words}")
    lines.append("channels:")
    for name, channel in mapping.channels.items():
        content = channel.model_dump(exclude_defaults=True)
        if name == "attitude":
            content["form"] = channel.form
        if name == "velocity":
            content["axes"] = channel.axes
        content = {k: list(v) if isinstance(v, tuple) else v for k, v in content.items()}
        lines += _comment(found, name, "  ")
        lines.append(
            f"  {name}: {yaml.safe_dump(content, default_flow_style=True, width=10**6, sort_keys=False).strip()}"
        )
    kept = yaml.safe_dump(list(mapping.keep), default_flow_style=True, width=10**6).strip()
    lines.append(f"keep: {kept}   # other columns, kept as candidates for what an error depends on")
    return "\n".join(lines) + "\n"


def _comment(found: Guess, key: str, indent: str) -> list[str]:
    lines = [f"{indent}# {found.evidence[key]}"] if found.evidence.get(key) else []
    return lines + ([f"{indent}# OPEN: {found.open[key]}"] if key in found.open else [])
