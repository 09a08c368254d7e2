"""The large six-axis sensor that the thesis takes as reference for the bench (thesis 2.8, fig. 2.41c)."""

from rotorid.io.wire.base import COMMON_COMMANDS, Instrument, counts
from rotorid.io.wire.wrench import COLUMNS, OFFSET

INSTRUMENT = Instrument(
    name="jr3",
    title="reference force-torque sensor",
    baud_rate=115200,
    interval_us=20_000,
    channels=counts(COLUMNS[:3], "i", 0.01, 20_000) + counts(COLUMNS[3:], "i", 1e-3, 10_000),
    commands=COMMON_COMMANDS | {OFFSET: "take the present reading as zero"},
)
