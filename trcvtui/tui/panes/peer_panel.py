"""Pane 7: the peer's state, the message to send, the faults that the peer can cause, and the commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Final

from textual.binding import Binding
from textual.containers import Vertical
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.snapshots.bench import PeerSnapshot, SentMessage, TrafficCheckSnapshot, TrafficCheckTally
from trcvtui.tui.formatting import clip, measure, pad, plain
from trcvtui.tui.messages import PeerSelected, ScreenCallbacks
from trcvtui.tui.panes.combuffer import SerialLineList
from trcvtui.tui.panes.composer import Composer
from trcvtui.tui.panes.conversation_list import ConversationList
from trcvtui.tui.peer_commands import (
    CHECK_BUTTON,
    EVERY_SPLIT_LETTER,
    FAULT_BUTTON,
    NO_PEER,
    SEND,
    UDT,
    Button,
    buttons_for,
    receiver_for,
)
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import ResultScreen, text_rows
from trcvtui.tui.widgets.line_view import LineView, Part, Row, TextView, pane_title, row
from trcvtui.tui.widgets.lines import ButtonLine
from trcvtui.wording import count

ROOMY = 110
STATE_STYLES = {"connected": "on", "reset": "warn", "refused": "warn"}


class PeerList(LineView):
    """The list of peers; the composer and the buttons act on the peer under the cursor."""

    KEYS: ClassVar = (
        ("s", "send"), ("i", "edit"), ("m", "mode"), ("x", "cuts"), ("e", "every split"), ("o", "form"),
        ("w", "keep"), ("p", "library"), ("E", "change"),
    )  # fmt: skip
    BINDINGS: ClassVar = [Binding("tab", "edit", "edit the payload", show=False)]
    DEFAULT_CSS = "PeerList { height: auto; max-height: 3; min-height: 1; }"

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="peers")
        self._view_model = view_model

    def keys(self) -> tuple[tuple[str, str], ...]:
        peer = self._view_model.peer_snapshot
        if not self._view_model.project.peers:
            return (("A", "add"),)
        return (("c", "connect" if peer is None or peer.active else "listen"), *self.KEYS)

    def row_count(self) -> int:
        return max(1, len(self._view_model.project.peers))

    def row_at(self, y: int) -> Row:
        peers = self._view_model.peers
        if not self._view_model.project.peers:
            return row((NO_PEER, "dim"))
        if y >= len(peers):
            return row((f"  {self._view_model.project.peers[y].name}", "dim"))
        return self._row(peers[y])

    def _row(self, peer: PeerSnapshot) -> Row:
        selected = peer.name == self._view_model.peer
        style = self.cursor_style(selected)
        width = min(12, max(measure(each.name) for each in self._view_model.peers))
        parts: list[Part] = [
            ("▸ " if selected else "  ", "key"),
            (pad(clip(peer.name, 12), width) + " ", "strong"),
            (f"{'UDP' if peer.udp else 'active' if peer.active else 'passive':<8}", "dim"),
            (f"{peer.state:<10} ", STATE_STYLES.get(peer.state, "")),
            (self._ends(peer), "dim"),
            *self._counters(peer),
        ]
        if peer.check is not None:
            text, judged = traffic_check_part(peer.check)
            parts.append((f"  {text}", judged))
        if peer.stalled:
            parts += [(" ", ""), (" STALLED ", "hold")]
        if peer.silent:
            parts += [(" ", ""), (" SILENT ", "stop")]
        return row(*parts, style=style)

    def _ends(self, peer: PeerSnapshot) -> str:
        roomy = self._is_roomy()
        width = max((measure(_ends(each, roomy)) for each in self._view_model.peers), default=0)
        return pad(_ends(peer, roomy), width) + "  "

    def _is_roomy(self) -> bool:
        return self.line_width >= ROOMY

    def _counters(self, peer: PeerSnapshot) -> list[Part]:
        if not self._is_roomy() or peer.check is not None:
            return [(f"sent {peer.bytes_sent}, got {peer.bytes_received} B", "")]
        parts: list[Part] = [
            (f"sent {count(peer.messages_sent, 'message')}, {peer.bytes_sent} B", ""),
            (f"  received {peer.bytes_received} B", ""),
        ]
        if peer.pending:
            parts.append((f"  {peer.pending} B on their way", "warn"))
        return parts

    def action_edit(self) -> None:
        """Focus the field of the payload at once, although the field of the mode comes first."""
        field = self.screen.query("#payload")
        self.screen.set_focus(field.first()) if field else self.screen.focus_next()

    def action_move(self, rows: int) -> None:
        names = [peer.name for peer in self._view_model.peers]
        if self._view_model.peer in names:
            self._choose(max(0, min(len(names) - 1, names.index(self._view_model.peer) + rows)))

    def click(self, x: int, y: int) -> None:
        if y < len(self._view_model.peers):
            self._choose(y)

    def _choose(self, y: int) -> None:
        self._view_model.peer = self._view_model.peers[y].name
        self.post_message(PeerSelected())
        self.keep_in_view(y)
        self.show()


def _ends(peer: PeerSnapshot, roomy: bool) -> str:
    if peer.state != "connected":
        return f"→ {peer.remote}" if peer.active else f"at {peer.local}"
    local = f"{peer.local} " if roomy else ""
    return f"{local}→ {peer.remote}" if peer.active else f"{local}← {peer.remote}"


def traffic_check_part(check: TrafficCheckSnapshot) -> Part:
    tallies = [("DATA", check.data)] if check.data is not None else []
    tallies += [("echo", check.echo)] if check.echo.frames or check.echo.shifts or not tallies else []
    is_good = all(tally.is_good for _, tally in tallies)
    text = ", ".join(f"{name} {_tally(tally)}" for name, tally in tallies)
    return f"{'✓' if is_good else '✗'} check {check.sent}: {text}", "done" if is_good else "error"


def _tally(tally: TrafficCheckTally) -> str:
    wrong = (("lost", tally.lost), ("double", tally.doubled), ("shift", tally.shifts))
    return " ".join([str(tally.frames), *(f"{word} {number}" for word, number in wrong if number)])


def _sent_row(sent: SentMessage) -> Row:
    """Return the row of a sent message, whether a key, a command, `every` or a rule sent the message."""
    shown = f"{sent.begin.hex(' ').upper()}{' …' if sent.size > len(sent.begin) else ''}"
    return row((f"sent {sent.number} ", "label"), (f"{sent.size:>6} B  ", "dim"), (shown, ""))


NO_RULES = "no reply rules; a: add one, such as on contains hex 05 send hex 06 {n}"


class PeerDetails(TextView, can_focus=False):
    """The peer's check, trial, rules and sent messages, one in each row, below the buttons."""

    DEFAULT_CSS = "PeerDetails { height: 1fr; }"

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="peer-notes")
        self._view_model = view_model

    def make_rows(self) -> list[Row]:
        peer = self._view_model.peer_snapshot
        if peer is None:
            return []
        check = [row(traffic_check_part(peer.check))] if peer.check is not None else []
        replies, sent = self._replies(peer), [*map(_sent_row, peer.last_sent)]
        return [*check, *self._trial(peer), *([*replies, *sent] if peer.replies else [*sent, *replies])]

    def _trial(self, peer: PeerSnapshot) -> list[Row]:
        trial = self._view_model.picture.trial if self._view_model.picture else None
        if trial is None or trial.peer != peer.name:
            return []
        style = "warn" if trial.differing or trial.problem else "done"
        return [row(("every split: ", "label"), (clip(trial.summary(), self.line_width - 15), style))]

    def _replies(self, peer: PeerSnapshot) -> list[Row]:
        if not peer.replies:
            return [row((NO_RULES, "faint"))]
        rows = []
        for number, reply in enumerate(peer.replies, 1):
            missed = f" missed {reply.missed}" if reply.missed else ""
            head, hits = f"reply {number} ", f"{reply.hits:>6}×{missed}  "
            text = clip(reply.rule, self.line_width - len(head) - len(hits))
            rows.append(row((head, "label"), (hits, "on" if reply.hits else "dim"), (text, "")))
        return rows


WAITING_FOR_ENGINE: Final = "waiting for the engine"
SCANS_HELD: Final = "‖ the scans are held, so nothing is tried: close this, then space resumes them"
BUTTON_LETTERS = "scfrhzuleadb"


class PeerPanel(Vertical):
    """The list, composer, buttons and notes; the lower border shows the command to send."""

    DEFAULT_CSS = "PeerPanel { background: $surface; border-subtitle-align: left; }"
    BINDINGS: ClassVar = [
        *[(letter, f"button('{letter}')", "") for letter in BUTTON_LETTERS],
        ("m", "mode", "payload as hex, text or udt"),
        ("o", "form", "a UDT as a form, its members as fields"),
        ("x", "cuts", "cut points of the message"),
        ("p", "library", "named messages and sequences of the project"),
        ("w", "keep", "save the message in the library under a name"),
        ("i", "payload", "edit the payload"),
        Binding("A", "app.add('peer')", "add a peer", show=False),
    ]

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks) -> None:
        super().__init__(id="peer")
        self._view_model = view_model
        self._actions = actions
        self._title = ""
        self.lines = SerialLineList(view_model, actions)
        self.peers = PeerList(view_model)
        self.talks = ConversationList(view_model, actions)
        self.composer = Composer(view_model, actions)
        self._buttons = ButtonLine(
            "buttons", self._labels, lambda index: self._press_button(self._buttons_now()[index])
        )
        self._notes = PeerDetails(view_model)
        self._preview = "", ""
        self._trial: ResultScreen | None = None
        self._trial_line = ""  # the command that started it
        self._has_composer = bool(view_model.project.peers)

    def compose(self) -> Iterator[Widget]:
        yield from (self.lines, self.peers, self.talks)
        if self._has_composer:
            yield from (self.composer, self._buttons, self._notes)

    async def mount_fields(self) -> None:
        if self._has_composer:
            await self.composer.mount_fields()

    async def _mount_composer(self) -> None:
        await self.mount(self.composer, self._buttons, self._notes)
        await self.mount_fields()

    @property
    def focus_target(self) -> LineView:
        """Return the list to focus: the conversations, else the peers, else the serial lines."""
        if self._view_model.conversations or (self._view_model.shadows and self._view_model.project.taps):
            return self.talks
        return self.lines if self.lines.names and not self._view_model.project.peers else self.peers

    def show(self) -> None:
        name = self._view_model.peer if self._view_model.peer or not self.lines.names else self.lines.choice
        kind = "Peer" if self.focus_target is self.peers else "Line"
        title = self.talks.title if self.focus_target is self.talks else f"{kind} {clip(name, 20)}".rstrip()
        if title != self._title or not self.border_title:
            self._title = title
            self.border_title = pane_title(7, title)
        self.talks.display = self.focus_target is self.talks
        self.talks.show()
        self.lines.display, self.peers.display = bool(self.lines.names), self.focus_target is self.peers
        self.lines.show()
        self.peers.show()
        focused = self.screen.focused if self.is_attached else None  # a picture may come before the panes
        if focused in (self.lines, self.peers, self.talks) and not focused.display:
            self.screen.set_focus(self.focus_target)  # at once: the next key is for what is shown now
        if self._view_model.project.peers and not self._has_composer:
            self._has_composer = True
            self.run_worker(self._mount_composer())
        if self._view_model.project.peers and self._notes.is_mounted:
            self._buttons.show()
            self._notes.draw()
            self._show_preview()
        self.show_trial()

    def show_trial(self) -> None:
        """Update the open table of a trial; close it if the engine has refused the trial."""
        if self._trial is not None:
            answers = self._view_model.answers.values()
            if any(answer.error and answer.line == self._trial_line for answer in answers):
                trial, self._trial = self._trial, None
                trial.dismiss(None)  # the prompt says why
            else:
                self._trial.show()

    def _show_preview(self) -> None:
        button, peer = self._pointed_button(), self._view_model.peer_snapshot
        send = button is None or button.letter == SEND
        if peer is None:
            self._preview = "", ""
        elif send and self.composer.fault:  # enter would be refused: say why before
            self._preview = "✗ ", self.composer.fault
        elif send or button is None:
            self._preview = "▸ ", self.composer.line or f"peer {peer.name} send …"
        elif button.letter == EVERY_SPLIT_LETTER:
            self._preview = "▸ ", self._make_try_line(peer) or f"{button.line(peer)} …"
        else:
            self._preview = "▸ ", button.line(peer)
        sign, text = self._preview
        text = sign + _clip_middle(plain(text), max(16, self.size.width - 6))
        self.border_subtitle = Content.assemble((text, "$error" if sign == "✗ " else "$text-muted"))

    def _buttons_now(self) -> tuple[Button, ...]:
        snapshot = self._view_model.snapshot
        return buttons_for(bool(snapshot and snapshot.faults), self._view_model.peer_snapshot)

    def _pointed_button(self) -> Button | None:
        index = self._buttons.pointed_index()
        return None if index is None else self._buttons_now()[index]

    def _labels(self) -> list[tuple[str, str]]:
        peer = self._view_model.peer_snapshot
        if peer is None:
            return []
        return [(button.letter, button.label(peer)) for button in self._buttons_now()]

    def _press_button(self, button: Button) -> None:
        peer = self._view_model.peer_snapshot
        if peer is None:
            return
        if button.letter == SEND:
            self.composer.send()
        elif button.letter == EVERY_SPLIT_LETTER:
            self._try_splits(peer)
        elif button.edit:
            self._actions.open_prompt(button.line(peer) + self._command_target(button, peer))
        else:
            self._actions.submit(button.line(peer))

    def _command_target(self, button: Button, peer: PeerSnapshot) -> str:
        if button is CHECK_BUTTON:
            instance = receiver_for(peer.link, self._view_model.selected, self._view_model.project)
            return f" on {instance}" if instance else ""
        connection = self._view_model.connection
        return connection.name if connection is not None and button is FAULT_BUTTON else ""

    def _make_try_line(self, peer: PeerSnapshot) -> str:
        instance = receiver_for(peer.link, self._view_model.selected, self._view_model.project)
        return self.composer.make_try_line(instance) if instance else ""

    def _try_splits(self, peer: PeerSnapshot) -> None:
        trial = self._view_model.picture.trial if self._view_model.picture else None
        line = self._make_try_line(peer)
        if line and (trial is None or trial.state != "running"):
            self._actions.submit(line)
        elif not line and trial is None:
            self._show_what_is_missing(peer)
            return
        self.open_trial_table(line)

    def _show_what_is_missing(self, peer: PeerSnapshot) -> None:
        if self.composer.text.strip():
            self._actions.complain(f"no TRCV_C or TRCV on the CONNECT that {peer.name} talks to")
        else:
            self.composer.ask_for_payload("split")

    def open_trial_table(self, line: str = "") -> None:
        self._trial_line = line
        self._trial = ResultScreen("trial", "Every split", "y copy · esc close", self._trial_rows)
        self.app.push_screen(self._trial, self._handle_trial_closed)

    def _trial_rows(self, width: int) -> list[Row]:
        from trcvtui.bench.split_test import trial_text  # imported on first use

        picture = self._view_model.picture
        trial = picture.trial if picture is not None else None
        if trial is None:
            return [row((WAITING_FOR_ENGINE, "dim"))]
        held = trial.state == "running" and picture is not None and picture.holding
        return [*([row((SCANS_HELD, "hold"))] if held else []), *text_rows(trial_text(trial), width)]

    def _handle_trial_closed(self, nothing: None) -> None:
        self._trial = None

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self._show_preview()

    def on_button_pointed(self) -> None:
        self._show_preview()

    def complain_if_no_peer(self) -> bool:
        """Return whether the project has no peer; if so, show how to add one."""
        if not self._view_model.project.peers:
            self._actions.complain(NO_PEER)
        return not self._view_model.project.peers

    def action_button(self, letter: str) -> None:
        if self.complain_if_no_peer():
            return
        button = next((b for b in self._buttons_now() if b.letter == letter), None)
        if button is not None:
            self._press_button(button)
        else:
            self._actions.complain(f"{letter} does nothing: {self._view_model.peer} has no such button now")

    def action_mode(self) -> None:
        """Change to the next payload mode, and focus the payload."""
        if not self.complain_if_no_peer():
            self.composer.next_mode()
            self.composer.focus_payload()

    def action_cuts(self) -> None:
        if self.complain_if_no_peer():
            return
        if len(self.composer.split_row.payload) > 1:
            self.screen.set_focus(self.composer.split_row)
        elif self.composer.line:
            self._actions.complain(self.composer.fault or "a message of one byte cannot be cut")
        else:
            self.composer.ask_for_payload("cut")

    def action_library(self) -> None:
        from trcvtui.tui.forms.messages import LibraryScreen  # imported on first use

        if not self.complain_if_no_peer():
            shown = LibraryScreen(self._view_model.peer, self._view_model.project)
            self.app.push_screen(shown, self._submit_line)

    def _submit_line(self, line: str | None) -> None:
        if line:
            self._actions.submit(line)

    def action_keep(self) -> None:
        """Open the form that saves the message in the library; without a message, ask for a payload."""
        if self.complain_if_no_peer():
            return
        from trcvtui.tui.forms.add_screen import AddScreen  # imported on first use

        text = self.composer.line.partition(" send ")[2]
        if text:
            form = AddScreen(lambda: self._view_model.project, "message", {"text": text})
            self.app.push_screen(form, self._submit_line)
        else:
            self.composer.ask_for_payload("keep")

    def action_form(self) -> None:
        if self.complain_if_no_peer():
            return
        from trcvtui.tui.forms.messages import make_udt_form  # imported on first use

        found = make_udt_form(self.composer.text, self.composer.mode, self._view_model)
        if found is not None:
            self.app.push_screen(found, self._handle_form_result)
        else:
            self._actions.complain("no UDT to fill in: DATA of the selected instance has none")

    def _handle_form_result(self, payload: str | None) -> None:
        if payload:
            self.composer.set_payload(UDT, payload)
            self._show_preview()

    def action_payload(self) -> None:
        if not self.complain_if_no_peer():
            self.composer.focus_payload()


def _clip_middle(text: str, width: int) -> str:
    tail = width // 2
    return text if len(text) <= width else f"{clip(text, width - tail)}{text[-tail:]}"
