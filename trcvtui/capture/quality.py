"""What is missing or doubtful in the captured packets of a conversation."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from trcvtui.capture.reassembly import Conversation

LARGEST: Final = 1460  # bytes of a segment on Ethernet; larger ones were put together in the network card
FEW_SEGMENTS: Final = 3  # with fewer segments equal time stamps say nothing


class CaptureLimit(StrEnum):
    """One word for each thing that a capture may lack."""

    STARTS_LATE = "starts-late"  # no SYN of either end
    NO_LIFE = "no-life"  # starts late, and not both ends sent bytes that were acknowledged
    GAPS = "gaps"  # acknowledged bytes are not in the capture, or numbers jump
    SNAPLEN = "snaplen"  # packets are cut off
    DUPLICATED = "duplicated"  # the copies of a mirror port
    ONE_DIRECTION = "one-direction"  # an end acknowledges bytes that the capture lacks
    CLOCK = "clock"  # time goes back or does not advance
    ACKS_MISSING = "acks-missing"  # an end sends more than the window in the capture allows
    ENDS_EARLY = "ends-early"  # neither FIN nor RST
    DROPS = "drops"  # the capturing program reports lost packets
    LARGE_SEGMENTS = "large-segments"
    SESSION = "session"  # TLS or ISO-on-TCP where plain bytes were expected


def find_limits(conversation: Conversation, drops: int = 0) -> tuple[CaptureLimit, ...]:
    """Return what a conversation lacks; a recording of ours lacks nothing."""
    if conversation.sent is not None or conversation.protocol == "serial":
        return ()
    ends = (conversation.there, conversation.back)
    is_tcp = conversation.protocol == "tcp"
    starts_late = is_tcp and not conversation.begins_with_syn
    is_stopped = (
        conversation.first_ns == conversation.last_ns and sum(e.segments for e in ends) >= FEW_SEGMENTS
    )
    rows = (
        (CaptureLimit.STARTS_LATE, starts_late),
        (CaptureLimit.NO_LIFE, starts_late and not all(end.is_heard for end in ends)),
        (CaptureLimit.GAPS, is_tcp and any(end.missing > end.cut or end.has_jumped for end in ends)),
        (CaptureLimit.SNAPLEN, conversation.is_cut),
        (CaptureLimit.DUPLICATED, any(end.copies for end in ends)),
        (CaptureLimit.ONE_DIRECTION, is_tcp and any(e.told_ack < 0 and e.other.told_ack > 0 for e in ends)),
        (CaptureLimit.CLOCK, conversation.goes_back or is_stopped),
        (CaptureLimit.ACKS_MISSING, any(end.has_overrun for end in ends)),
        (CaptureLimit.ENDS_EARLY, is_tcp and conversation.end is None),
        (CaptureLimit.DROPS, drops > 0),
        (CaptureLimit.LARGE_SEGMENTS, any(end.largest > LARGEST for end in ends)),
    )
    return tuple([quality for quality, holds in rows if holds])
