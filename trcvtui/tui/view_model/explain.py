"""Why a block shows what it shows, or once showed: the evidence is put together, the rules are asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.rig.diagnosis.advice import Advice, advice_on, because
from trcvtui.rig.diagnosis.evidence import Evidence, evidence_now, evidence_then
from trcvtui.rig.diagnosis.receive import is_stuck
from trcvtui.rig.history.records import MessageSpan
from trcvtui.rig.history.stream_index import StreamIndex
from trcvtui.tui.formatting import count, plain
from trcvtui.tui.view_model.view_model import ViewModel


def notes_of(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    """Return what is proven about frames and messages of an instance; nothing where they agree."""
    if instance.adhoc:
        return []
    return [*_shifted(instance, index), *_unfinished(instance, index)]


def _shifted(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    """A message that begins inside DATA with the end of another one before it: the frames are shifted."""
    messages = index.messages(instance.name, of_job=False)
    if not messages or messages[0].begins:
        return []
    if len(messages) == 1:
        part = messages[0]
        return [f"DATA begins with byte {part.first} of {_name(part)}: one message fills several frames"]
    first = messages[1]
    return [f"{_name(first)} begins at byte {first.position} of DATA: frames and messages are shifted"]


def _unfinished(instance: InstanceSnapshot, index: StreamIndex) -> list[str]:
    """The newest message is wholly here, and the job still waits for bytes that nobody has sent."""
    messages = index.messages(instance.name, of_job=True)
    if not messages or not 0 < instance.have < instance.need:
        return []
    newest = messages[-1]
    if newest.position - newest.first + newest.whole != instance.have:
        return []
    missing = count(instance.need - instance.have, "byte")
    return [f"{_name(newest)}, {newest.whole} B, is wholly here and ends {missing} before the frame does"]


def _name(message: MessageSpan) -> str:
    return f"{plain(message.peer)}'s message {message.number}"


if TYPE_CHECKING:
    from trcvtui.rig.diagnosis.data_view import Offer


def why(shown: StatusEdge | InstanceSnapshot) -> str:
    """Return the evidence of a STATUS: what happened, which call and error, whose, and whether injected."""
    return because(shown.cause, shown.block)


class Explainer:
    """Explains the selected instance now, or an edge of its past; the last answers are kept."""

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self._edge: tuple[int, int, Advice] | None = None  # bench, line
        self._bytes: tuple[object, bytes, str] | None = None  # layout, content, suspicion
        self._asked: tuple[object, int | None, bytes] | None = None
        self._offer: Offer | None = None

    def now(self, instance: InstanceSnapshot) -> Advice:
        """Return what is known of an instance after the last scan."""
        view_model = self._view_model
        evidence = (
            evidence_now(view_model.picture, view_model.project, instance.name)
            if view_model.picture
            else None
        )
        if evidence is None:
            return Advice(why(instance), ())
        told = advice_on(evidence)
        checks = told.checks or tuple(notes_of(instance, view_model.stream_index))
        swapped = self._swapped(evidence)
        offer = self.offer(evidence)
        shown = (swapped, *checks) if swapped else checks
        if offer is not None:
            how = f"V reads DATA so: {plain(offer.why)} ({offer.choice})"
            shown = (shown[0], how, *shown[1:]) if swapped else (how, *shown)
        return Advice(told.why + self._missing(evidence), shown, told.code)

    def _missing(self, e: Evidence) -> str:
        """Return which member a stuck frame's bytes end at; of a shifted one nobody knows."""
        decl = self._view_model.declaration
        if decl is None or decl.size != e.need or not is_stuck(e):
            return ""
        if e.facts.drop is not None or self._wanders(e):
            return ""
        number = decl.layout.leaves_within(e.have)
        if not number or number == decl.layout.leaf_count:
            return ""
        last, next_ = decl.layout.leaf(number - 1), decl.layout.leaf(number)
        if not last.path or last.path.startswith("["):
            return ""  # an array's index says no more than the number of bytes does
        missing = f"{'the rest of ' if next_.offset < e.have else ''}{plain(next_.path)}"
        after = decl.layout.leaf_count - number - 1
        if after == 1:
            missing += f" and {plain(decl.layout.leaf(number + 1).path)}"
        elif after:
            missing += f" and the {after} members after it"
        return f"; {plain(last.path)} is the last whole member, {missing} {'are' if after else 'is'} missing"

    def offer(self, e: Evidence | None = None) -> Offer | None:
        """Return the layout in which DATA would take what came, None where nothing speaks for one."""
        view_model, decl = self._view_model, self._view_model.declaration
        if e is None and view_model.picture and view_model.instance:
            e = evidence_now(view_model.picture, view_model.project, view_model.instance.name)
        if e is None or decl is None or e.facts.drop is not None:
            return None
        size, content = e.facts.messages.only, view_model.data
        if size is None and e.have and is_stuck(e):
            size = e.have
        if size is None or size != decl.size:
            content = view_model.partial or content
        elif e.done_scan is None or self._wanders(e):
            return None
        asked = decl.layout, size, content
        if asked != self._asked:
            from trcvtui.rig.diagnosis.data_view import offer_for  # read when the first bytes are here

            self._asked, self._offer = asked, offer_for(decl, size, content)
        return self._offer

    def _swapped(self, e: Evidence) -> str:
        """Return whether the last frame's members look swapped; a shifted one proves nothing."""
        decl, content = self._view_model.declaration, self._view_model.data
        if decl is None or e.done_scan is None or e.facts.drop is not None or self._wanders(e):
            return ""
        if self._bytes is None or self._bytes[0] is not decl.layout or self._bytes[1] != content:
            from trcvtui.rig.diagnosis.data_view import (
                byte_order_suspicion,  # read when the first frame is here
            )

            self._bytes = decl.layout, content, str(byte_order_suspicion(decl.layout, content) or "")
        return self._bytes[2]

    @staticmethod
    def _wanders(e: Evidence) -> bool:
        size = e.facts.messages.only
        return e.facts.messages.count > 1 and (size is None or size != e.done_len)

    def then(self, line: Line, edge: StatusEdge) -> Advice:
        """Return what the ledger knows of an edge of the past; the newest one still shows, so it is now."""
        edges, instance = self._view_model.history.of(edge.instance), self._view_model.instance
        if instance is not None and edges and edges[-1].seq == line.seq:
            return self.now(instance)
        asked = self._view_model.bench, line.seq
        if self._edge is None or self._edge[:2] != asked:
            self._edge = (*asked, self._explained(line, edge))
        return self._edge[2]

    def _explained(self, line: Line, edge: StatusEdge) -> Advice:
        from trcvtui.rig.history.link_statistics import facts_while  # read when the past is first asked about

        project = self._view_model.project
        decl = project.instance(edge.instance)
        facts, until = facts_while(self._view_model.lines, line, edge, decl.connect if decl else "")
        return advice_on(evidence_then(line, edge, facts, until, project, self._interval_ns))

    @property
    def _interval_ns(self) -> int:
        return self._view_model.snapshot.interval_ns if self._view_model.snapshot else 0
