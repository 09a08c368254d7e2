"""The load-cell bench: Arduino UNO with two ADS1256, six bridges read one after the other (thesis 2.1, 2.6).

The UNO sends the converters' counts, sign-extended to 32 bits. The ADS1256 resolves 2·V_ref/gain in 2^24
steps: with V_ref = 2.5 V and gain 64 full scale is ±78.125 mV and a count 9.31 nV.
"""

from rotorid.io.wire.base import COMMON_COMMANDS, Instrument, counts

REFERENCE_V = 2.5
GAIN = 64
_FULL_SCALE = (1 << 23) - 1
VOLTS_PER_COUNT = 2 * REFERENCE_V / GAIN / _FULL_SCALE

INSTRUMENT = Instrument(
    name="bench",
    title="load-cell bench",
    baud_rate=115200,
    interval_us=20_000,
    channels=counts([f"cell_{i}_v" for i in range(1, 7)], "i", VOLTS_PER_COUNT, _FULL_SCALE),
    commands=COMMON_COMMANDS,
)
