"""Values of a `vehicle.yaml` that nobody measured: lines that the importer marked as PROPOSED and nobody replaced."""

from __future__ import annotations

import re
from collections.abc import Iterator

from rotorid.recordings.doubts import Doubt

LINE = re.compile(r"^(?P<key>\w+):.*?#\s*PROPOSED:?\s*(?P<why>.*)$")


def proposed_in(text: str) -> tuple[Doubt, ...]:
    """A doubt for each value that the text of a `vehicle.yaml` marks as proposed, in the order of the file."""
    return tuple(_doubts(text))


def _doubts(text: str) -> Iterator[Doubt]:
    for line in text.splitlines():
        if found := LINE.match(line):
            why = found["why"].strip().rstrip(".")
            yield Doubt(found["key"], f"{found['key']} is only proposed{f' ({why})' if why else ''}.", stops=False)
