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
    ("M or \\", "the pane alone on the screen, and back"),
    ("space", "hold or resume the scans (the network keeps running)"),
    (".", "one scan while the scans are held"),
    ("F", "freeze the view while the PLC runs; keys still act; again: live"),
    ("T", "trigger: X STATUS=80C5 · X EN_R rises · rx.speed > 100 · … hold · off"),
    ("S or F2", "scenarios: read them, play them step by step"),
    ("L", "UDT lab: two profiles side by side, which one fits, what cures it"),
    ("B", "framing advice: how the bytes on a ComBuffer may be cut into frames, with evidence"),
    ("X", "bytes that were thrown away: the newest, again: those before"),
    ("J", "doctor: what is wrong with the selected instance, where it shows, how to mend it"),
    (":", "bench command line; up and down walk its history"),
    ("ctrl+p", "command palette: everything by name, or by words such as copy, graph, recent projects"),
    ("y", "yank what the pane shows: hex, 16#.., members, history; y y takes the first"),
    ("K", "mark: a saved scenario begins here"),
    (
        "A",
        "add an instance (with its CONNECT and DATA), connection, DATA, UDT file, peer; it is selected",
    ),
    ("E", "change or remove a part: the selected instance's CONNECT and DATA, peers, all others"),
    ("ctrl+z", "undo the newest add, change or remove"),
    ("ctrl+s", "`save project`: write what was added, changed and removed to its file"),
    ("P", "save a picture of the screen as SVG; the prompt shows where"),
    ("ctrl+c", "copy the text selected with the mouse; F first, if it changes"),
    ("? or F1", "this help"),
    (
        "other keys",
        "a key that only one pane has works everywhere, if it changes nothing; else go to the pane first",
    ),
    ("esc", "leave a field, close the prompt, back to now"),
    ("R", "start or end a recording; restart an engine that has ended"),
    ("q or ctrl+q", "quit"),
)
MOVES: Final = ("↑ ↓ j k, g G", "in a list, page up and down, too; home and end: the first row, the last one")
LETTERS: Final = (  # of panes 1 to 3
    ("n t a x r", "EN_R, CONT, ADHOC, COM_RST, REQ of the selected instance"),
    ("l", "write LEN: the prompt opens with the command"),
    ("f u d c", "ReceiveData: prefix, suffix (hex or text), the variable, bytes for its line"),
)
PINS: Final = (*LETTERS, ("a letter", "the pin that has this letter in pane 2; a click on it does the same"))
INSTANCE_KEYS: Final = (
    ("/", "list only those with these words: name, block, code, address, `error`; esc: all"),
    ("!", "the next one with an ERROR"),
)
BLOCK_KEYS: Final = (
    ("enter", "toggle the pin under the cursor"),
    ("C", "the connection description byte for byte; y takes it as hex, s as SCL"),
    MOVES,
)
STATUS: Final = ("enter", "type what `do` says, if it was tried or needs no trial; or click on `do`")
HISTORY_KEYS: Final = (
    ("↑ ↓", "explain an edge"),
    ("/", "a code, as in `find 7004`"),
    ("n N", "previous, next edge with the code of /, until esc; without /: with an ERROR"),
    ("!", "the ERROR before"),
)
RECEIVED_KEYS: Final = (
    ("← → h l, ↑ ↓ j k", "byte by byte, row by row; g and G first and last; page up and down"),
    ("H", "all bytes received so far as one stream, with rulers; again: DATA now"),
    ("D", "the messages as a table, newest last, with filter and CSV; again: DATA now"),
    ("/", 'find hex, else a text ("29" too), =number in either byte order; @offset, #job; esc: no marks'),
    ("n N", "after /: the next hit, the hit before, until another pane is chosen; without: as ] and ["),
    ("[ ]", "the DONE before, the next one"),
    ("d u", "what differs from the job before, or from the marked message; fewer rulers"),
    ("m", "mark the message at the cursor: d compares others with it, y r copies from it to the cursor"),
)
TABLE_KEYS: Final = (
    ("n N [ ]", "the next message, the one before; end: follow the newest"),
    ("/", "weight > 3, STATUS=80C5, RCVD_LEN!=12; it acts as you type, esc: all"),
    ("y", "what passes the filter as CSV, to the clipboard and a file"),
)
MEMBER_KEYS: Final = (
    ("enter", "the curve: the member over time"),
    ("v", "members of DATA, or of what the running job has collected so far"),
    ("V", "view DATA as the sender's: in the layout that fits the bytes; again: as the PLC's own"),
)
CURVE_KEYS: Final = (
    ("enter", "in the members, or a click on the small curve behind a number; esc leaves"),
    ("+ -", "less, more time in view"),
    ("← →, home end", "back and forth in time; the first message; follow the newest again"),
    ("p", "add another number of the type, with its own axis, on the same time; after the last: none"),
)
TIMING_KEYS: Final = (
    ("← → h l, shift", "scan by scan; edge by edge of any pin"),
    ("n N", "next and previous edge of the chosen row"),
    ("! /", "next ERROR; next edge to a code, as in `find 7008`"),
    ("+ = -, wheel", "fewer or more scans a column; a pulse stays visible"),
    ("m", "first and second marker: the title shows their distance in scans and ms"),
    ("f, esc", "follow the newest scan, or stay; back to now"),
    ("o", "the other instances of this CONNECT, too"),
    ("e", "write a VCD (GTKWave, PulseView)"),
)
PEER_COMMAND_KEYS: Final = (  # each sends its command, or opens the prompt with it
    ("c s f", "connect or listen; send the message; FIN (UDP: close)"),
    ("r h z", "RST; half-close: the peer still receives; stall: it stops reading, then reads again"),
    ("l u", "silence the wire, without FIN or RST; let a kernel call fail, or clear such faults"),
    ("b", "self-checking traffic with number and CRC: counts lost, doubled, shifted frames; off"),
    ("e", "try every split of the message, as a table; y copies it"),
    ("a d", "add a reply rule; remove all of them"),
)
PEER_KEYS: Final = (
    *PEER_COMMAND_KEYS,
    ("i, m", "edit the payload; edit it in the next mode of hex, text, udt; enter there sends it"),
    ("x, ← → space + -", "the bytes of the message: place a cut, make its pause longer or shorter"),
    ("o w p", "a UDT as a form; save the message in the library under a name; pick one from it"),
    ("← → enter", "walk the buttons, press one"),
    ("A", "add a peer"),
)
FEED_KEYS: Final = (
    ("enter i", "type bytes for the simulated line"),
    ("s → ← b", "feed the same again; the next byte; back to the first byte; pull the cable"),
)
LINE_KEYS: Final = (
    ("↑ ↓", "choose a conversation and one of its directions"),
    ("h", "tap: hold this direction, or release it; the header shows for how long it is held"),
    ("e i d y s r f", "tap: the prompt opens with the bench command; enter sends it (--armed: r, f act)"),
    ("w", "mirror port: shadows for a conversation that has none"),
    ("q", "tap: end it; with open connections it asks: c cuts them, d closes only the screen"),
)
SCENARIO_KEYS: Final = (
    ("↑ ↓, /", "choose a scenario; a filter, as you type it"),
    ("k", "simulated network or real sockets, for the next scenario that is loaded"),
    ("enter", "load it: a new bench replaces the present one"),
    ("n or space", "the next step; during a run: stop after the running one"),
    ("r", "all remaining steps; simulated ones at full speed"),
    ("5 6 7", "STATUS, history, timing of the scenario"),
    ("v", "all panes of the bench, with the scenario; S goes back to its steps"),
    ("esc or q", "leave: your project starts again"),
)
LAB_KEYS: Final = (
    ("1 … 4", "members, bytes, which profile fits, cure"),
    ("t b", "the type; the bytes: DATA, job, last job, a message, typed hex"),
    ("o p", "the layout of our type, of the sender's; x exchanges them"),
    ("E e, S s", "byte order of our type, of the sender's; STRING form likewise"),
    ("space, ← →, z", "fold the branch under the cursor; all"),
    ("n N", "the next member that differs, the one before"),
    ("[ ]", "the message before, the next one"),
    ("f, enter", "rank the profiles by the bytes at hand, with reasons; take one as theirs"),
    ("c d", "cure: type for our side, for the sender's, swap code; in ST or SCL"),
    ("y", "yank what the pane shows: clipboard, and always a file"),
    ("O X", "open a type file; hex to look at (typed or pasted)"),
    ("C w", "constants that no file declares; problems in the type files"),
    ("R u", "DATA: take its changed type (udt reload, then resize); use the shown type for it"),
    (":", "udt open, type, ours, theirs, swap, bytes, hex, fit, constant, reload"),
    ("esc or q", "back to the bench; files that change are read again while the lab is open"),
)
TIME_LINE_KEYS: Final = (
    ("← → or ,", "one scan back, one forward; with shift one edge of the selected instance"),
    ("!", 'the next ERROR of any instance or finding of the doctor; " or @: the one before'),
    ("g", "in each pane: go to a time or a scan: at T#12m3s, at scan 1062; home, end: the first, the last"),
    ("space", "play, stop; . is one scan forward"),
    ("+ -", "faster, slower: 0.1x to the fastest"),
    ("T", "the next scan in which a trigger fires"),
    ("W", "what if: if instance.X.LEN=20, if dialect NAME, if off; both runs, and where they differ first"),
    ("9 or esc", "focus the time line; a pane with the focus keeps its own keys"),
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
    """Return a letter for each pin, each letter once and not in `taken`; "" if none of its name is free."""
    names = list(pins)
    given = {pin: PIN_LETTERS[pin] for pin in names if pin in PIN_LETTERS}
    for pin in names:
        free = (c for c in pin.lower() if c.isalpha() and c not in {*RESERVED, *taken, *given.values()})
        given.setdefault(pin, next(free, ""))
    return given


KEY_WIDTH: Final = 18
SIGNS: Final = (
    ("■ □ ◆", "a lamp on, off, lit for one scan a moment ago (with its scan)"),
    ("⋄ _ • ×", "bytes: NUL, white space, control, 16#80 and up"),
    ("▕", "before a byte: a message of the peer begins here"),
    ("▁ ▔ █ ┃ ░", "over time: 0, 1, 1 for one scan, a pulse or more in the column, not known"),
    ("▁ █ ×", "behind a number: the last 60 messages; no number there. Below a curve: ▲ ERROR, × cut"),
    ("··", "a byte that the running job still waits for"),
    ("▸ ▶ • ✓ ✗", "a step of a scenario: the next, running, done, held, failed"),
)


def key_rows(title: str, table: KeyTable, width: int, names: Mapping[str, str]) -> list[Row]:
    """Return the rows of a table of keys; `names` are the new names of keys that the user has changed."""
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
    """Closed by the keys that opened it, and by escape."""

    BINDINGS: ClassVar = [Binding("question_mark,f1", "leave", show=False, id="help")]
    DEFAULT_CSS = "HelpScreen ResultText { width: 100; height: 90%; }"

    def __init__(self, view_model: ViewModel, focused: Widget | None = None) -> None:
        super().__init__(
            "help",
            "Help",
            "↑↓ and page keys scroll, esc closes",
            lambda width: help_rows(view_model, focused, self.app, width),
        )
