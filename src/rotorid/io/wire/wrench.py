"""The miniature six-axis force-torque sensor (thesis 3.5.1, table 3.2): 40 N, 0.4 N m; 0.1 N, 0.001 N m.

Its operations are those of the sensor's own software: port, power, initialise with sampling interval,
restart times and measuring times, start, stop, offset. A measuring run ends after `measuring_times` samples
(0: when stopped) and is started anew `restart_times` times.
"""

import struct

from rotorid.io.wire.base import COMMON_COMMANDS, Instrument, counts

POWER, INITIALISE, OFFSET = "P", "I", "O"
FORCE_RESOLUTION_N = 0.1
MOMENT_RESOLUTION_N_M = 0.001
COLUMNS = ["force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m"]
_INITIALISE = struct.Struct("<IHI")

INSTRUMENT = Instrument(
    name="wrench",
    title="six-axis force-torque sensor",
    baud_rate=115200,
    interval_us=10_000,
    channels=counts(COLUMNS[:3], "h", FORCE_RESOLUTION_N, 2000)  # load capacity 200 N
    + counts(COLUMNS[3:], "h", MOMENT_RESOLUTION_N_M, 1800),  # and 1.8 N m
    commands=COMMON_COMMANDS
    | {
        POWER: "power, u8: 1 on, 0 off",
        INITIALISE: "sampling interval u32 in µs, restart times u16, measuring times u32",
        OFFSET: "take the present reading as zero",
    },
)


def pack_initialise(interval_s: float, restart_times: int, measuring_times: int) -> bytes:
    """Arguments of the initialise command."""
    if not 0 < interval_s <= 60:
        raise ValueError(f"the sampling interval lies between 0 and 60 s, not at {interval_s}")
    return _INITIALISE.pack(round(interval_s * 1e6), restart_times, measuring_times)


def unpack_initialise(arguments: bytes) -> tuple[int, int, int]:
    """Interval in µs, restart times, measuring times. Raises struct.error for another length."""
    return _INITIALISE.unpack(arguments)
