"""The whole card of one instance: what the evidence proves, then what messages and bytes of DATA show."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from trcvtui.diagnosis.advice import Advice, make_advice
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import SuggestedAction
from trcvtui.diagnosis.receive import is_stuck
from trcvtui.errors import one_line
from trcvtui.history.records import MessageSpan
from trcvtui.history.stream_index import StreamIndex
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.wording import count

if TYPE_CHECKING:  # the screen explains before it imports a project
    from trcvtui.diagnosis.data_view import LayoutOffer
    from trcvtui.project.project import DataDecl


class DataContent(NamedTuple):
    """DATA of an instance, its bytes, and the bytes of the running job."""

    decl: DataDecl | None
    content: bytes
    partial: bytes


class CardBuilder:
    """Explains one instance after the other, and stores its last answers about bytes for the next call."""

    def __init__(self) -> None:
        self._suspected: tuple[object, bytes, str] | None = None  # layout, content, suspicion
        self._asked: tuple[str, object, int | None, bytes] | None = None
        self._offer: LayoutOffer | None = None

    def build_advice(
        self,
        e: Evidence,
        instance: InstanceSnapshot,
        index: StreamIndex,
        data: DataContent,
        reads: str,
        has_values: bool = True,
    ) -> Advice:
        """Return the advice after the last scan. `reads` begins a command to read DATA in another layout.

        If `has_values` is False, the advice has no value of DATA.
        """
        advice = make_advice(e)
        causes = advice.causes if advice.checks else tuple(list_frame_notes(instance, index))
        swapped = self._suspect_byte_order(e, data) if has_values else ""
        offer, do = self.find_offer(e, data, index), advice.do
        if offer is not None:
            read = SuggestedAction(f"{reads} {offer.choice}")
            do = (read, *do) if swapped else (read,)  # its size fits: only the layout is wrong
            swapped = swapped or one_line(offer.why)
        why, causes = advice.why + _describe_missing(e, data.decl), (swapped, *causes) if swapped else causes
        return Advice(why, causes, do, advice.code)

    def find_offer(self, e: Evidence, data: DataContent, index: StreamIndex) -> LayoutOffer | None:
        """Return a layout in which DATA fits the received bytes, None without evidence for one."""
        decl, content = data.decl, data.content
        if decl is None or e.facts.drop is not None:
            return None
        size = e.facts.messages.common_size
        if size is None and e.have and is_stuck(e):
            size = e.have
        if size is None or size != decl.size:
            content = _message_bytes(e.instance, data, index)
        elif e.done_scan is None or _has_shifting_frames(e):
            return None
        question = e.instance, decl.layout, size, content
        if question != self._asked:
            from trcvtui.diagnosis.data_view import find_layout_offer  # imported when the first bytes come

            # A few bytes show nothing: the offer that more of them have shown is kept.
            before = self._offer if self._asked is not None and self._asked[:3] == question[:3] else None
            found = find_layout_offer(decl, size, content)
            self._asked, self._offer = question, found or (before if size != decl.size else None)
        return self._offer

    def _suspect_byte_order(self, e: Evidence, data: DataContent) -> str:
        decl, content = data.decl, data.content
        if decl is None or e.done_scan is None or e.facts.drop is not None or _has_shifting_frames(e):
            return ""
        if self._suspected is None or self._suspected[:2] != (decl.layout, content):
            from trcvtui.diagnosis.data_view import byte_order_suspicion  # imported when a frame comes

            self._suspected = decl.layout, content, str(byte_order_suspicion(decl.layout, content) or "")
        return self._suspected[2]


def _message_bytes(name: str, data: DataContent, index: StreamIndex) -> bytes:
    """Return the longest part that begins with a message, or all bytes if no message is known."""
    known = [(data.partial, span) for span in index.list_messages(name, of_job=True)]
    known += [(data.content, span) for span in index.list_messages(name, of_job=False)]
    parts = [content[span.position : span.stop] for content, span in known if span.begins]
    return max(parts, key=len, default=b"" if known else data.partial or data.content)


def _has_shifting_frames(e: Evidence) -> bool:
    size = e.facts.messages.common_size
    return e.facts.messages.count > 1 and (size is None or size != e.done_len)


def _describe_missing(e: Evidence, decl: DataDecl | None) -> str:
    """Return where the bytes of a stuck frame end, or "" if that is unknown or the frame is shifted."""
    if decl is None or decl.size != e.need or not is_stuck(e):
        return ""
    if e.facts.drop is not None or _has_shifting_frames(e):
        return ""
    number = decl.layout.count_leaves_within(e.have)
    if not number or number == decl.layout.leaf_count:
        return ""
    last, next_ = decl.layout.leaf(number - 1), decl.layout.leaf(number)
    if not last.path or last.path.startswith("["):
        return ""  # an array's index says no more than the number of bytes does
    missing = f"{'the rest of ' if next_.offset < e.have else ''}{one_line(next_.path)}"
    after = decl.layout.leaf_count - number - 1
    if after == 1:
        missing += f" and {one_line(decl.layout.leaf(number + 1).path)}"
    elif after:
        missing += f" and the {after} members after it"
    return f". The last whole member is {one_line(last.path)}; {missing} {'are' if after else 'is'} missing"


def list_frame_notes(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    """If frames do not match the messages of an instance, return what is proven. With ADHOC, return []."""
    if instance.adhoc:
        return []
    return [*_note_shift(instance, index), *_note_unfinished_frame(instance, index)]


def _note_shift(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    messages = index.list_messages(instance.name, of_job=False)
    if not messages or messages[0].begins:
        return []
    if len(messages) == 1:
        part = messages[0]
        return [f"DATA begins with byte {part.first} of {_name(part)}: one message fills several frames"]
    first = messages[1]
    return [f"{_name(first)} begins at byte {first.position} of DATA: frames and messages are shifted"]


def _note_unfinished_frame(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    """Note that the newest message has arrived, but the job waits for bytes that were not sent."""
    messages = index.list_messages(instance.name, of_job=True)
    if not messages or not 0 < instance.have < instance.need:
        return []
    newest = messages[-1]
    if newest.position - newest.first + newest.whole != instance.have:
        return []
    missing = count(instance.need - instance.have, "byte")
    return [f"{_name(newest)}, {newest.whole} B, has fully arrived and ends {missing} before the frame does"]


def _name(message: MessageSpan) -> str:
    return f"{one_line(message.peer)}'s message {message.number}"
