"""Messages for ad-hoc shadows. Pauses separate them, as in `trcvtui messages`."""

from __future__ import annotations

from collections import Counter

from msgspec.structs import replace

from trcvtui.capture.reassembly import ConversationEvent, WireDirection
from trcvtui.diagnosis.cut_messages import MessageCutter, MessageCutters
from trcvtui.history.messages import MessagesDelta, NewestRows
from trcvtui.history.records import MAX_SCAN
from trcvtui.line.shadows import ShadowPlan, find_directions
from trcvtui.net.received_ring import ReceivedRings


class PauseMessages(NewestRows):
    """Message rows by shadow; the scan of a row is 0 until the shadows have run."""

    def __init__(self, plan: ShadowPlan, first_ns: int) -> None:
        self._rings = ReceivedRings()
        super().__init__(self._rings.get, after=-1)
        self._plan, self._first_ns = plan, first_ns
        self._cutters = MessageCutters(self._make_cutter)
        self._numbers = Counter[str]()

    def add_event(self, event: ConversationEvent) -> None:
        self._cutters.add_event(event)

    def make_delta(self, instance: str, since: int, until: int = MAX_SCAN) -> MessagesDelta:
        return replace(super().make_delta(instance, since, until), are_typed=False)

    def finish(self, ns: int) -> None:
        self._cutters.end_all(ns)

    def _make_cutter(self, direction: WireDirection) -> MessageCutter | None:
        plan, conversation = self._plan, direction.conversation
        is_plc = find_directions(plan.guesses[conversation.number], conversation)[0] is direction
        heard = {part.connect for part in plan.parts[conversation.number] if part.plays_plc == is_plc}
        names = [each.name for each in plan.project.instances if each.connect in heard]
        if not names:
            return None

        def add_message(ns: int, content: bytes, size: int, reason: str, begins: bool) -> None:
            for name in names:
                self._numbers[name] += 1
                at = self._rings.open_ring(name).append(content + bytes(size - len(content)))
                number, t_ns = self._numbers[name], ns - self._first_ns
                self.add_row(name, number, 0, t_ns, size, name, [(at, size)], reason, len(content))

        return MessageCutter(0, add_message)
