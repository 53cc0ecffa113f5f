"""The command palette: every action by name."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Iterator
from functools import partial
from inspect import isawaitable
from pathlib import Path
from typing import Final, NamedTuple

from textual.actions import parse
from textual.app import SystemCommand
from textual.binding import Binding
from textual.command import DiscoveryHit, Hit, Hits
from textual.content import Content
from textual.dom import DOMNode
from textual.keys import format_key
from textual.markup import escape
from textual.system_commands import SystemCommandsProvider
from textual.widget import Widget

from trcvtui.errors import UserError
from trcvtui.paths import demo_path
from trcvtui.plc.snapshot import block_row
from trcvtui.tui.forms.fields import KIND_TITLES
from trcvtui.tui.main import MainScreen
from trcvtui.tui.messages import PeerSelected
from trcvtui.tui.peer_commands import BUTTONS, SEND, buttons_for
from trcvtui.tui.recent_projects import make_run_line, recent_projects
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.help import PIN_LETTERS

PANE_NAMES: Final = {
    1: "Instances", 2: "Block", 3: "STATUS", 4: "History", 5: "Received", 6: "Members", 7: "Peer",
    8: "Timing",
}  # fmt: skip
FIRST: Final = (
    "Save the project", "Save the session as a scenario", "Doctor", "Yank …", "Freeze the view",
    "View live again", "Trigger", "Scenarios", "UDT lab", "History: the ERROR before", "Help",
)  # fmt: skip
CURSOR_ACTIONS: Final = frozenset(("move", "page", "edge", "step", "place"))  # not listed in the palette
WORD_SCORE: Final = 3.0  # the score of each letter, as in a title that has them side by side
PEER_PANE, WRITE_ACTION = 7, "write"  # keys of this pane and this action write: other panes never press them
BUTTON_ACTION: Final = "button"  # `_offer_peer` lists the buttons with their bench commands


class PaneKey(NamedTuple):
    digit: int
    widget: Widget
    binding: Binding

    @property
    def action(self) -> str:
        return parse(self.binding.action)[1]

    @property
    def key(self) -> str:
        return format_key(self.binding.key).replace("left", "←").replace("right", "→")


def pane_keys(main: MainScreen) -> Iterator[PaneKey]:
    for digit, widget in _list_widgets(main):
        for binding in own_bindings(type(widget)):
            key = PaneKey(digit, widget, binding)
            if key.action not in CURSOR_ACTIONS:
                yield key


def _list_widgets(main: MainScreen) -> Iterator[tuple[int, Widget]]:
    yield from ((1, main.instances), (2, main.block), (3, main.status), (4, main.history))
    yield from ((5, main.received), (5, main.received.data), (5, main.received.stream), (6, main.table))
    if main.peer.lines.names:
        yield 7, main.peer.lines
    if main.peer.composer.is_mounted:
        yield from ((7, main.peer), (7, main.peer.peers), (7, main.peer.composer.split_row))
    yield 8, main.timing


def own_bindings(kind: type[DOMNode]) -> Iterator[Binding]:
    for declared in vars(kind).get("BINDINGS", ()):
        yield next(iter(Binding.make_bindings([declared])))


def commands_of_keys(main: MainScreen) -> Iterator[SystemCommand]:
    for key in pane_keys(main):
        if key.action != BUTTON_ACTION:
            title = f"{PANE_NAMES[key.digit]}: {key.binding.description}"
            yield SystemCommand(title, f"pane {key.digit}, key {key.key}", partial(_press_key, main, key))


async def _press_key(main: MainScreen, key: PaneKey) -> None:
    main.action_pane(key.digit)
    if key.widget.can_focus:
        main.set_focus(key.widget)
    whose, name, parameters = parse(key.binding.action)
    target = {"screen": main, "app": main.app}.get(whose, key.widget)
    act: Callable[..., Awaitable[object] | object] = getattr(target, f"action_{name}")
    if isawaitable(done := act(*parameters)):
        await done


async def press_other_pane_key(main: MainScreen, key: str, missing: str = "") -> None:
    """Press a key that only one other pane has, unless pane or key writes; else say where the key works."""
    found = [each for each in pane_keys(main) if each.binding.key == key]
    is_pin = key in PIN_LETTERS.values()
    if len(found) == 1 and found[0].digit != PEER_PANE and found[0].action != WRITE_ACTION:
        await _press_key(main, found[0])
        return
    digits = [str(digit) for digit in sorted({each.digit for each in found})]
    is_of_peer = digits == [str(PEER_PANE)] or (not found and any(button.letter == key for button in BUTTONS))
    if is_of_peer and not is_pin and main.peer.complain_if_no_peer():  # which has shown the error
        return
    if digits:
        pane = f"pane {digits[0]}" if len(digits) == 1 else f"panes {', '.join(digits[:-1])} and {digits[-1]}"
        way = f"{found[0].key} is a key of {pane}: press {' or '.join(digits)}, then {found[0].key}"
        missing = f"{missing}; {way}" if missing and is_pin else way
    if missing:
        main.prompt.show_error(missing)


class PaletteContext(NamedTuple):
    view_model: ViewModel
    main: MainScreen
    submit: Callable[[str], None]
    add: Callable[[str], None]
    lab: Callable[[], None]


# Words that also find an action whose title or explanation contains one of the texts on the right.
SEARCH_SYNONYMS: Final = {
    "search look": ("find", "some words", "a code", "filter"),
    "copy clipboard export": ("yank", "clipboard", "screenshot"),
    "export file": ("vcd", "csv", "save", "screenshot"),
    "open load show": ("pane ", "scenarios", "lab", "recent", "form", "doctor", "advice", "stream", "table"),
    "value number field": ("write", "member", "pin", "payload", "form", "resize", "curve"),
    "graph chart plot": ("curve", "timing"),
    "type structure struct layout": ("member", "udt", "theirs", "data variable", "resize"),
    "record log": ("recording", "record", "save the session"),
    "stop pause": ("hold", "freeze", "stop", "record", "trigger off", "stall", "quit"),
    "start continue resume": ("continue", "plc run", "live", "record the run"),
    "new create insert": ("add ", "create"),
    "delete": ("remove",),
    "edit modify settings": ("change", "set ", "theme"),
    "disconnect close": ("fin", "rst", "silence", "undo"),
    "message frame telegram": ("send", "payload", "split", "cut", "reply"),
    "diagnose explain why error": ("doctor", "help", "framing", "error"),
    "colour": ("theme",),
    "exit end leave": ("quit", "back to now"),
    "maximize full": ("zoom",),
}


def make_search_words(title: str, about: str) -> set[str]:
    text = f"{title} {about}".casefold()
    also = [words for words, those in SEARCH_SYNONYMS.items() if any(each in text for each in those)]
    return set(re.findall(r"\w+", " ".join([text, *also])))


class OrderedCommands(SystemCommandsProvider):
    """Commands in the order of the app; Textual's own provider sorts by the alphabet.

    You find a command by letters of its title, or by the beginnings of its search words.
    """

    async def discover(self) -> Hits:
        for title, about, callback, _ in self.app.get_system_commands(self.screen):
            yield DiscoveryHit(Content(title), callback, title, escape(about))

    async def search(self, query: str) -> Hits:
        matcher, typed = self.matcher(query), re.findall(r"\w+", query.casefold())
        for title, about, callback, _ in self.app.get_system_commands(self.screen):
            words, score = make_search_words(title, about), matcher.match(title)
            if all(any(word.startswith(each) for word in words) for each in typed):
                score = max(score, WORD_SCORE * len(query))
            if score > 0:
                yield Hit(score, matcher.highlight(escape(title)), callback, title, escape(about))


def list_commands(bench: PaletteContext) -> list[SystemCommand]:
    """Return the commands that make sense now, the most useful first."""
    return sorted(_all(bench), key=lambda one: FIRST.index(one.title) if one.title in FIRST else len(FIRST))


def _all(bench: PaletteContext) -> Iterator[SystemCommand]:
    for part in (_offer_scans, _offer_block, _offer_program, _offer_peer, _offer_instances, _offer_screen):
        yield from part(bench)
    yield from commands_of_keys(bench.main)
    yield from _yank_commands(bench)
    yield from _recent_project_commands(bench.main)


def _offer_scans(bench: PaletteContext) -> Iterator[SystemCommand]:
    for title, key, line in (
        ("Hold the scans", "space", "hold"),
        ("Continue the scans", "space", "go"),
        ("Trigger off", "", "trigger off"),
        ("PLC to STOP", "", "plc stop"),
        ("PLC to RUN", "", "plc run"),
        ("Clear all faults", "", "fault clear"),
    ):
        about = f"{line} · key {key}" if key else line
        yield SystemCommand(title, about, partial(bench.submit, line))
    yield SystemCommand("One single scan", "run 1 · key .", bench.main.action_single_scan)
    frozen = bench.view_model.is_frozen
    about = "the PLC keeps running, the screen stays as it is · key F"
    yield SystemCommand("View live again" if frozen else "Freeze the view", about, bench.main.action_freeze)
    about = "run to a STATUS, a pin or a value; the view freezes there · key T"
    yield SystemCommand("Trigger", about, bench.main.action_trigger)
    yield SystemCommand("Mark", "mark: a saved session checks from here on · key K", bench.main.action_mark)
    save = "save scenario session.toml"
    yield SystemCommand("Save the session as a scenario", save, partial(bench.main.action_prompt, save))
    keep = "save recording session.pcapng"
    yield SystemCommand("Save the recording up to now", keep, partial(bench.main.action_prompt, keep))


def _offer_block(bench: PaletteContext) -> Iterator[SystemCommand]:
    name = bench.view_model.selected
    for pin in bench.main.block.drawing().inputs:
        title = f"{'Pulse' if pin.edge else 'Toggle' if pin.is_bool else 'Write'} {pin.name}"
        about = f"{name}: {pin.text}" + (f" · key {pin.letter}" if pin.letter else "")
        yield SystemCommand(title, about, partial(bench.main.block.press, pin.letter))


def _offer_program(bench: PaletteContext) -> Iterator[SystemCommand]:
    for kind, what in KIND_TITLES.items():
        about = f"add {kind} …: a form" + (" · key A" if kind == "instance" else "")
        yield SystemCommand(f"Add {what}", about, partial(bench.add, kind))
    from trcvtui.tui.forms.fields import list_parts

    about = "change a part of the project in a form, or `remove` it · key E"
    yield SystemCommand("Change or remove …", about, bench.main.action_change)
    for part in list_parts(bench.view_model, peer_first=False):
        named = f"{part.kind} {part.name}"
        change = partial(bench.main.change_part, part)
        yield SystemCommand(f"Change {part!s}", f"set {named} …: a form", change)
        yield SystemCommand(f"Remove {part!s}", f"remove {named}", partial(bench.main.remove_part, part))
    about = "undo: take back the last add, set or remove · key ctrl+z"
    yield SystemCommand("Undo", about, bench.main.action_undo)
    about = "save project: all edits go into its file · key ctrl+s"
    is_demo = bench.view_model.project.path == demo_path()  # never overwritten: it needs another name
    keep = partial(bench.main.action_prompt, "save project ") if is_demo else bench.main.action_save
    yield SystemCommand("Save the project", about, keep)
    instance = bench.view_model.instance
    if instance is None:
        return
    name = instance.name
    link = block_row(instance.block).buffer_pin or ("config" if instance.on_config else "connect")
    create = f"create {instance.block} {name}_2 {link}={instance.connect}"
    create += f" data={instance.data}" if instance.data else ""
    lines = [
        (f"Delete {name}", f"delete {name}"),
        (f"Download {name}: a new instance", f"download {name}"),
        ("Create an instance", create),
    ]
    if instance.data:
        lines.append((f"Resize {instance.data}", f"resize {instance.data} "))
    for title, line in lines:
        yield SystemCommand(title, line, partial(bench.main.action_prompt, line))


def _offer_peer(bench: PaletteContext) -> Iterator[SystemCommand]:
    peer = bench.view_model.peer_snapshot
    if peer is None:
        return
    for button in buttons_for(bool(bench.view_model.snapshot and bench.view_model.snapshot.faults), peer):
        line = bench.main.peer.composer.line or "the payload" if button.letter == SEND else button.line(peer)
        press = partial(bench.main.peer.action_button, button.letter)
        about = f"{line} · pane 7, key {button.letter}"
        yield SystemCommand(f"Peer {peer.name}: {button.label(peer)}", about, press)
    for other in bench.view_model.peers:
        if other.name != peer.name:
            speak = partial(_select_peer, bench, other.name)
            yield SystemCommand(f"Peer {other.name}", "select this peer", speak)


def _offer_instances(bench: PaletteContext) -> Iterator[SystemCommand]:
    for instance in bench.view_model.instances:
        if instance.name != bench.view_model.selected:
            about = f"select this instance of {instance.block}"
            yield SystemCommand(f"Instance {instance.name}", about, partial(_select, bench, instance.name))


def _offer_screen(bench: PaletteContext) -> Iterator[SystemCommand]:
    for digit, name in PANE_NAMES.items():
        yield SystemCommand(f"Pane {name}", f"go there · key {digit}", partial(bench.main.action_pane, digit))
    main = bench.main
    for title, about, act in (
        ("Members of DATA or of the job", "decode one or the other · key v", main.action_members),
        ("View DATA as theirs", "in the layout that fits the bytes, and back · key V", main.action_theirs),
        ("Zoom the pane", "alone on the screen, and back · key M", main.action_zoom),
        ("Command line", "type a bench command · key :", main.action_prompt),
        ("Scenarios", "read them, play them step by step · key S", main.action_scenarios),
        ("UDT lab", "compare two layouts, see which one fits, get the cure · key L", bench.lab),
    ):
        yield SystemCommand(title, about, act)
    for title, about, action in (
        ("Framing advice", "how to cut the bytes of a ComBuffer into frames · key B", "app.framings"),
        ("Doctor", "what is wrong with the selected instance, and what mends it · key J", "app.doctor"),
        ("Thrown-away bytes", "noise, parts of frames, lost ones · key X", "app.dropped"),
    ):
        yield SystemCommand(title, about, partial(bench.main.run_action, action))
    yield SystemCommand("Help", "keys, and the STATUS table of the dialect · key ?", bench.main.action_help)


def _yank_commands(bench: PaletteContext) -> Iterator[SystemCommand]:
    from trcvtui.tui.copy_formats import FORMATS

    yield SystemCommand("Yank …", "a menu of all formats · key y", bench.main.action_yank)
    for form in FORMATS:
        about = f"to the clipboard and a file · keys y {form.letter}"
        yield SystemCommand(f"Yank {form.name}", about, partial(bench.main.yank, form.letter))


def _recent_project_commands(main: MainScreen) -> Iterator[SystemCommand]:
    try:
        for path in () if getattr(main.app, "only_looks", False) else recent_projects():
            line = make_run_line(path)
            yield SystemCommand(f"Recent projects: {Path(path).name}", line, partial(main.yank_line, line))
    except UserError as wrong:
        [line] = wrong.lines()
        yield SystemCommand("Recent projects", line, partial(main.prompt.show_error, line))


def _select(bench: PaletteContext, name: str) -> None:
    bench.view_model.selected = name
    bench.main.reset_for_selected()


def _select_peer(bench: PaletteContext, name: str) -> None:
    bench.view_model.peer = name
    bench.main.post_message(PeerSelected())
