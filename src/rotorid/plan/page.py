"""The plan on the verdict's page: into the section on what to fly next, in place of an earlier plan."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence

from markupsafe import Markup, escape

OPEN, CLOSE = "<!-- plan -->", "<!-- end of the plan -->"
SECTION = re.compile(r"(<section><h2>What to fly next</h2>.*?)(?:" + OPEN + ".*?" + CLOSE + r")?(</section>)", re.S)


def section(name: str, said: Sequence[str], picture: bytes | None = None) -> Markup:
    """The sentences of a plan for a set as HTML, and its picture (PNG) where there is one.

    Sentences that are set in belong to the first: its steps.
    """
    first = Markup("<br>").join([said[0], *(line.strip() for line in said if line.startswith("  "))])
    others = [line for line in said[1:] if not line.startswith("  ")]
    lines = Markup("").join(Markup("<li>{}</li>").format(line) for line in (first, *others))
    out = Markup("<ul>{}</ul>").format(lines)
    if picture:
        data = base64.b64encode(picture).decode()
        words = f"What is planned for {name}, step by step, and the expected separations"
        out += Markup('<img style="max-width:100%" alt="{}" src="data:image/png;base64,{}">').format(words, data)
    return out


def with_plan(page: str, name: str, said: Sequence[str], picture: bytes | None = None) -> str:
    """A verdict's page with the plan in it; a page without that section as it is."""
    made = f"{OPEN}{escape(section(name, said, picture))}{CLOSE}"
    return SECTION.sub(lambda found: found[1] + made + found[2], page, count=1)
