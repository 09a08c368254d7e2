"""The wire codec: golden bytes, round trips, resynchronisation, sequence and clock."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotorid_acquire.io import wire
from rotorid_acquire.io.frames import (
    DATA,
    START,
    BrokenFrame,
    ChecksumError,
    Frame,
    Quality,
    StreamDecoder,
    Tracker,
    cobs_decode,
    cobs_encode,
    decode,
    encode,
)

frames = st.builds(
    Frame, st.integers(0, 255), st.integers(0, 65535), st.integers(0, 2**32 - 1), st.binary(max_size=240)
)


def test_cobs_by_hand():
    # Cheshire and Baker: every run of non-zero bytes is preceded by its length plus one
    assert cobs_encode(b"\x11\x22\x00\x33") == b"\x03\x11\x22\x02\x33"
    assert cobs_encode(b"\x00\x00") == b"\x01\x01\x01"
    assert cobs_encode(b"") == b"\x01"


def test_golden_frame():
    # D, sequence 1, clock 0x04030201, payload AA 00; CRC-16/CCITT-FALSE of these nine bytes
    body = bytes.fromhex("44 0100 01020304 AA00")
    crc = 0xFFFF
    for byte in body:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    wired = encode(Frame(DATA, 1, 0x04030201, b"\xaa\x00"))
    assert wired == cobs_encode(body + struct.pack("<H", crc)) + b"\0"
    assert wired.hex() == "0344010601020304aa03" + struct.pack("<H", crc).hex() + "00"


def test_checksum_is_ccitt_false():
    from binascii import crc_hqx

    assert crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # the check value of the CRC catalogue


@given(frames)
def test_round_trip(frame):
    wired = encode(frame)
    assert wired.count(0) == 1 and wired[-1] == 0
    assert decode(wired[:-1]) == frame


@given(st.binary(max_size=253))
def test_cobs_round_trip(body):
    assert cobs_decode(cobs_encode(body)) == body


@given(st.lists(frames, max_size=6), st.lists(st.integers(0, 400), max_size=5))
def test_any_cutting_of_the_stream_gives_the_same_frames(sent, cuts):
    stream = b"".join(encode(frame) for frame in sent)
    decoder, found, start = StreamDecoder(), [], 0
    for cut in [*sorted(min(c, len(stream)) for c in cuts), len(stream)]:
        found += decoder.feed(stream[start:cut])
        start = cut
    assert found == sent and decoder.lost_bytes == 0 and decoder.pending == b""


@given(st.binary(max_size=600), frames, frames)
def test_garbage_never_costs_the_frame_after_the_next(garbage, first, second):
    found = StreamDecoder().feed(garbage + encode(first) + encode(second))
    assert found[-1] == second


@given(frames, st.data())
def test_a_flipped_bit_is_noticed(frame, data):
    wired = bytearray(encode(frame)[:-1])
    place = data.draw(st.integers(0, len(wired) - 1))
    wired[place] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(BrokenFrame):
        for block in bytes(wired).split(b"\0"):
            if block:
                assert decode(block) != frame


def test_wrong_checksum_is_told_from_a_broken_frame():
    wired = bytearray(encode(Frame(DATA, 7, 9, b"abc"))[:-1])
    wired[-1] ^= 1
    with pytest.raises(ChecksumError):
        decode(bytes(wired))
    with pytest.raises(BrokenFrame, match="too short"):
        decode(cobs_encode(b"abc"))


def test_endless_garbage_costs_no_memory():
    decoder = StreamDecoder()
    for _ in range(1000):
        decoder.feed(b"\xff" * 1000)
    assert len(decoder.pending) <= 255
    assert decoder.feed(b"\0" + encode(Frame(DATA, 1, 2, b"x"))) == [Frame(DATA, 1, 2, b"x")]


def test_body_too_long():
    with pytest.raises(ValueError, match="at most 253"):
        encode(Frame(DATA, 0, 0, bytes(250)))


# ---- sequence and clock ----------------------------------------------------------------------------------


def start(sequence=0, clock_us=0, boot_id=1, interval_us=1000) -> Frame:
    record = wire.StartRecord(boot_id, interval_us, 0, "bench", "1", "x")
    return Frame(START, sequence, clock_us, record.pack())


def data(sequence, clock_us) -> Frame:
    return Frame(DATA, sequence % 65536, clock_us % 2**32, b"")


def test_sequence_wraps_and_clock_rolls_over():
    tracker = Tracker()
    tracker.place(start(65533, 2**32 - 1000))
    places = [tracker.place(data(65534 + k, 2**32 + 1000 * k)) for k in range(4)]
    assert [place.index for place in places] == [65534, 65535, 65536, 65537]
    assert [place.clock_us for place in places] == [2**32 + 1000 * k for k in range(4)]
    assert tracker.rollovers == 1 and tracker.missing == 0


def test_a_gap_longer_than_the_sequence_period_is_counted_with_the_clock():
    tracker = Tracker()
    tracker.place(start())
    tracker.place(data(1, 1000))
    place = tracker.place(data(1 + 70_000, 1000 + 70_000 * 1000))
    assert place.index == 70_001 and tracker.missing == 69_999
    assert place.flags == Quality.AFTER_GAP


def test_idling_for_hours_between_two_streams_is_no_gap():
    tracker = Tracker()
    tracker.place(start())
    tracker.place(start(1, 1_800_000_000))
    assert tracker.place(data(2, 1_800_001_000)).index == 2 and tracker.missing == 0


def test_a_late_frame_splits_its_gap():
    tracker = Tracker()
    tracker.place(start())
    for sequence in (1, 6, 4):
        place = tracker.place(data(sequence, 1000 * sequence))
    assert place.index == 4 and place.flags == Quality.LATE and tracker.late == 1
    assert [(gap.first_index, gap.count) for gap in tracker.gaps] == [(2, 2), (5, 1)]
    assert tracker.place(data(4, 4000)) is None and tracker.repeated == 1


def test_a_reset_whose_start_record_is_lost_shows_by_the_clock():
    tracker = Tracker()
    tracker.place(start(0, 3_000_000_000))
    for k in range(1, 100):
        tracker.place(data(k, 3_000_000_000 + 1000 * k))
    place = tracker.place(data(3, 4000))
    assert tracker.resets == 1 and place.segment == 1 and place.flags == Quality.AFTER_RESET
    tracker.place(start(4, 5000, boot_id=2))  # its start record, asked for later, is no second reset
    assert tracker.resets == 1


# ---- instruments -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("instrument", wire.INSTRUMENTS.values(), ids=lambda i: i.name)
def test_instruments_are_stated_in_full(instrument):
    assert instrument.title and instrument.baud_rate and instrument.interval_us
    assert {"?", "X"} <= set(instrument.commands)
    units = ("_v", "_a", "_n", "_n_m", "_rpm", "_mm")
    for channel in instrument.channels:
        assert channel.column.endswith(units) or channel.column.startswith(("throttle", "led"))
    # nine bytes of head and tail, one of COBS: what fits into a frame
    assert instrument.layout.size <= 240
    lowest = [channel.low for channel in instrument.channels]
    assert instrument.decode(instrument.encode(lowest)) == pytest.approx(
        [channel.low * channel.scale for channel in instrument.channels]
    )


def test_counts_beyond_the_range_stand_at_its_end():
    wrench = wire.INSTRUMENTS["wrench"]
    values = wrench.decode(wrench.encode([5000, -5000, 12, 0, 0, 1]))
    assert values == pytest.approx((200.0, -200.0, 1.2, 0.0, 0.0, 0.001))


def test_bench_count_in_volts():
    # ±2.5 V reference, gain 64: full scale 5/64 V = 78.125 mV at 2^23 − 1 counts
    bench = wire.INSTRUMENTS["bench"]
    full = (1 << 23) - 1
    assert bench.decode(bench.encode([full, -full, 0, 0, 0, 0]))[:2] == pytest.approx((0.078125, -0.078125))


def test_records_round_trip():
    record = wire.StartRecord(0xDEADBEEF, 20_000, 2, "bench", "bench 1.2 (emulated)", "Nº 1")
    assert wire.StartRecord.unpack(record.pack()) == record
    end = wire.EndRecord(600_000, 3, 1)
    assert wire.EndRecord.unpack(end.pack()) == end
    answer = wire.Answer("G", 1, "power on and initialise first")
    assert wire.Answer.unpack(answer.pack()) == answer
