"""The packets of a run, made entry by entry: packets of the present block, pointers to them, and comments.

Rule 1: an entry points to packets in its block that carry its bytes. Else the entry keeps the bytes.
Rule 2: a comment marks the end of a job at the packet with the last byte of the job. If this block lacks
that packet, the comment says so. The comment is then at the connection's newest packet, or at the block.
Rule 3: files of a run share one RunPackets. So open connections keep their sequence numbers, ports and
unread bytes in the next file.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from trcvtui.net.results import Datagram, Fault
from trcvtui.recording.arrivals import BYTES_ARRIVED, ENDED, MESSAGE
from trcvtui.recording.journal import IN_GAP, RECV, SHOWS, STEP, CallRecord, Entry, PacketRuns, WireCall
from trcvtui.recording.wire import NO_FLOWS, RST, Flow, WirePacket, WirePackets

LOSS_SCANS: Final = 2  # within which a block shows the partner's end
JOURNAL_PACKET: Final = -1  # in place of a packet's number: the block's own packet


class RunPackets:
    def __init__(self) -> None:
        self.wire = WirePackets()
        self._now = 0
        self._layered: set[int] = set()  # handles with a session: the wire has other bytes
        self._jobs: dict[str, int] = {}
        self._readers: dict[str, set[str]] = {}  # of each CONNECT: instances that receive
        self._coming: WireCall | None = None  # a read: the next entry has its bytes
        self._at: dict[str, Callable[[CallRecord], CallRecord | None]] = {
            STEP: self._begin_scan,
            SHOWS: self._comment_job_end,
            "set_options": self._note_session,
            **dict.fromkeys((RECV, "recv_from"), self._handle_read),
            **dict.fromkeys((IN_GAP + BYTES_ARRIVED, IN_GAP + MESSAGE), self._handle_arrival),
            **dict.fromkeys(("send", "send_to"), self._handle_send),
            "probe": self._handle_probe,
            "discard": self._handle_discard,
            **dict.fromkeys(("close", "abort"), self._handle_close),
        }
        self.begin_block()

    def begin_block(self) -> None:
        self.packets: list[WirePacket] = []
        self.comments: dict[int, list[str]] = {}  # by number of the packet
        self.size = 0  # bytes of payload
        self._numbers: dict[Flow, tuple[list[int], list[int]]] = {}  # packets: place, number
        self._scan_from = 0  # number of the first packet of this scan

    def add_wire_call(self, call: WireCall) -> None:
        if call.call == RECV and not call.data and call.answer and isinstance(call.answer, int):
            self._coming = call
        else:
            self._add_packets(self.wire.make_packets(call))

    def _add_packets(self, made: Iterator[WirePacket]) -> None:
        for packet in made:
            number = len(self.packets)
            self.packets.append(packet)
            self.size += packet.payload
            if packet.remark:
                self.comments.setdefault(number, []).append(packet.remark)
            if packet.flow is not None:
                places, numbers = self._numbers.setdefault(packet.flow, ([], []))
                places.append(packet.at)
                numbers.append(number)

    def process_entry(self, entry: CallRecord) -> CallRecord:
        """Take an entry of the journal; return it with a pointer in place of bytes that packets carry."""
        made = self._at.get(entry[1])
        return (made(entry) if made else None) or entry

    def _begin_scan(self, entry: CallRecord) -> None:
        if isinstance(entry.answer, int):
            self._now = entry.answer
            self.wire.scan += 1
            self._scan_from = len(self.packets)

    def _note_session(self, entry: CallRecord) -> None:
        if entry.args[-1]:  # it has a session
            self._layered.add(_get_handle(entry))

    def _handle_close(self, entry: CallRecord) -> None:
        self._layered.discard(_get_handle(entry))

    def _handle_read(self, entry: CallRecord) -> CallRecord:
        if not isinstance(entry.answer, tuple):
            return entry
        got, data = entry.answer
        coming, self._coming = self._coming, None  # add_wire_call kept it
        if coming is not None and coming.handle == _get_handle(entry):
            self._add_packets(self.wire.make_packets(coming._replace(data=data)))
        flows = self.wire.flows.get(_get_handle(entry))
        if flows is None or not (data or isinstance(got, Datagram)):
            return entry
        flow = flows[1]
        at, end = flow.taken - len(data), flow.taken
        if flow.unread:  # a datagram: its packet came with its arrival
            flow.read.append(flow.unread.popleft())
            at = flow.read[-1].at
            end = at + max(1, flow.read[-1].payload)
        elif isinstance(got, Datagram):  # a message of ISO-on-TCP
            end = flow.find_tsdu_end()
        flow.ends.append((self.wire.scan, end))
        return CallRecord(entry.owner, entry.call, entry.args, (got, self._find_packets(flow, at, data)))

    def _handle_arrival(self, entry: CallRecord) -> CallRecord:
        flows, data = self.wire.flows.get(_get_handle(entry)), entry.answer
        if flows is None or not isinstance(data, bytes):
            return entry
        at = (
            flows[1].in_packets - len(data) - (entry.call == IN_GAP + MESSAGE)
        )  # a datagram has one byte more
        return entry._replace(answer=self._find_packets(flows[1], at, data))

    def _handle_send(self, entry: CallRecord) -> None:
        flows = self.wire.flows.get(_get_handle(entry))
        if flows is not None and isinstance(entry.answer, int):
            flow, is_whole = flows[0], entry.answer == entry.args[1]
            if is_whole:
                end = flow.whole if flow.is_stream else flow.in_packets - 1
                flow.ends.append((self.wire.scan + (not flow.is_part), end))  # of one call: a scan later
            flow.is_part = not is_whole

    def _handle_probe(self, entry: CallRecord) -> None:
        """Treat a failed probe as a failed `shutdown`: the partner's RST came before our end."""
        call = WireCall(self._now, entry.owner, "shutdown", _get_handle(entry), (), entry.answer, b"")
        self._add_packets(self.wire.make_packets(call) if isinstance(entry.answer, Fault) else iter(()))

    def _handle_discard(self, entry: CallRecord) -> None:
        flows = self.wire.flows.get(_get_handle(entry))
        if flows is not None and isinstance(entry.answer, int) and _get_handle(entry) not in self._layered:
            flows[1].taken += entry.answer
            flows[1].whole = max(flows[1].whole, flows[1].taken)

    # -- what points to packets -------------------------------------------------------------------------

    def _find_packets(self, flow: Flow, at: int, data: bytes) -> bytes | PacketRuns:
        """Return pointers to bytes in packets of this block; if some are not there, return the bytes."""
        places, numbers = self._numbers.get(flow, ([], []))
        runs: list[tuple[int, int, int]] = []
        done, before = 0, -2
        for number in numbers[max(0, bisect_right(places, at) - 1) :]:
            packet = self.packets[number]
            skip, head = at + done - packet.at, len(packet.data) - packet.payload
            size = min(packet.payload - skip, len(data) - done)
            part = packet.data[head + skip : head + skip + size]
            if done == len(data) or skip < 0 or size <= 0 or part != data[done : done + size]:
                break  # Rule 1: other bytes, or a hole
            if number == before + 1:
                runs[-1] = (*runs[-1][:2], runs[-1][2] + size)
            else:
                runs.append((number, skip, size))
            done, before = done + size, number
        return PacketRuns(tuple(runs)) if 0 < done == len(data) else data

    # -- comments ---------------------------------------------------------------------------------------

    def _comment_job_end(self, shows: CallRecord) -> None:
        connect, status, busy, done, error, length = (*shows.args, *[None] * 6)[:6]
        ours, theirs = self.wire.newest.get(str(connect), NO_FLOWS)
        readers = self._readers.setdefault(str(connect), set())
        if length is not None:  # RCVD_LEN: it receives
            readers.add(shows.owner)
        if not (done or error) or not isinstance(status, int):
            if not busy and readers == {shows.owner}:  # its job was cancelled
                theirs.take_failed_job_end(self.wire.scan)
            return
        job = self._jobs[shows.owner] = self._jobs.get(shows.owner, 0) + 1
        size = "" if length is None or error else f" {length} B"
        ends = f"{'ERROR' if error else 'DONE'}{size}, job {job}, scan {self.wire.scan}"
        text = f"{shows.owner}: 16#{status:04X} {ends}"
        flow, scan = ours if length is None else theirs, self.wire.scan
        if done:  # of several readers, the length says whose end it is
            expected = flow.job + length if isinstance(length, int) and len(readers) > 1 else 0
            place = flow.take_job_end(scan, expected, flow is ours) - 1
        else:
            place = flow.take_failed_job_end(scan) - 1
            if theirs.ended_in >= scan - LOSS_SCANS:  # the partner's FIN or RST is the reason
                flow, place = theirs, theirs.in_packets
        if place >= 0:
            self._add_comment(text, flow, place, theirs if flow is ours else ours)
        else:
            numbers = range(self._scan_from, len(self.packets))
            of_it = [number for number in numbers if connect in self.packets[number].owners]
            self.comments.setdefault(max(of_it, default=JOURNAL_PACKET), []).append(text)

    def _add_comment(self, text: str, flow: Flow, at: int, back: Flow) -> None:
        places, numbers = self._numbers.get(flow, ([], []))
        found = bisect_right(places, at) - 1
        number = numbers[found] if found >= 0 else JOURNAL_PACKET
        if found < 0 or at >= places[found] + max(1, self.packets[number].payload):
            byte = f", sequence number {at + 1}" if flow.is_stream else ""
            text += f", in {'an earlier' if at <= flow.in_packets else 'a later'} packet{byte}"  # Rule 2
            number = max([*numbers[-1:], *self._numbers.get(back, ([], []))[1][-1:]], default=JOURNAL_PACKET)
        self.comments.setdefault(number, []).append(text)

    # -- the next file ----------------------------------------------------------------------------------

    def follow_entries(self, entries: Iterable[Entry]) -> None:
        """Follow connections through entries that no file gets: the next file continues the connections."""
        for entry in entries:
            if isinstance(entry, CallRecord):
                self.process_entry(entry)
            elif isinstance(entry, WireCall):
                self.add_wire_call(entry)
        self.begin_block()

    def begin_file(self) -> list[CallRecord]:
        """Begin a file; return entries for the unread bytes of the connections that are open now."""
        self.begin_block()
        self._add_packets(self.wire.begin_file(self._now))
        notes: list[CallRecord] = []
        for owner, handle, flow, end in self.wire.list_open_streams():
            if handle not in self._layered:
                unread = bytes(flow.tail[len(flow.tail) - max(0, flow.in_packets - flow.taken) :])
                place = self._find_packets(flow, flow.in_packets - len(unread), unread)
                args = handle, flow.whole, flow.whole - flow.taken, 0
                notes.append(CallRecord(owner, IN_GAP + BYTES_ARRIVED, args, place))
                if end:
                    notes.append(
                        CallRecord(owner, IN_GAP + ENDED, (handle, 0), "rst" if end & RST else "fin")
                    )
        return notes


def _get_handle(entry: CallRecord) -> int:
    handle = entry.args[0] if entry.args else None
    return handle if isinstance(handle, int) else -1
