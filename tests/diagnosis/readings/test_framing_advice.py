"""What the advice on framings says of a recording: transcripts, and framings that were hidden in bytes."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.diagnosis.readings.framing_recordings import cut_up, every, recorded
from trcvtui.blocks.framing import Framing
from trcvtui.blocks.serial.com_buffer import MOST_RECORDED_BYTES, LineRecorder
from trcvtui.diagnosis.readings.framing_advice import MOST_PROPOSALS, advise_framings
from trcvtui.diagnosis.readings.proposal import MOST_BYTES_SHOWN, MOST_SHOWN, CutKind
from trcvtui.diagnosis.readings.trial import LengthField, cut

CODES = [b"\x02400638%d\r\n" % number for number in (1333931, 77, 1333955, 90210, 1333962, 4711)]


def numbers(seed: int, size: int) -> bytes:
    """Return bytes of any value, always the same for a seed."""
    return random.Random(seed).randbytes(size)


def test_a_barcode_reader_has_a_prefix_and_a_suffix() -> None:
    recording = every(200, [b"READY" + CODES[0], *CODES[1:]], "tcp")
    assert advise_framings(recording).text().splitlines()[:7] == [
        "91 bytes in 6 chunks of a TCP stream",
        "1. prefix 02 (STX), suffix 0D 0A (CR LF)",
        "   6 of 6 frames end in 0D 0A (CR LF); 0D 0A occurs nowhere else",
        "   6 of 6 frames begin with 02 (STX); 02 occurs nowhere else",
        "   6 frames, of 11 to 16 bytes: 86 of 91 bytes",
        "   5 of 6 chunks begin where a frame does",
        "   left over: 5 bytes of noise before a prefix",
    ]


SCANNED = [b"\x02" + str(4006381 * (number + 3) ** 3).encode() + b"\r\n" for number in range(24)]


def noisy(share: int, least: int = 1, most: int = 3) -> list[bytes]:
    source, frames = random.Random(share), []
    for code in SCANNED:
        size = source.randint(least, most) if source.randrange(100) < share else 0
        frames.append(bytes(source.choices(range(0x20, 0x100), k=size)) + code)
    return frames


@pytest.mark.parametrize("share", [5, 10, 20, 30, 50, 80, 100])
@pytest.mark.parametrize("source", ["serial", "tcp"])
def test_noise_between_barcodes_is_left_out_by_the_prefix(share: int, source: str) -> None:
    frames = noisy(share)
    recording = every(200, frames) if source == "serial" else recorded([(10, b"".join(frames))], source)
    best, *others = advise_framings(recording).proposals
    assert best.title == "prefix 02 (STX), suffix 0D 0A (CR LF)"
    assert (best.frames, best.noise) == (24, len(b"".join(frames)) - len(b"".join(SCANNED)))
    assert [frame.content for frame in best.preview] == SCANNED[:MOST_SHOWN]
    assert best.doubt == ()
    for each in others:
        if each.noise == 0:
            assert "have noise in them" in each.doubt[-1]


def test_the_greeting_before_the_first_code_is_noise_and_who_takes_it_as_data_is_doubted() -> None:
    best, second, *_ = advise_framings(every(200, [b"READY 1.2.3" + SCANNED[0], *SCANNED[1:]])).proposals
    assert (best.title, best.evidence[-1]) == (
        "prefix 02 (STX), suffix 0D 0A (CR LF)",
        "left over: 11 bytes of noise before a prefix",
    )
    assert second.title == "suffix 0D 0A (CR LF)"
    assert second.doubt == (
        "1 of 24 frames have noise in them, which prefix 02 (STX), suffix 0D 0A (CR LF) leaves out",
    )


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_check_byte_after_the_end_is_noise_before_the_next(size: int) -> None:
    frames = [code[:-2] + b"\x03" + numbers(n, size).replace(b"\x02", b"!") for n, code in enumerate(SCANNED)]
    best = advise_framings(every(200, frames)).proposals[0]
    assert best.title == "prefix 02 (STX), suffix 03 (ETX)"
    (doubt,) = best.doubt
    assert doubt.startswith(f"{size} byte")
    assert doubt.endswith("between nearly all frames: a check after the suffix? ReceiveData drops it")


@pytest.mark.parametrize(
    ("line", "title"),
    [
        ("{0} kg {1}\r\n", "suffix 0D 0A (CR LF)"),
        ("12:{0}:{1}\n", "suffix 0A (LF)"),
        ("{0};{1}\n", "suffix 0A (LF)"),
    ],
)
def test_what_stands_once_in_each_line_of_text_is_no_prefix(line: str, title: str) -> None:
    stream = "".join([line.format(n * n * 37, 10**5 // (n + 1)) for n in range(30)]).encode()
    best = advise_framings(cut_up(stream, [7] * 90)).proposals[0]
    assert (best.title, best.doubt) == (title, ())


@pytest.mark.parametrize("number", [6, 12, 24])
def test_a_part_of_the_suffix_is_not_proposed_with_the_rest_of_it_as_noise(number: int) -> None:
    names = (b"EPS", b"ALPHA", b"GO")
    words = [b"\x02%s %d\r\n" % (names[n % 3], n * n) for n in range(number)]
    proposals = advise_framings(every(80, words)).proposals
    assert proposals[0].title == "prefix 02 (STX), suffix 0D 0A (CR LF)"
    assert all(each.noise == 0 for each in proposals if each.kind is CutKind.PREFIX_SUFFIX)


FLAGS = [(b"\x7e", "7E ('~')"), (b"\xc0", "C0"), (b"\xf0\x0f", "F0 0F")]


@pytest.mark.parametrize(("flag", "name"), FLAGS, ids=["HDLC", "SLIP", "two bytes"])
@pytest.mark.parametrize("number", [20, 60])
@pytest.mark.parametrize("how", ["gaps", "one chunk", "pieces"])
def test_a_flag_that_both_begins_and_ends_frames_is_prefix_and_suffix(
    flag: bytes, name: str, number: int, how: str
) -> None:
    bodies = [bytes(set(numbers(n, 5 + n * 7 % 16)) - set(flag)) for n in range(number)]
    frames = [flag + body + flag for body in bodies]
    stream = b"".join(frames)
    sizes = {"one chunk": [], "pieces": [7] * 400}
    best, *_ = advise_framings(every(100, frames) if how == "gaps" else cut_up(stream, sizes[how])).proposals
    assert best.title == f"prefix {name}, suffix {name}"
    assert (best.frames, best.explained, best.doubt) == (number, len(stream), ())
    plain = flag.hex(" ").upper()
    assert best.evidence[:2] == (
        f"{number} of {number} frames end in {name}; {plain} occurs nowhere else",
        f"{number} of {number} frames begin with {name}; {plain} occurs nowhere else",
    )


def test_a_flag_in_a_recording_that_began_in_a_frame_is_at_least_a_suffix_with_a_doubt() -> None:
    bodies = [bytes(set(numbers(n, 5 + n * 7 % 16)) - set(b"\x7e")) for n in range(40)]
    best = advise_framings(cut_up(b"\x7e\x7e".join(bodies) + b"\x7e", [7] * 400)).proposals[0]
    assert (best.title, best.doubt) == (
        "suffix 7E ('~')",
        ("39 of 79 frames are 7E ('~') alone: it may begin frames too",),
    )


def test_lines_between_which_lines_are_empty_still_end_in_a_suffix() -> None:
    lines = [b"weight %d kg\n%s" % (n * 37, b"\n" if n % 3 == 0 else b"") for n in range(30)]
    assert advise_framings(cut_up(b"".join(lines), [11] * 60)).proposals[0].framing.suffix == b"\n"  # type: ignore[union-attr]


def modbus_rtu(number: int) -> bytes:
    """Return an answer of Modbus RTU; its check is left to chance."""
    size = 2 * (1 + number % 7)
    return bytes([1, 3, size]) + numbers(number, size + 2)


def test_a_constant_start_is_doubted_where_it_is_no_usual_mark() -> None:
    gap = next(
        each
        for each in advise_framings(every(50, map(modbus_rtu, range(15)))).proposals
        if "01" in each.title
    )
    assert gap.title.startswith("prefix 01")
    assert gap.doubt[0].startswith("01") and gap.doubt[0].endswith("may be data that has not changed yet")
    nmea = [b"$GPGGA,%06d,4807.038,N*%02X\r\n" % (n * 4711, n * 37 % 256) for n in range(12)]
    best = advise_framings(every(200, nmea)).proposals[0]
    assert (best.title, best.doubt) == ("prefix 24 ('$'), suffix 0D 0A (CR LF)", ())
    few = advise_framings(every(200, nmea[:4])).proposals[0]
    assert few.doubt == ("4 frames are few: record more", "24 ('$') may be data that has not changed yet")


def test_lines_of_text_have_a_suffix_and_their_first_letters_may_be_data() -> None:
    lines = [f"T={20 + n / 7:.2f} H={40 + n}\n".encode() for n in range(15)]
    first, second, *_ = advise_framings(cut_up(b"".join(lines), [7] * 40)).proposals
    assert (first.title, first.rank) == ("suffix 0A (LF)", 1)
    assert first.evidence[0] == "15 of 15 frames end in 0A (LF); 0A occurs nowhere else"
    assert (second.title, second.rank) == ("prefix 54 3D 32 ('T' '=' '2'), suffix 0A (LF)", 1)
    assert second.doubt == ("54 3D 32 ('T' '=' '2') may be data that has not changed yet",)


def modbus(number: int) -> bytes:
    body = bytes([1, 3]) + numbers(number, (3, 5, 9, 17)[number % 4])
    return number.to_bytes(2, "big") + b"\0\0" + len(body).to_bytes(2, "big") + body


@pytest.mark.parametrize(
    "recording",
    [every(50, map(modbus, range(20)), "tcp"), cut_up(b"".join(map(modbus, range(20))), [7] * 50)],
)
def test_a_length_field_is_found_and_what_does_it_in_the_place_of_receivedata(recording: object) -> None:
    best = advise_framings(recording).proposals[0]  # type: ignore[arg-type]
    assert best.title == "length field: 2 bytes, high byte first, at byte 4; counts the bytes after it"
    assert best.field == LengthField(4, 2, "big", 6)
    assert best.framing is None
    assert best.evidence[0] == "20 lengths lead from frame to frame, the last to byte 330 of 330"
    assert best.instead == (
        "cannot be set: ReceiveData has no length field; a program does it with two jobs: "
        "LEN of TRCV_C (or SizeReceiveData) = 6 for the head, then = what the head says"
    )


def test_blocks_of_eight_bytes_have_a_fixed_size_and_no_start() -> None:
    best, gap = advise_framings(every(100, [numbers(n, 8) for n in range(12)])).proposals
    assert (best.title, best.framing) == ("fixed size 8", Framing(8))
    assert best.evidence == (
        "12 frames, all of 8 bytes: 96 of 96 bytes",
        "12 of 12 chunks begin where a frame does",
    )
    assert best.doubt == ("nothing marks a start: one lost byte shifts all frames after it until Reset",)
    assert gap.title == "a gap of T#50ms"


def test_a_counter_gives_a_fixed_size_away_though_no_pause_does() -> None:
    stream = b"".join([n.to_bytes(2, "little") + b"\0\1" + numbers(n, 4) for n in range(30)])
    assert advise_framings(cut_up(stream, [7] * 40)).proposals[0].title == "fixed size 8"


@pytest.mark.parametrize(
    ("source", "doubt"),
    [("serial", ()), ("tcp", ("a gap over TCP is a guess: the network joins and splits what was sent",))],
)
def test_where_only_pauses_part_the_bytes_it_is_a_gap(source: str, doubt: tuple[str, ...]) -> None:
    frames = [numbers(n, 3 + n * 5 % 13) for n in range(20)]
    (gap,) = advise_framings(every(200, frames, source)).proposals
    assert (gap.kind, gap.title, gap.doubt) == (CutKind.GAP, "a gap of T#100ms", doubt)
    assert gap.evidence[0] == "20 pauses of T#100ms or longer, no other near it"
    assert [frame.content for frame in gap.preview] == frames[:MOST_SHOWN]


def test_bytes_of_one_frame_that_come_scan_by_scan_are_within_the_gap() -> None:
    chunks = [(10 if at else 300, numbers(n, 30)[at : at + 7]) for n in range(8) for at in range(0, 30, 7)]
    best, gap = advise_framings(recorded(chunks)).proposals
    assert (best.title, gap.title, gap.frames) == ("fixed size 30", "a gap of T#155ms", 8)


@pytest.mark.parametrize("size", [40, 1000, MOST_RECORDED_BYTES])
def test_in_noise_nothing_fits_and_that_is_said(size: int) -> None:
    noise = numbers(size, size)
    advice = advise_framings(cut_up(noise, [50] * (size // 50)))
    assert advice.proposals == ()
    assert advice.said == f"nothing fits: in {size} bytes no mark, length, size or pause separates frames"


@pytest.mark.parametrize("size", [0, 1, 7])
def test_too_few_bytes_are_too_few(size: int) -> None:
    assert advise_framings(recorded([(10, b"\r\n\r\n\r\n\r"[:size])])).said.endswith(
        "recorded: too few to judge"
    )


def test_bytes_of_two_connections_are_never_one_frame() -> None:
    recorder = LineRecorder()
    for number in range(6):
        recorder.add(CODES[number] + CODES[0][: number % 3], number * 10**9)
        recorder.mark_connection_end()
    best = advise_framings(recorder.make_recording("tcp", 10**10, 10**7)).proposals[0]
    assert best.title == "prefix 02 (STX), suffix 0D 0A (CR LF)"
    assert (best.frames, best.broken, best.left) == (6, 4, 2)
    assert best.evidence[-1] == (
        "left over: 4 bytes whose connection ended before the frame did; "
        "2 bytes at the end that are no whole frame yet"
    )


def test_a_recording_that_began_in_a_frame_is_read_from_the_first_pause_on() -> None:
    recorder = LineRecorder()
    for number in range(40):
        recorder.add(numbers(number, 2000), number * 10**9)
    recording = recorder.make_recording("serial", 10**11, 10**7)
    assert recording.dropped == 80_000 - recording.size > 0
    best = advise_framings(recording).proposals[0]
    assert (best.title, best.left) == ("fixed size 2000", 0)


@pytest.mark.parametrize("suffix", [b"\r\n\x00", b"\r\n\x03", b"\n\x00"])
def test_known_ends_one_after_the_other_are_one_suffix(suffix: bytes) -> None:
    source = random.Random(7)
    allowed = [byte for byte in range(256) if byte not in suffix]
    frames = [bytes(source.choices(allowed, k=source.randint(4, 20))) + suffix for _ in range(20)]
    recording = cut_up(b"".join(frames), [])
    best = advise_framings(recording).proposals[0]
    assert best.framing is not None
    assert [frame.content for frame in cut(recording, best.framing).good] == frames


def test_three_equal_bytes_before_a_suffix_are_no_longer_suffix() -> None:
    source = random.Random(0)
    frames = [bytes(source.choices(range(1, 256), k=source.randint(4, 20))) + b"\0" for _ in range(22)]
    for number in (6, 12, 21):
        frames[number] = frames[number][:-2] + b"\xa7\0"
    best = advise_framings(cut_up(b"".join(frames), [])).proposals[0]
    assert (best.title, best.frames) == ("suffix 00 (NUL)", 22)


DELIMITERS = st.binary(min_size=1, max_size=4).filter(lambda mark: len(set(mark)) == len(mark))


Secret = tuple[Framing, list[bytes], list[bytes], list[int]]


@st.composite
def hidden(draw: st.DrawFn) -> Secret:
    """Return a framing, frames of it whose payload avoids its marks, noise before each, and cuts."""
    seed = draw(st.integers(0, 2**32))
    how = draw(st.sampled_from(["suffix", "prefix and suffix", "prefix and size", "one mark for both"]))
    prefix = draw(DELIMITERS) if how != "suffix" else b""
    suffix = draw(DELIMITERS.filter(lambda mark: not set(mark) & set(prefix)))
    suffix = {"one mark for both": prefix, "prefix and size": b""}.get(how, suffix)
    source = random.Random(seed)
    allowed = [byte for byte in range(256) if byte not in prefix + suffix]
    number = draw(st.integers(16, 40))
    fixed = draw(st.integers(6, 20))
    lengths = [fixed if how == "prefix and size" else source.randint(4, 20) for _ in range(number)]
    frames = [prefix + bytes(source.choices(allowed, k=length)) + suffix for length in lengths]
    framing = Framing(max(map(len, frames)), prefix, suffix)
    noise = draw(st.sampled_from([0, 0, 10, 40])) if prefix and suffix else 0  # percent of the frames
    before = [
        source.choices(allowed, k=source.randint(1, 4)) * (source.randrange(100) < noise) for _ in frames
    ]
    cuts = draw(st.lists(st.integers(1, 40), max_size=60))
    return framing, frames, [bytes(each) for each in before], cuts


@pytest.mark.slow
@given(hidden())
@settings(max_examples=60, deadline=None)
def test_a_framing_that_was_hidden_is_found_first(secret: Secret) -> None:
    framing, frames, noise, cuts = secret
    recording = cut_up(b"".join([part for each in zip(noise, frames, strict=True) for part in each]), cuts)
    best = [each for each in advise_framings(recording).proposals if each.rank == 1]
    assert best, "nothing fits"
    made = [cut(recording, each.framing) for each in best if each.framing is not None]
    assert [frame.content for frame in made[0].good] == frames
    suffixes = [each.framing.suffix for each in best if each.framing is not None]
    assert framing.suffix in suffixes


CHUNKS = st.lists(st.tuples(st.sampled_from([0, 10, 20, 500]), st.binary(max_size=40)), max_size=30)
FEW_VALUES = st.lists(
    st.tuples(st.sampled_from([10, 500]), st.text("\r\n\x02A", max_size=30).map(str.encode)), max_size=30
)


@pytest.mark.slow
@given(CHUNKS | FEW_VALUES, st.sampled_from(["sim", "serial", "tcp", "cable"]))
@settings(max_examples=80, deadline=None)
def test_whatever_was_recorded_each_proposal_is_what_the_framer_cuts(
    chunks: list[tuple[int, bytes]], source: str
) -> None:
    recording = recorded(chunks, source)
    proposals = advise_framings(recording).proposals
    assert len(proposals) <= MOST_PROPOSALS
    stream = b"".join([payload for _, payload in chunks])
    for each in proposals:
        assert each.explained + each.noise + each.left + each.broken <= each.total <= len(stream)
        for frame in each.preview:
            assert stream[frame.start : frame.start + frame.size].startswith(frame.content)
            assert len(frame.content) <= MOST_BYTES_SHOWN
        if each.framing is not None:
            assert len(cut(recording, each.framing).good) == each.frames


def test_a_recorder_keeps_the_newest_bytes_and_counts_the_others() -> None:
    recorder = LineRecorder()
    for number in range(100):
        recorder.add(bytes([number]) * 1000, number)
    recording = recorder.make_recording("serial", 100, 1)
    assert recording.size == 65_000
    assert (recording.chunks[0].payload[0], recording.chunks[-1].payload[0]) == (35, 99)
    assert recording.dropped == 35_000
    recorder.add(numbers(1, 100_000), 101)
    assert recorder.make_recording("serial", 101, 1).size == MOST_RECORDED_BYTES
