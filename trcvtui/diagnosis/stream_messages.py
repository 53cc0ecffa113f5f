"""Finds whole messages in a received stream: as a peer sent them, one per job, or split at pauses."""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.diagnosis.evidence import Evidence
from trcvtui.history.records import HistoryWindow
from trcvtui.history.stream_index import find_bursts
from trcvtui.plc.ledger import A_HOLE, A_PACKET


class StreamMessage(NamedTuple):
    """One message; with `by_pauses`, all bytes between two pauses, which may be several messages."""

    name: str
    positions: range
    by_pauses: bool = False
    content: bytes = b""


def find_whole_messages(window: HistoryWindow, e: Evidence) -> list[StreamMessage]:
    """Return the messages that are known to be whole, oldest first, or [] if their ends are unknown.

    Bytes of a running job are left out, as the next bytes may belong to the same message.
    """
    running = min([job.position for job in window.jobs if job.is_open], default=window.stop)
    recvs = [recv for recv in window.recvs if recv.stop <= running]
    by_pauses = False
    sent = [span for span in window.messages if span.peer not in (A_PACKET, A_HOLE)]
    if sent:
        whole = [span for span in sent if span.begins and span.ends]
        found = [(f"{span.peer} message {span.number}", range(span.position, span.stop)) for span in whole]
    elif e.is_datagram or e.has_messages or e.buffer is not None:
        jobs = [job for job in window.jobs if job.done]
        found = [(f"{job.instance} job {job.number}", range(job.position, job.stop)) for job in jobs]
    else:
        by_pauses = True
        last = recvs[-1] if recvs else None
        has_last = last is not None and last.offset + last.size == e.facts.received
        bursts = find_bursts(recvs, has_last and not e.is_arriving)
        found = [(f"message by pauses from byte {each.start}", each) for each in bursts]
    return [
        StreamMessage(name, at, by_pauses, window.part(at))
        for name, at in found
        if at.stop <= running and window.has_values(at)
    ]
