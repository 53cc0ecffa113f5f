"""Where bytes came from, and what follows: frames that end elsewhere than the peer's messages."""

from __future__ import annotations

import pytest

from tests.tui.fakes import receiving
from trcvtui.blocks.environment import ReceiveEnded, ReceiveStarted
from trcvtui.diagnosis.status_card import list_frame_notes
from trcvtui.history.records import MAX_SCAN
from trcvtui.history.stream_index import KEPT_STREAMS, StreamIndex
from trcvtui.net.events import BytesReceived, ConnectionChanged, EventKind
from trcvtui.plc.ledger import Event, PeerSent

KEPT = 2000
PLC, PEER = "127.0.0.1:2000", "127.0.0.1:51322"


def told(*events: Event, scan: int = 40) -> StreamIndex:
    index = StreamIndex(kept_messages=KEPT, kept_recvs=KEPT)
    for number, event in enumerate(events):
        index.dispatch_events([(scan + number, 0, event)])
    return index


def connected(incarnation: int = 1) -> ConnectionChanged:
    return ConnectionChanged("C1", incarnation, EventKind.CONNECTED, PLC, PEER)


def sent(message: int, offset: int, size: int) -> PeerSent:
    return PeerSent("P1", message, PEER, PLC, offset, size)


def taken(
    recv: int, offset: int, size: int, incarnation: int = 1, instance: str = "TRCV_C_1"
) -> BytesReceived:
    return BytesReceived("C1", incarnation, recv, offset, size, instance)


def started(job: int, offset: int, length: int = 24) -> ReceiveStarted:
    return ReceiveStarted("TRCV_C_1", job, "C1", 1, offset, length, False)


def ended(job: int, offset: int, size: int, done: bool = True) -> ReceiveEnded:
    return ReceiveEnded("TRCV_C_1", job, "C1", 1, offset, size, done, "")


def test_a_byte_of_data_knows_job_recv_and_message() -> None:
    ledger = told(
        connected(), started(1, 0), sent(1, 0, 10), taken(1, 0, 10), sent(2, 10, 14), taken(2, 10, 14)
    )
    ledger.dispatch_events([(50, 0, ended(1, 0, 24))])
    origin = ledger.find_origin("TRCV_C_1", of_job=False, byte=12)
    assert origin is not None and origin.recv is not None and origin.message is not None
    assert (origin.job.number, origin.recv.number, origin.recv.scan) == (1, 2, 45)
    assert (origin.message.peer, origin.message.number, origin.message.first) == ("P1", 2, 2)
    assert ledger.find_origin("TRCV_C_1", of_job=False, byte=24) is None


def test_a_job_without_done_leaves_data_to_the_one_before() -> None:
    ledger = told(connected(), started(1, 0), ended(1, 0, 24), started(2, 24), ended(2, 24, 5, done=False))
    origin = ledger.find_origin("TRCV_C_1", of_job=False, byte=0)
    assert origin is not None
    assert origin.job.number == 1


def test_bytes_of_another_incarnation_are_not_mixed_in() -> None:
    ledger = told(
        connected(), started(1, 0), taken(1, 0, 24), ended(1, 0, 24), connected(2), taken(1, 0, 9, 2)
    )
    origin = ledger.find_origin("TRCV_C_1", of_job=False, byte=3)
    assert origin is not None
    assert (origin.recv, origin.message) == (None, None)


def in_turns() -> StreamIndex:
    """Return two jobs that read in turns: X has bytes 0-3 and 8-11, Y has 4-7; each message has three."""
    x, y = "TRCV_C_1", "TRCV_C_2"
    ledger = told(connected(), *(sent(n + 1, 3 * n, 3) for n in range(4)), started(1, 0, 8))
    ledger.dispatch_events([(50, 0, ReceiveStarted(y, 1, "C1", 1, 0, 4, False))])
    for recv, (offset, instance) in enumerate(((0, x), (4, y), (8, x)), 1):
        ledger.dispatch_events([(50 + recv, 0, taken(recv, offset, 4, instance=instance))])
    return ledger


@pytest.mark.parametrize("of_job", [True, False])
def test_jobs_that_read_in_turns_know_their_own_bytes(of_job: bool) -> None:
    ledger = in_turns()
    if not of_job:
        ledger.dispatch_events([(60, 0, ended(1, 0, 8))])
        ledger.dispatch_events([(60, 0, ReceiveEnded("TRCV_C_2", 1, "C1", 1, 4, 4, True, ""))])
    found = [ledger.find_origin("TRCV_C_1", of_job, byte) for byte in range(8)]
    recvs = [origin.recv.number for origin in found if origin is not None and origin.recv is not None]
    assert recvs == [1, 1, 1, 1, 3, 3, 3, 3]
    messages = [
        origin.message.number for origin in found if origin is not None and origin.message is not None
    ]
    assert messages == [1, 1, 1, 2, 3, 4, 4, 4]
    assert ledger.list_message_starts("TRCV_C_1", of_job) == {0, 3, 5}
    first = ledger.find_origin("TRCV_C_2", of_job, 0)
    assert first is not None and first.recv is not None and first.message is not None
    assert (first.recv.number, first.message.number, first.message.first) == (2, 2, 1)
    assert ledger.list_message_starts("TRCV_C_2", of_job) == {2}


def test_a_job_that_was_cut_very_often_costs_no_more_memory() -> None:
    ledger = told(connected(), started(1, 0, 10_000))
    for n in range(2 * KEPT):
        ledger.dispatch_events([(n, 0, taken(n, 2 * n, 1, instance="TRCV_C_1"))])
    assert len(ledger._readings["TRCV_C_1"].reads) == KEPT
    assert ledger.find_origin("TRCV_C_1", of_job=True, byte=5) is not None


def test_what_is_remembered_is_bounded() -> None:
    ledger = told(connected())
    for n in range(3 * KEPT):
        ledger.dispatch_events([(n, 0, taken(n, n, 1))])
        ledger.dispatch_events([(n, 0, PeerSent("P1", n, f"10.0.0.1:{n}", PLC, 0, 1))])
    assert len(ledger._readings["TRCV_C_1"].reads) == KEPT
    assert len(ledger._sent) == KEPT_STREAMS


def test_frames_that_agree_with_messages_need_no_word() -> None:
    ledger = told(connected(), started(1, 0), sent(1, 0, 24), ended(1, 0, 24), started(2, 24))
    assert list_frame_notes(receiving(have=0), ledger) == []
    assert ledger.list_message_starts("TRCV_C_1", of_job=False) == {0}


def test_shifted_frames_are_named_with_their_shift() -> None:
    ledger = told(connected(), started(1, 0), sent(1, 0, 5), sent(2, 5, 24), sent(3, 29, 24))
    for job in (1, 2):
        ledger.dispatch_events([(50, 0, ended(job, 24 * (job - 1), 24))])
    assert list_frame_notes(receiving(have=0), ledger) == [
        "P1's message 3 begins at byte 5 of DATA: frames and messages are shifted"
    ]
    assert ledger.list_message_starts("TRCV_C_1", of_job=False) == {5}


def test_one_message_over_several_frames_is_named() -> None:
    ledger = told(
        connected(), sent(1, 0, 100), started(1, 0), ended(1, 0, 24), started(2, 24), ended(2, 24, 24)
    )
    assert list_frame_notes(receiving(have=0), ledger) == [
        "DATA begins with byte 24 of P1's message 1: one message fills several frames"
    ]


def test_a_message_that_is_shorter_than_the_frame_is_named() -> None:
    ledger = told(connected(), started(1, 0), sent(1, 0, 17), taken(1, 0, 17))
    assert list_frame_notes(receiving(have=17, need=24), ledger) == [
        "P1's message 1, 17 B, has fully arrived and ends 7 bytes before the frame does"
    ]
    assert list_frame_notes(receiving(have=12, need=24), ledger) == [], "its end is still on the way"


def test_it_knows_from_when_to_when_a_connect_had_lost_its_partner() -> None:
    index = StreamIndex(kept_messages=KEPT, kept_recvs=KEPT)
    kinds = EventKind
    for t_ns, what, detail in (
        (1, kinds.LISTENING, ""), (2, kinds.CONNECTED, ""), (5, kinds.LOST, ""), (6, kinds.STOPPED, ""),
        (7, kinds.LISTENING, ""), (9, kinds.CONNECTED, ""), (12, kinds.RESET, ""),
        (14, kinds.LISTENING, "UDP"), (20, kinds.DISCONNECTED, ""),
    ):  # fmt: skip
        index.dispatch_events([(t_ns, t_ns, ConnectionChanged("C1", 1, what, detail=detail))])
    assert index.list_down_times("C1") == [(5, 9), (12, 14), (20, MAX_SCAN)]
    assert index.list_down_times("C2") == []
