"""Pane 7 of a line: conversations of a capture or tap, a row per direction; keys intervene in a tap."""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from trcvtui.snapshots.conversations import ARMED_TAP, ConversationSnapshot, DirectionSnapshot
from trcvtui.tui.formatting import clip, pad
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, Part, Row, row
from trcvtui.wording import format_ns

SPARK_BLOCKS: Final = " ▁▂▃▄▅▆▇█"
SPARK_SECONDS: Final = 15  # seconds that are drawn
ROOMY: Final = 110
STATE_STYLES: Final = {"open": "on", "reset": "error", "ended": "dim", "connecting": "warn"}
MOST_EDITED_BYTES: Final = 64  # held bytes that the prompt is filled with


class Intervention(NamedTuple):
    """A key and its command words. If `is_asked` is True, you type the rest in the prompt."""

    key: str
    verb: str
    label: str
    is_asked: bool = False


INTERVENTIONS: Final = (
    Intervention("h", "hold", "hold, go"),
    Intervention("e", "edit", "edit", is_asked=True),
    Intervention("i", "insert hex", "insert", is_asked=True),
    Intervention("d", "drop", "drop", is_asked=True),
    Intervention("y", "delay T#", "delay", is_asked=True),
    Intervention("s", "split", "split", is_asked=True),
    Intervention("r", "rst", "RST"),
    Intervention("f", "fin", "FIN"),
)


class ConversationList(LineView):
    """Two rows for each conversation, one for each direction; keys act on the direction at the cursor."""

    KEYS: ClassVar = (*((each.key, each.label) for each in INTERVENTIONS), ("w", "shadow"))
    BINDINGS: ClassVar = [
        *((each.key, f"intervene('{each.key}')", each.label) for each in INTERVENTIONS),
        ("w", "shadow", "shadow"),
    ]
    DEFAULT_CSS = "ConversationList { height: 1fr; display: none; }"

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks) -> None:
        super().__init__(id="talks")
        self._view_model, self._actions = view_model, actions
        self._chosen = 0, True  # number of the conversation; True: its direction to the PLC end

    @property
    def title(self) -> str:
        talks = self._view_model.conversations
        open_count = sum(talk.state not in ("ended", "reset") for talk in talks)
        return f"Line · {open_count} open of {len(talks)}"

    def row_count(self) -> int:
        """Return the number of rows: two for each conversation; without conversations, one for each tap."""
        return 2 * len(self._view_model.conversations) or len(self._view_model.project.taps)

    def row_at(self, y: int) -> Row:
        talks, taps = self._view_model.conversations, self._view_model.project.taps
        if not talks:
            tap = taps[y]
            return row((f"  {tap.name}: {tap.listen} to {tap.to}: no conversation yet", "dim"))
        talk, to_plc = talks[y // 2], not y % 2
        is_chosen = (talk.number, to_plc) == self._chosen_direction()
        way = talk.to_plc if to_plc else talk.from_plc
        parts: list[Part] = [
            ("▸ " if is_chosen else "  ", "key"),
            (pad(f"C{talk.number}" if to_plc else "", 5), "strong"),
            (pad("to PLC" if to_plc else "from PLC", 9), ""),
            *_held_parts(way),
            (f"{way.size:>9} B {way.rate:>7} B/s ", ""),
        ]
        parts += _ends(talk, self.line_width >= ROOMY) if to_plc else _spark(talk)
        parts += _figures(way, self.line_width >= ROOMY)
        parts += _remarks(way)
        return row(*parts, style=self.cursor_style(is_chosen))

    def _chosen_direction(self) -> tuple[int, bool]:
        talks = self._view_model.conversations
        if self._chosen[0] not in {talk.number for talk in talks}:
            self._chosen = talks[0].number if talks else 0, True
        return self._chosen

    def _find_conversation(self) -> ConversationSnapshot | None:
        number = self._chosen_direction()[0]
        return next((talk for talk in self._view_model.conversations if talk.number == number), None)

    def action_move(self, rows: int) -> None:
        numbers = [talk.number for talk in self._view_model.conversations]
        if numbers:
            number, to_plc = self._chosen_direction()
            self._choose(2 * numbers.index(number) + (not to_plc) + rows)

    def click(self, x: int, y: int) -> None:
        self._choose(y)

    def _choose(self, y: int) -> None:
        if not self._view_model.conversations:
            return
        y = max(0, min(self.row_count() - 1, y))
        self._chosen = self._view_model.conversations[y // 2].number, not y % 2
        self.keep_in_view(y)
        self.show()

    def action_shadow(self) -> None:
        self._actions.submit("watch")

    def action_intervene(self, key: str) -> None:
        """Put a key's command into the prompt; hold, go and (on an armed tap) RST and FIN run at once."""
        talk, picture = self._find_conversation(), self._view_model.live
        if talk is None or not talk.tap:
            waits = talk is None and self._view_model.project.taps
            why = "no conversation yet" if waits else "only a tap can intervene: trcvtui tap LISTEN CONNECT"
            self._actions.complain(why)
            return
        what = next(each for each in INTERVENTIONS if each.key == key)
        to_plc = self._chosen_direction()[1]
        way = talk.to_plc if to_plc else talk.from_plc
        if what.verb in ("edit", "drop") and not way.held:
            self._actions.complain("nothing is held in this direction: press h to hold it")
            return
        verb = "go" if what.verb == "hold" and way.held is not None else what.verb
        line, number = f"tap {talk.tap} {'to-plc' if to_plc else 'from-plc'}", f"conversation {talk.number}"
        if what.is_asked:
            line, held = f"{line} {number} {verb}", way.first[:MOST_EDITED_BYTES].hex(" ")
            self._actions.open_prompt(f"{line} 0 hex {held}" if verb == "edit" else _prompt_text(line, way))
        else:
            acts = what.verb == "hold" or (picture is not None and picture.kernel == ARMED_TAP)
            (self._actions.submit if acts else self._actions.open_prompt)(f"{line} {verb} {number}")


def _prompt_text(line: str, way: DirectionSnapshot) -> str:
    """Return the text to put into the prompt. A `drop` line ends with the number of held bytes."""
    if line.endswith(" drop"):
        return f"{line} {way.held or 0}"
    return line if line.endswith("#") else f"{line} "


def _held_parts(way: DirectionSnapshot) -> list[Part]:
    return [("       ", "")] if way.held is None else [(" HELD ", "hold"), (" ", "")]


def _ends(talk: ConversationSnapshot, is_roomy: bool) -> list[Part]:
    ends = f"{talk.partner} → {talk.plc}" if is_roomy else talk.partner
    parts: list[Part] = [(f" {talk.state} ", STATE_STYLES.get(talk.state, "")), (f"{clip(ends, 48)} ", "dim")]
    if talk.handshake_ns is not None and is_roomy and talk.to_plc.round_trip_ns is None:
        parts.append((f"round trip {format_ns(talk.handshake_ns)} ", "dim"))
    return parts


def _figures(way: DirectionSnapshot, is_roomy: bool) -> list[Part]:
    if way.round_trip_ns is None or way.window is None:
        return []
    window = f"window {way.window} " if is_roomy and way.window else ""
    return [(f" {'round trip' if is_roomy else 'rtt'} {format_ns(way.round_trip_ns)} {window}", "dim")]


def _spark(talk: ConversationSnapshot) -> list[Part]:
    shown = talk.seconds[-SPARK_SECONDS:]
    most = max(shown, default=0)
    bars = "".join(SPARK_BLOCKS[-(-size * (len(SPARK_BLOCKS) - 1) // most) if most else 0] for size in shown)
    return [(f" {bars} ", "key")]


def _remarks(way: DirectionSnapshot) -> list[Part]:
    remarks = (
        (way.held, f" {way.held} B held", "warn"),
        (way.is_closed, " window 0", "error"),
        (way.again, f" {way.again} B sent again", "warn"),
        (way.missing, f" {way.missing} B missing", "warn"),
    )
    return [(text, style) for is_so, text, style in remarks if is_so]
