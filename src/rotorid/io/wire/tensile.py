"""The tensile tester (thesis 2.6.4): 10 mm/min, ten samples a second, 40 mm between the grips."""

from rotorid.io.wire.base import COMMON_COMMANDS, WATCHDOG, Instrument, WireChannel

INSTRUMENT = Instrument(
    name="tensile",
    title="tensile tester",
    baud_rate=9600,
    interval_us=100_000,
    channels=(
        WireChannel("displacement_mm", "i", 1e-4, -1_000_000, 1_000_000),
        WireChannel("force_n", "i", 0.1, -50_000, 50_000),
    ),
    commands=COMMON_COMMANDS | WATCHDOG,
)
