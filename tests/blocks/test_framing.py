"""The framer against the vectors V01 to V40, and what must hold for any stream, cut anywhere."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.blocks.framing_vectors import VECTORS
from trcvtui.blocks.framing import KEPT_NOISE_BYTES, Frame, FrameEnding, Framer, Framing

MS = 1_000_000


def test_the_table_is_whole() -> None:
    assert [vector.id for vector in VECTORS] == [f"V{n:02}" for n in range(1, 41)]


# -- P1 to P6 ------------------------------------------------------------------------------------------

FEW = st.integers(0, 2)  # so few different bytes that prefixes and suffixes come often, also in part
MARKS = st.lists(FEW, max_size=4).map(bytes)
STREAMS = st.lists(FEW, max_size=60).map(bytes)
CUTS = st.lists(st.integers(0, 7), max_size=80)


def pieces(stream: bytes, cuts: list[int]) -> list[bytes]:
    """Return the stream in pieces; a cut of 0 is a call that finds nothing new."""
    found = []
    for cut in cuts:
        found.append(stream[:cut])
        stream = stream[cut:]
    return [*found, stream]


def frames_of(framer: Framer, framing: Framing, arriving: list[bytes]) -> tuple[list[Frame], bytes]:
    """Return all frames, a call each, and what is left over; calls go on until nothing happens any more."""
    queue, found, now = b"", [], 0
    for piece in arriving:
        queue += piece
        now += MS
        used, frame = framer.feed(queue, framing, now)
        queue = queue[used:]
        found += [frame] if frame is not None else []
    while queue:
        used, frame = framer.feed(queue, framing, now)
        queue = queue[used:]
        found += [frame] if frame is not None else []
    return found, queue


def byte_by_byte(framing: Framing, stream: bytes) -> list[Frame]:
    """Return the frames as section 4 says it, in its own words: a byte, a test, a byte."""
    frames, part, prefix = [], b"", framing.prefix
    is_begun = not prefix
    for n in range(len(stream)):
        part += stream[n : n + 1]
        ending = None
        if not is_begun:
            while part and not prefix.startswith(part):
                part = part[1:]
            is_begun = part == prefix
        if is_begun:
            marks = len(prefix) + len(framing.suffix)
            if framing.text and part.endswith(b"\0"):
                ending = FrameEnding.ZERO
            elif framing.suffix and len(part) >= marks and part.endswith(framing.suffix):
                ending = FrameEnding.SUFFIX
        if ending is None and len(part) == framing.size:
            is_good = is_begun and not framing.suffix and not framing.text
            ending = FrameEnding.SIZE if is_good else FrameEnding.OVERRUN
        if ending is not None:
            frames.append(Frame(part, ending))
            part, is_begun = b"", not prefix
    return frames


NO_ZERO = st.lists(st.integers(1, 3), max_size=4).map(bytes)
TEXTS = st.builds(Framing, st.integers(1, 9), NO_ZERO, NO_ZERO, text=st.just(True))
DATA = st.builds(Framing, st.integers(1, 9), MARKS, MARKS)
ALL = st.one_of(DATA, TEXTS)  # a STRING holds no 00


@pytest.mark.slow
@given(ALL, STREAMS, CUTS)
def test_p1_frames_do_not_depend_on_how_the_stream_is_cut(
    framing: Framing, stream: bytes, cuts: list[int]
) -> None:
    cut, whole = Framer(), Framer()
    frames = frames_of(cut, framing, pieces(stream, cuts))
    assert frames == frames_of(whole, framing, [stream])
    assert (cut.partial_frame, cut.discarded, cut.noise) == (
        whole.partial_frame,
        whole.discarded,
        whole.noise,
    )
    assert frames[0] == byte_by_byte(framing, stream)


@given(DATA, STREAMS)
def test_a_false_start_is_known_within_one_call_as_it_is_byte_by_byte(
    framing: Framing, stream: bytes
) -> None:
    at_once, single, was_busy = Framer(), Framer(), False
    at_once.feed(stream, framing, 0)
    for n in range(len(stream)):
        used, frame = single.feed(stream[n : n + 1], framing, 0)
        was_busy |= single.busy
        if frame is not None or not used:
            return  # one frame a call: from here on the calls differ
    assert (at_once.busy or at_once.had_false_start) is was_busy


@given(ALL, STREAMS, CUTS, st.integers(0, 3))
def test_p2_and_p5_nothing_is_lost_doubled_or_reordered(
    framing: Framing, stream: bytes, cuts: list[int], timeout_ms: int
) -> None:
    framing = Framing(framing.size, framing.prefix, framing.suffix, timeout_ms * MS, framing.text)
    framer, joined, noise, queue, now = Framer(), b"", 0, b"", 0
    for piece in pieces(stream, cuts):
        queue += piece
        now += MS
        used, frame = framer.feed(queue, framing, now)
        fresh = framer.discarded - noise
        joined += framer.noise[len(framer.noise) - fresh :] + (frame.content if frame else b"")
        noise, queue = framer.discarded, queue[used:]
    assert joined + framer.partial_frame + queue == stream


@given(ALL, STREAMS, CUTS)
def test_p3_and_p4_a_good_frame_has_its_marks_and_no_frame_is_longer_than_size(
    framing: Framing, stream: bytes, cuts: list[int]
) -> None:
    for content, ending in frames_of(Framer(), framing, pieces(stream, cuts))[0]:
        assert 0 < len(content) <= framing.size
        if ending in (FrameEnding.SUFFIX, FrameEnding.SIZE):
            assert content.startswith(framing.prefix)
            assert content.endswith(framing.suffix) or len(content) == framing.size
        if ending is FrameEnding.SUFFIX:
            assert content.endswith(framing.suffix)


@given(ALL, STREAMS, STREAMS, CUTS)
def test_p6_after_a_reset_a_framer_is_as_good_as_new(
    framing: Framing, before: bytes, after: bytes, cuts: list[int]
) -> None:
    used_one = Framer()
    frames_of(used_one, framing, [before])
    used_one.flush()
    assert frames_of(used_one, framing, pieces(after, cuts)) == frames_of(
        Framer(), framing, pieces(after, cuts)
    )


# -- bounds ----------------------------------------------------------------------------------------------


def test_noise_for_ever_is_counted_and_only_its_end_is_kept() -> None:
    framer, framing = Framer(), Framing(64, prefix=b"\x02")
    for _ in range(100):
        assert framer.feed(b"\xff" * 10_000, framing, 0) == (10_000, None)
    assert (framer.discarded, framer.noise, framer.busy) == (1_000_000, b"\xff" * KEPT_NOISE_BYTES, False)


def test_a_timeout_may_change_while_a_frame_is_half_here() -> None:
    framer = Framer()
    framer.feed(b"A", Framing(4, timeout_ns=50 * MS), 0)
    assert not framer.framing_changed(Framing(4, timeout_ns=20 * MS))
    assert framer.feed(b"", Framing(4, timeout_ns=20 * MS), 20 * MS) == (0, Frame(b"A", FrameEnding.GAP))
