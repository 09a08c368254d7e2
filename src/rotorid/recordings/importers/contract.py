"""What an importer states: how a log of its format is recognised, and what is in one.

A format is one module here that ends in one `IMPORTER`, or an entry point `rotorid.importers` of an installed package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from rotorid.recordings.importers.faults import ImportFault
from rotorid.recordings.importers.known import Known
from rotorid.recordings.settings import Settings


@dataclass(frozen=True)
class Imported:
    """Flights of one log, or runs of a stand, with what was found on the way."""

    runs: Mapping[str, pd.DataFrame]
    """To the name of a run its table in the contract's columns, axes and units."""
    faults: Sequence[ImportFault]
    axes: str
    """The log's axes, and how they became the contract's, in words."""
    known: Known = Known("")
    kind: str = "flight"
    """`flight` or `stand`."""
    speed_unit: str = "rad/s"
    """Unit in which the log states rotor speeds, `rad/s`, `rpm` or `hz`; the runs have rad/s."""
    settings: Settings = field(default_factory=dict)
    """The autopilot's parameters, as they held for most of the flight or at its start."""
    unsigned_torque: bool = False
    """Whether a stand's log does not say which way its torque counts: the vehicle's file gives it the sign."""
    format: str = ""
    """Name of the importer, filled in by `read_log`."""


@dataclass(frozen=True)
class Importer:
    """A format of logs. One of `starts`, `inside` and `recognises` must hold for its logs and for no others."""

    name: str
    title: str
    """What messages and pages call the format."""
    read: Callable[[Path], Imported]
    """Everything in a log; InputError in one sentence where it holds nothing."""
    holds: str
    """What is read, for the documentation, in Markdown."""
    starts: tuple[bytes, ...] = ()
    """What a log may begin with."""
    inside: tuple[bytes, ...] = ()
    """What stands among the first 4096 bytes, behind what may be left of another log in the logger's memory."""
    recognises: Callable[[Path, bytes], bool] = lambda path, head: False
    """Whether a file with these first 4096 bytes, or a folder (no bytes), is a log; asked where nothing starts so."""
    known_by: str = "first bytes"
    """How a log is recognised, for the documentation."""
    template: str = ""
    """Template vehicle that supplies what a log does not say; empty where nothing says what vehicle it is."""
    by_mapping: bool = False
    """Whether a mapping of columns, where one is given, is taken in place of `read`."""
    any_size: bool = False
    """Whether a log may be larger than files usually may: most of it is not read."""


def text_of(head: bytes) -> str:
    """The first bytes of a file as text; empty where they are none."""
    return "" if b"\0" in head else head.decode("utf-8", errors="replace")
