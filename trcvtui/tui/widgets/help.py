"""Help: the keys, the bench commands, and the whole STATUS table of the dialect in use."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import ClassVar, Final

from textual.app import App
from textual.binding import Binding
from textual.widget import Widget

from trcvtui.tui.formatting import wrap_text
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import ResultScreen
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row

# Mnemonic letters of the pins; a pin without one takes the first letter of its name that is free.
PIN_LETTERS: Final = {"EN_R": "n", "CONT": "t", "ADHOC": "a", "COM_RST": "x", "LEN": "l", "REQ": "r"}
RESERVED: Final = frozenset("hjkqgbpvy")  # keys of panes and screens, never of a pin

GLOBAL_KEYS: Final = (
    ("1 … 8", "go to a pane; on a small screen its tab opens"),
    ("tab, shift+tab", "next, previous pane or field; in a form also ↑ ↓, unless a field has a list"),
    ("M or \\", "show the pane alone on the screen, or all panes again"),
    ("space", "hold the scans, or resume them (the network keeps running)"),
    (".", "run one scan while the scans are held"),
    ("F", "freeze the view while the PLC runs, or show it live again; keys still act"),
    ("T", "arm a trigger: X STATUS=80C5 · X EN_R rises · rx.speed > 100 hold · off"),
    ("S or F2", "scenarios: read them, play them step by step"),
    ("L", "UDT lab: compare two profiles, see which fits the bytes, get the cure"),
    ("B", "framing advice: ways to cut the bytes of a ComBuffer into frames, with evidence"),
    ("X", "show the bytes that were thrown away; press again for those before"),
    ("J", "doctor: what is wrong with the selected instance, where to see it, how to mend it"),
    (":", "type a bench command; up and down go through the earlier ones"),
    ("ctrl+p", "command palette: find commands by name, or by words such as copy, graph, recent projects"),
    ("y", "yank what the pane shows: hex, 16#.., members, history; y y: the first form"),
    ("K", "set a mark: a saved scenario expects what comes after it"),
    ("A", "add an instance (with CONNECT and DATA), connection, DATA, UDT file or peer, and select it"),
    ("E", "change or remove a part: CONNECT or DATA of the selected instance, a peer, any other"),
    ("ctrl+z", "undo the newest add, change or remove"),
    ("ctrl+s", "`save project`: write all additions, changes and removals to the project file"),
    ("P", "save a picture of the screen as SVG; the prompt shows where"),
    ("ctrl+c", "copy the text selected with the mouse; press F first if the text changes"),
    ("? or F1", "this help"),
    ("other keys", "a key that only one pane has works everywhere; if it changes something, only there"),
    ("esc", "leave a field, close the prompt, or return from the past to now"),
    ("R", "start or end a recording; restart an engine that has ended"),
    ("q or ctrl+q", "quit"),
)
MOVES: Final = ("↑ ↓ j k, g G", "move in a list, like page up, down; g, home: first row; G, end: last row")
LETTERS: Final = (  # of panes 1 to 3
    ("n t a x r", "n: EN_R, t: CONT, a: ADHOC, x: COM_RST, r: REQ of the selected instance"),
    ("l", "write LEN: the prompt opens with the command"),
    ("f u d c", "of ReceiveData: f: prefix, u: suffix (hex or text), d: DATA, c: bytes to feed its line"),
)
PINS: Final = (*LETTERS, ("a letter", "change the pin with this letter in pane 2; or click on the pin there"))
INSTANCE_KEYS: Final = (
    ("/", "list only instances with the typed words (name, block, code, address, `error`); esc: all"),
    ("!", "go to the next instance with an ERROR"),
)
BLOCK_KEYS: Final = (
    ("enter", "toggle the pin under the cursor"),
    ("C", "the connection description byte by byte; there y copies it as hex, s as SCL"),
    MOVES,
)
STATUS: Final = ("enter", "type the command of `do`, unless it needs a trial first (J); or click on `do`")
HISTORY_KEYS: Final = (
    ("↑ ↓", "choose an edge; STATUS explains it"),
    ("/", "find a code, as in `find 7004`"),
    ("n N", "n: older, N: newer edge with the code of /; without a code, or after esc: with an ERROR"),
    ("!", "go to the ERROR before"),
)
RECEIVED_KEYS: Final = (
    ("← → h l, ↑ ↓ j k", "move by a byte, by a row; g: first byte, G: last byte; page up and down"),
    ("H", "show all bytes received so far as one stream, with rulers; press again for DATA now"),
    ("D", "show the messages as a table, newest last, with filter and CSV; again: DATA now"),
    ("/", "find hex, text (quoted if also hex), =1.5 in either byte order, @offset, #job; esc unmarks"),
    ("n N", "n: next hit of /, N: hit before; before a search, or if you left the pane: like ] and ["),
    ("[ ]", "[: the DONE before, ]: the next DONE"),
    ("d u", "d: show what differs from the job before, or from the marked message; u: fewer rulers"),
    ("m", "mark the message at the cursor: d compares others with it, y r copies from there to the cursor"),
)
TABLE_KEYS: Final = (
    ("n N [ ]", "n or ]: the next message, N or [: the message before; end: follow the newest"),
    ("/", "filter as you type, as in weight > 3, STATUS=80C5, RCVD_LEN!=12; esc: all messages"),
    ("y", "copy the messages that pass the filter as CSV, to the clipboard and a file"),
)
MEMBER_KEYS: Final = (
    ("enter", "show the member over time as a curve"),
    ("v", "members of DATA, or of the bytes that the running job has collected so far"),
    ("V", "view DATA in the layout that fits the bytes (the sender's); press again for the PLC's own"),
)
CURVE_KEYS: Final = (
    ("enter", "in the members: open the curve (or click the small one behind a number); esc closes it"),
    ("+ -", "+: less time in view, -: more"),
    ("← →, home end", "back, forward in time; home: the first message; end: follow the newest again"),
    ("p", "second curve: next number of the type, with its own axis; after the last: none"),
)
TIMING_KEYS: Final = (
    ("← → h l, shift", "one scan back, one forward; with shift: to the edge before or after, of any pin"),
    ("n N", "n: next edge, N: edge before, of the chosen row"),
    ("! /", "!: next ERROR; /: next edge to a code, as in `find 7008`"),
    ("+ = -, wheel", "fewer scans a column, or more; a pulse stays visible"),
    ("m", "set the first or second marker: the title shows their distance in scans and ms"),
    ("f, esc", "f: follow the newest scan, or stay here; esc: back to the newest scan"),
    ("o", "show the other instances of this CONNECT, too"),
    ("e", "write a VCD file (GTKWave, PulseView)"),
)
PEER_COMMAND_KEYS: Final = (  # each sends its command, or opens the prompt with it
    ("c s f", "c: connect or listen; s: send the message; f: FIN (UDP: close)"),
    ("r h z", "r: RST; h: half-close (the peer still receives); z: stop reading, or read again"),
    ("l u", "l: silence the wire, without FIN or RST; u: let a kernel call fail, or clear such faults"),
    ("b", "self-checking traffic (number and CRC), on or off: counts lost, doubled, shifted frames"),
    ("e", "try every split of the message and show the results; y copies them"),
    ("a d", "a: add a reply rule; d: remove all reply rules"),
)
PEER_KEYS: Final = (
    *PEER_COMMAND_KEYS,
    ("i, m", "i: edit the payload; m: next mode (hex, text, udt), then edit; enter there sends it"),
    ("x, ← → space + -", "x: go to the bytes; ← →: choose a byte; space: cut there; + -: change the pause"),
    ("o w p", "o: a UDT as a form; w: save the message in the library with a name; p: pick one there"),
    ("← → enter", "← →: choose a button; enter: press it"),
    ("A", "add a peer"),
)
FEED_KEYS: Final = (
    ("enter i", "type bytes for the simulated line"),
    ("s → ← b", "s: feed the same again; →: the next byte; ←: back to the first byte; b: pull the cable"),
)
LINE_KEYS: Final = (
    ("↑ ↓", "choose a conversation and one of its directions"),
    ("h", "tap: hold this direction, or release it; the header shows for how long it is held"),
    ("e i d y s r f", "tap: put a command into the prompt for enter; with --armed, r and f act at once"),
    ("w", "mirror port: make shadows for a conversation that has none"),
    ("q", "tap: end it; with open connections it asks: c cuts them, d closes only the screen"),
)
SCENARIO_KEYS: Final = (
    ("↑ ↓, /", "↑ ↓: choose a scenario; /: filter the list as you type"),
    ("k", "simulated network or real sockets, for the next scenario that you load"),
    ("enter", "load the scenario: a new bench replaces the present one"),
    ("n or space", "run the next step; during a run: stop after the running step"),
    ("r", "run all remaining steps; on the simulated network at full speed"),
    ("5 6 7", "5: STATUS, 6: history, 7: timing of the scenario"),
    ("v", "show all panes of the bench, with the scenario; S goes back to its steps"),
    ("esc or q", "leave: your project starts again"),
)
LAB_KEYS: Final = (
    ("1 … 4", "go to 1: members, 2: bytes, 3: ranking of profiles, 4: cure (padded type or swap code)"),
    ("t b", "t: the type; b: the bytes (DATA, job, last job, a message, typed hex)"),
    ("o p", "o: the layout of our type, p: of the sender's; x: exchange the two"),
    ("E e, S s", "E: byte order of our type, e: of the sender's; S, s: STRING form of each"),
    ("space, ← →, z", "fold or open the branch under the cursor; z: all branches"),
    ("n N", "n: the next member that differs, N: the one before"),
    ("[ ]", "[: the message before, ]: the next message"),
    ("f, enter", "f: rank how well the profiles fit the bytes, with reasons; enter: take one as theirs"),
    ("c d", "c: the cure (type for our side, for the sender's, or swap code); d: in ST or SCL"),
    ("y", "yank (copy) what the pane shows to the clipboard, and always to a file"),
    ("O X", "O: open a type file; X: type or paste hex to look at"),
    ("C w", "C: constants that no file declares; w: problems in the type files"),
    ("R u", "R: give DATA its changed type (udt reload, then resize); u: use the shown type for DATA"),
    (":", "type a command: udt open, type, ours, theirs, swap, bytes, hex, fit, constant, reload"),
    ("esc or q", "back to the bench (the lab reads changed files again as long as it is open)"),
)
TIME_LINE_KEYS: Final = (
    ("← → or ,", "one scan back, one forward; with shift: one edge of the selected instance"),
    ("!", 'next ERROR (of any instance) or finding of the doctor; " or @: the one before'),
    ("g", "in each pane: go to a time or scan (at T#12m3s, at scan 1062); home, end: first, last scan"),
    ("space", "play, or stop; . goes one scan forward"),
    ("+ -", "play faster, slower: from 0.1x to as fast as possible"),
    ("T", "go to the next scan in which a trigger fires"),
    ("W", "what if (if instance.X.LEN=20, if dialect NAME, if off): both runs and their first difference"),
    ("9 or esc", "go to the time line; while a pane has the focus, its own keys act"),
)
KeyTable = tuple[tuple[str, str], ...]
# All keys by pane: a title, the ids of the widgets that can have the focus there, and the rows.
HELP_SECTIONS: Final[tuple[tuple[str, tuple[str, ...], KeyTable], ...]] = (
    ("Everywhere", (), GLOBAL_KEYS),
    ("Panes 1 to 3: pins", (), PINS),
    ("1 Instances", ("instances",), (*INSTANCE_KEYS, MOVES)),
    ("2 Block", ("block",), BLOCK_KEYS),
    ("3 STATUS", ("status",), (STATUS, MOVES)),
    ("4 History", ("history",), HISTORY_KEYS),
    ("5 Messages", ("messages",), TABLE_KEYS),
    ("5 Received", ("received",), RECEIVED_KEYS),
    ("6 Members", ("udt",), MEMBER_KEYS),
    ("Curve", (), CURVE_KEYS),
    ("7 Line", ("talks",), LINE_KEYS),
    ("7 Simulated line", ("lines",), FEED_KEYS),
    ("7 Peer", ("peer",), PEER_KEYS),
    ("8 Timing", ("timing",), TIMING_KEYS),
    ("Scenarios", ("scenarios", "text", "traces"), SCENARIO_KEYS),
    ("Lab", ("lab-tree", "lab-hex", "lab-fit", "lab-cure"), LAB_KEYS),
)


def letters_of(pins: Iterable[str], taken: Collection[str] = ()) -> dict[str, str]:
    """Return a different letter for each pin: a fixed one, else a free one of its name, or "" if none."""
    names = list(pins)
    given = {pin: PIN_LETTERS[pin] for pin in names if pin in PIN_LETTERS}
    for pin in names:
        free = (c for c in pin.lower() if c.isalpha() and c not in {*RESERVED, *taken, *given.values()})
        given.setdefault(pin, next(free, ""))
    return given


KEY_WIDTH: Final = 18
SIGNS: Final = (
    ("■ □ ◆", "a lamp: on; off; on for one scan a moment ago (which is named)"),
    ("⋄ _ • ×", "bytes: NUL, white space, control, 16#80 and up"),
    ("▕", "before a byte: a message of the peer begins here"),
    ("▁ ▔ █ ┃ ░", "over time: 0; 1; 1 for one scan; one or more pulses in the column; not known"),
    ("▁ █ ×", "▁ █: last 60 values of a number, ×: a message without it; below a curve: ▲ ERROR, × cut"),
    ("··", "a byte that the running job still waits for"),
    ("▸ ▶ • ✓ ✗", "a step of a scenario: next, running, done, held (passed), failed"),
)


def key_rows(title: str, table: KeyTable, width: int, names: Mapping[str, str]) -> list[Row]:
    """Return the rows of a table of keys. `names` are the new names of keys that the user has changed."""
    rows = [row((title, "strong"))]
    for shown, what in table:
        key = names.get(shown.split(" or ")[0], shown)
        first, *rest = wrap_text(what, width - KEY_WIDTH - 3)
        rows.append(row((f"  {key:<{KEY_WIDTH}}", "key"), (first, "")))
        rows += [row((" " * (KEY_WIDTH + 2), ""), (line, "")) for line in rest]
    return [*rows, EMPTY]


def help_rows(view_model: ViewModel, focused: Widget | None, app: App[None], width: int) -> list[Row]:
    """Return the mistakes in the settings, then the keys, then the STATUS table of the dialect."""
    rows: list[Row] = []
    names: dict[str, str] = getattr(app, "key_names", {})
    for problem in getattr(app, "problems", ()):
        first, *rest = wrap_text(f"✗ {problem}", width - 2)
        rows += [row((first, "error")), *(row(("  " + line, "error")) for line in rest)]
    rows += [EMPTY] * bool(rows)
    time_line = [("Time line of the recording", TIME_LINE_KEYS)] if view_model.position is not None else []
    for title, table in [*time_line, *sections_for(focused)]:
        rows += key_rows(title, table, width, names)
    return [*rows, *_status_rows(view_model, width)]


def _status_rows(view_model: ViewModel, width: int) -> Iterator[Row]:
    dialect, instance = view_model.project.dialect, view_model.instance
    yield row((f"STATUS of {dialect.title}", "strong"))
    for found in dialect.status:
        current = instance is not None and found.code == instance.outputs.status
        yield row(
            ("▸ " if current else "  ", "key"),
            (f"{found.word}  ", "error" if found.error else "strong"),
            ("ERROR " if found.error else "      ", "error"),
            (found.title, "strong" if current else ""),
            style="cursor" if current else "",
        )
        for label, texts in (("because", found.causes), ("check", found.checks)):
            for text in texts:
                for number, line in enumerate(wrap_text(text, width - 20)):
                    yield row((f"           {'' if number else label:<8}", "faint"), (line, "dim"))


def sections_for(focused: Widget | None) -> list[tuple[str, KeyTable]]:
    """Return the tables of keys; the table of the pane with the focus comes first."""
    sections: list[tuple[str, KeyTable]] = [(title, table) for title, _, table in HELP_SECTIONS]
    sections.append(("Signs", SIGNS))
    around = [widget.id for widget in focused.ancestors_with_self] if focused is not None else []
    title = next((title for id in around for title, ids, _ in HELP_SECTIONS if id in ids), None)
    here = focused.keys() if isinstance(focused, LineView) else ()
    table = dict(sections).get(title or "", ())
    if table is BLOCK_KEYS and here:  # the pane lists the letters of its own pins
        sections = [section for section in sections if section[1] is not PINS]
    if not here and not table:
        return sections
    more = [pair for pair in here if pair[0] not in dict(table)]
    first = (f"Here: {title}" if title else "Here", (*more, *table))
    return [first, *(section for section in sections if section[0] != title)]


class HelpScreen(ResultScreen):
    """The help screen. Escape closes it, and so do the keys that opened it."""

    BINDINGS: ClassVar = [Binding("question_mark,f1", "leave", show=False, id="help")]
    DEFAULT_CSS = "HelpScreen ResultText { width: 100; height: 90%; }"

    def __init__(self, view_model: ViewModel, focused: Widget | None = None) -> None:
        super().__init__(
            "help",
            "Help",
            "↑↓ and page keys scroll, esc closes",
            lambda width: help_rows(view_model, focused, self.app, width),
        )
