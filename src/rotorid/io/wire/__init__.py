"""What each instrument says inside a frame: one small module per instrument, shared by recorder, emulator
and parser. `INSTRUMENTS` finds them by name."""

from rotorid.io.wire import bench, jr3, quadrotor, rotor, tensile, wrench
from rotorid.io.wire.base import Answer, EndRecord, Instrument, Malformed, StartRecord, WireChannel

INSTRUMENTS: dict[str, Instrument] = {
    module.INSTRUMENT.name: module.INSTRUMENT for module in (bench, jr3, quadrotor, rotor, tensile, wrench)
}

__all__ = ["INSTRUMENTS", "Answer", "EndRecord", "Instrument", "Malformed", "StartRecord", "WireChannel"]
