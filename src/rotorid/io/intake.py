"""Bytes in, unpacked frames in their places out: the one way by which recorder and parser read a line.

Whatever a device may send, nothing is raised here: what is no frame, what is a frame without a sense, and
what is a frame of an unknown kind is counted, and the frames around it lose nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rotorid.io import wire
from rotorid.io.frames import ANSWER, COMMAND, DATA, END, START, Frame, StreamDecoder
from rotorid.io.sequence import Placed, Tracker

_UNPACK = {START: wire.StartRecord.unpack, END: wire.EndRecord.unpack, ANSWER: wire.Answer.unpack}


class Taken(NamedTuple):
    """A frame of a known kind with what it says: a record, an answer, or the payload of a sample.

    `place` is None for a frame that was here before; only a start record is handed on then.
    """

    kind: int
    place: Placed | None
    content: wire.StartRecord | wire.EndRecord | wire.Answer | bytes


class Intake:
    """Decodes, places and unpacks. `instrument` says how long a sample is; None takes samples of any length.

    Attributes: `decoder` and `tracker` with their counts, `malformed` (the checksum fits, the payload does not
    what its kind asks for), `malformed_samples` (those of them that should have been samples), `unknown_kinds`,
    `fault` (the last sentence about a malformed frame).
    """

    def __init__(self, instrument: wire.Instrument | None = None) -> None:
        self.instrument = instrument
        self.decoder = StreamDecoder()
        self.tracker = Tracker()
        self.malformed = 0
        self.malformed_samples = 0
        self.unknown_kinds = 0
        self.fault = ""

    def feed(self, data: bytes) -> Iterator[Taken]:
        """What these bytes complete, in the order of arrival; the counts are those up to the frame in hand."""
        for frame in self.decoder.feed(data):
            taken = self._take(frame)
            if taken is not None:
                yield taken

    def _take(self, frame: Frame) -> Taken | None:
        if frame.kind == COMMAND:  # our own words, sent back by the line: no frame of the device
            self.unknown_kinds += 1
            return None
        content = self._content(frame)
        place = self.tracker.place(frame)
        if content is None:
            if place is not None and frame.kind == DATA:
                self.tracker.unreadable()
            return None
        if place is None and frame.kind != START:
            return None
        return Taken(frame.kind, place, content)

    def _content(self, frame: Frame):
        """What a frame says, or None, counted, where it says nothing that could be understood."""
        try:
            if frame.kind == DATA:
                if self.instrument is not None:
                    self.instrument.check(frame.payload)
                return frame.payload
            if frame.kind in _UNPACK:
                return _UNPACK[frame.kind](frame.payload)
            self.unknown_kinds += 1
        except wire.Malformed as error:
            self.malformed += 1
            self.malformed_samples += frame.kind == DATA
            self.fault = str(error)
        return None
