"""Draw the pictures of the documentation: the real screen on a simulated bench, `make pictures`.

Nothing is made by hand: a picture is a project, bench commands, scans and keys, and is the same each time.
"""

from __future__ import annotations

import asyncio
import os
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from textual.pilot import Pilot
from textual.widgets import Input

from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.paths import demo_path
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.settings import load_settings

HERE: Final = Path(__file__).resolve().parent
GALLERY: Final = HERE / "gallery"
PICTURES: Final = HERE / "pictures"
CONFIGS: Final = Path("configs")
STORIES: Final = CONFIGS / "stories"
WIDE, SMALL, PANE, HIGH, FRONT = (140, 45), (80, 24), (100, 24), (100, 34), (100, 30)
MOST_LOOKS: Final = 2000
MADE_UP: Final = Path()  # no project: what agents of a plant tell (fleet_plant.py)
BLANK, CELL = "&#160;", 12.2  # a blank, and the width of a cell
TEXT: Final = re.compile(r'<text([^>]*?) x="([\d.]+)"([^>]*?) textLength="([\d.]+)"([^>]*)>([^<]*)</text>')


class Keys(NamedTuple):
    """Keys to press, each once the screen shows what came before."""

    names: tuple[str, ...]


class Typed(NamedTuple):
    """A text to type into the field that has the focus."""

    text: str


class Look(NamedTuple):
    """A frame of a moving picture: its title, and for how many seconds it is shown."""

    title: str
    seconds: float


# A text is a bench command; a number lets so many scans pass.
Move = str | int | Keys | Typed | Look
Play = Sequence[Move]


class Picture(NamedTuple):
    """One picture: what it shows in a line, which panes are looked at, and how the screen comes there."""

    name: str
    about: str
    shows: tuple[str, ...]
    project: Path
    play: Play
    size: tuple[int, int] = PANE
    theme: str = "dark"


def keys(*names: str) -> Keys:
    """Return keys to press."""
    return Keys(names)


DEMO: Final[Play] = (295,)
DROPPED: Final[Play] = (960,)
BUSY: Final[Play] = (312,)  # the demo in the middle of a telegram that comes in pieces
LAB: Final[Play] = (300, keys("L", "b"), Typed("message"), keys("enter"))  # as it was sent
SENT: Final[Play] = (
    "set TSEND_C_1 CONT=1",
    "set TRCV_C_1 CONT=1 EN_R=1",
    "write tx hex 06 00 01 4F 4B 20 0D 0A",
    4,
    "peer P1 connect",
    6,
    "pulse TSEND_C_1 REQ",
    6,
    "peer P1 send hex 05 0D 10 20 30 40 50 60",
    6,
)
FRAMER: Final[Play] = (
    "prefix RD hex 02", "suffix RD hex 0D 0A", "set RD Timeout=50", 20, keys("7", "enter"),
    Typed("FF EE 02 41 31 37 0D 0A"), keys("enter"), 3, "feed RX hex 02 41", 4, keys("2"),
)  # fmt: skip
READINGS: Final = ("A17;12.5", "B3;7.25", "A17;12.6", "C120;0.5", "B3;7.5", "A18;99")
FRAMINGS: Final[Play] = (
    "set RD SizeReceiveData=0",
    *[move for text in READINGS for move in (f'feed RX text "\\x02{text}\\r\\n"', 12)],
    keys("B"),
)

FOUND: Final[Play] = (
    40, Look("TRCV_C waits for a meter that reports once a second.", 2.5),
    80, Look("A report has come: DONE, 20 bytes, no ERROR.", 3),
    keys("6"), Look("Key 6: the members of DATA. No value is right.", 4),
    100, Look("The next report: DONE again, wrong again.", 3),
    keys("3"), Look("Key 3: why? The members make sense in the other byte order.", 6),
    keys("V", "6"), 2, Look("Key V: read DATA in that byte order. Every value is right.", 4),
    100, Look("The next report: 230.5 V, 12.5 A.", 5),
)  # fmt: skip

NIGHT: Final[Play] = (
    1100, keys("1"), Look("A checkweigher reports all night, and one package is far too heavy. When?", 3),
    keys("6"), Look("Key 6: behind each number its last messages.", 4),
    keys("5", "D"), 25, Look("Key D: the messages as a table. New ones come at its end.", 4),
    keys("slash"), Typed("weight > 55"), 25, Look("/ weight > 55: these two, with scan, time and STATUS.", 5),
    keys("enter", "up", "6", "down", "down"), Look("Pane 6 has the members of the chosen message.", 3),
    keys("enter"), 200, Look("Enter: the weight over time. It drifts, and falls when the scale is wiped.", 6),
    keys("p", "p"), 100, Look("Key p: another member on the same time axis, with an axis of its own.", 5),
)  # fmt: skip

# The pictures of README.md and docs/guide.
TOLD: Final = (
    Picture("night", "", (), STORIES / "weight_overnight.toml", NIGHT, FRONT),
    Picture("found", "", (), STORIES / "byte_order_swapped.toml", FOUND, FRONT),
    Picture("four-bytes-short", "", (), STORIES / "four_bytes_short.toml", (600, keys("6", "v", "3")), WIDE),
    Picture("two-layouts", "", (), CONFIGS / "guide" / "press.toml", (330, keys("L", "f", "enter")), WIDE),
    Picture("en-r-dropped", "", (), STORIES / "en_r_dropped.toml", (*DROPPED, keys("3")), WIDE),
)  # fmt: skip

# The gallery, in the order of docs/gallery.md.
SHOWN: Final = (
    Picture("bench", "The whole bench at 140x45: every pane at once", ("main",), demo_path(), DEMO, WIDE),
    Picture("bench-80x24", "The same at 80x24: the panes are tabs", ("main",), demo_path(), DEMO, SMALL),
    Picture("bench-light", "The light theme", ("main",), demo_path(), DEMO, WIDE, "light"),
    Picture("bench-ansi", "The 16 colours of the terminal, for NO_COLOR and old terminals", ("main",),
            demo_path(), DEMO, WIDE, "ansi"),
    Picture("instances", "1 Instances: role, both ends, STATUS, lamps, bytes received and expected",
            ("instances",), STORIES / "en_r_dropped.toml", (560, keys("1")), SMALL),
    Picture("block", "2 Block: the block as drawn in the program; its pins can be switched", ("block",),
            demo_path(), (*DEMO, keys("2", "M", "down"))),
    Picture("status", "3 STATUS: what it means, why it shows, with the current numbers, and what to check",
            ("status",), STORIES / "four_bytes_short.toml", (600, keys("3", "M"))),
    Picture("status-past", "3 STATUS of an earlier edge: the scan in which EN_R fell, and the lost bytes",
            ("status", "history"), STORIES / "en_r_dropped.toml", (700, keys("4", "down", "down", "3", "M"))),
    Picture("history", "4 History: every STATUS edge with its scan, its lamp and its cause", ("history",),
            STORIES / "en_r_dropped.toml", (*DROPPED, keys("4", "M", "down", "down", "down"))),
    Picture("received", "5 Received: DATA above, the unfinished job below, the source of the selected byte",
            ("received",), demo_path(), (*BUSY, keys("5", "M", "right", "right", "right", "right"))),
    Picture("sent", "5 Sent: bytes that the stack took, that are acknowledged, that the partner has read",
            ("received",), CONFIGS / "duplex.toml", (*SENT, keys("1", "down", "5", "M"))),
    Picture("stream", "5 with `H`: all received bytes under rulers of messages, recv calls, jobs and scans",
            ("received",), STORIES / "en_r_dropped.toml",
            (*DROPPED, keys("5", "H", "M", "left_square_bracket", "left_square_bracket")), HIGH),
    Picture("members", "6 Members: DATA as values of the UDT", ("udt",), demo_path(),
            (*DEMO, keys("6", "M", "down", "down", "down"))),
    Picture("members-job", "6 with `v`: the unfinished job as values of the UDT, as far as its bytes go",
            ("udt",), STORIES / "four_bytes_short.toml", (600, keys("6", "v", "M"))),
    Picture("messages", "5 with `D`: a filtered table of messages, and the members of the selected one",
            ("messages", "udt"), STORIES / "weight_overnight.toml",
            (1600, keys("5", "D", "slash"), Typed("weight > 52"), keys("enter", "up", "up")), WIDE),
    Picture("curve", "6 with `enter`: a member over time; `p` adds a second one", ("curve",),
            STORIES / "weight_overnight.toml", (1600, keys("6", "down", "down", "enter", "p", "p")), PANE),
    Picture("peer", "7 Peer: a new message with its cut points", ("peer",), demo_path(),
            (*DEMO, keys("7", "M", "i"), Typed("05 0D 01 02 0A FF 10 20"),
             keys("escape", "x", "right", "right", "space", "right", "right", "right", "space"))),
    Picture("peer-splits", "7 with `e`: the result of each split of a message",
            ("trial",), CONFIGS / "passive.toml",
            ("set TRCV_C_1 CONT=1 EN_R=1 ADHOC=1", 4, "peer P1 connect", 4,
             "peer P1 try-splits hex 01 02 03 04 05 06 07 08 on TRCV_C_1", 400, keys("7", "e"))),
    Picture("peer-udt", "7 with `o`: the members of a UDT as fields, checked while you type",
            ("form",), demo_path(),
            (*DEMO, keys("7", "M", "m", "escape", "m", "escape", "o"), Typed("7"), keys("tab"), Typed("1"),
             keys("tab", "tab"), Typed("1.25"), keys("tab"), Typed("LINE-1"))),
    Picture("timing", "8 Timing: pins and STATUS over scans; below, what a watch table would have shown",
            ("timing",), STORIES / "en_r_dropped.toml", (*DROPPED, keys("8", "M", "minus", "minus"))),
    Picture("timing-markers", "8 with two markers: their distance in scans and in ms", ("timing",),
            STORIES / "en_r_dropped.toml", (*DROPPED, keys("8", "M", "minus", "N", "m", "N", "N", "m"))),
    Picture("trigger", "A trigger has fired: the view is frozen in its scan, the PLC runs on", ("header",),
            demo_path(), (60, "trigger telegram.state = 2", 235, keys("3")), WIDE),
    Picture("prompt", "`:` takes bench commands and completes them", ("prompt",), demo_path(),
            (*DEMO, keys("colon"), Typed("peer Sensor s")), SMALL),
    Picture("refused", "A wrong command: what was found, what was expected", ("prompt",),
            demo_path(), (*DEMO, keys("colon"), Typed("set TRCV_C_1 ENR=1"), keys("enter")), SMALL),
    Picture("scenarios", "`S`: every scenario with its text; `/` filters", ("scenarios",), demo_path(),
            (*DEMO, keys("S", "slash"), Typed("80c5"), keys("enter")), WIDE),
    Picture("scenario-played", "A scenario played step by step, with the result of each step", ("scenarios",),
            demo_path(), (*DEMO, keys("S", "slash"), Typed("80c5-partner"), keys("enter", "enter"), 1,
                          keys("r"), 400), WIDE),
    Picture("lab", "`L`: the UDT lab: our layout beside theirs, the profile that fits, the cure",
            ("lab",), CONFIGS / "udt-mismatch.toml",
            (*LAB, keys("f", "enter", "1", "down", "down", "down")), WIDE),
    Picture("lab-80x24", "The lab at 80x24: its panes are tabs", ("lab",), CONFIGS / "udt-mismatch.toml",
            (*LAB, keys("1", "down", "down", "down")), SMALL),
    Picture("lab-fit", "Which profile fits? The ranking, with the reasons of the selected one", ("lab",),
            CONFIGS / "udt-mismatch.toml", (*LAB, keys("f")), SMALL),
    Picture("fleet", "`trcvtui fleet`: the lines of all sites, the worst first", ("fleet",),
            MADE_UP, (), WIDE),
    Picture("fleet-card", "The card of a line: its figures, its instances, its last events", ("fleet",),
            MADE_UP, (keys("down", "down", "down", "enter"),), WIDE),
    Picture("fleet-80x24", "The same fleet at 80x24, by cause", ("fleet",),
            MADE_UP, (keys("g", "g"),), SMALL),
    Picture("description", "`C` in pane 2: the connection description byte for byte, its error at the field",
            ("description",), CONFIGS / "scenarios" / "siemens" / "description-faults.toml",
            (1, keys("2", "C", "right", "right")), SMALL),
    Picture("framer", "ReceiveData: prefix, suffix, noise, an unfinished frame, its gap timer, a line",
            ("block", "received"), CONFIGS / "twincat-line.toml", FRAMER, WIDE),
    Picture("framings", "`B`: framing advice: how the bytes may be cut, why, the frames, and what enter does",
            ("framings",), CONFIGS / "twincat-line.toml", FRAMINGS, PANE),
    Picture("yank", "`y`: what the pane shows in five formats", ("yank",), demo_path(),
            (*DEMO, keys("5", "y"))),
    Picture("palette", "`ctrl+p`: every action by name", ("palette",), demo_path(),
            (*DEMO, keys("ctrl+p"), Typed("tri"))),
    Picture("help", "`?`: help for the pane that has the focus, then everything", ("help",), demo_path(),
            (*DEMO, keys("8", "question_mark"))),
    Picture("add", "`ctrl+p`, Add: a form that writes the bench command", ("add",), demo_path(),
            (*DEMO, keys("ctrl+p"), Typed("add instance"), keys("enter"))),
)  # fmt: skip


async def draw(picture: Picture) -> str:
    """Return the screen after the play, as SVG."""
    if picture.project == MADE_UP:
        from fleet_plant import draw_fleet  # beside this file

        pressed = [name for move in picture.play if isinstance(move, Keys) for name in move.names]
        return placed(await draw_fleet(picture.size, pressed))
    from moving_picture import Frame, moving  # beside this file

    project = load_bench_project(picture.project)
    driver = LocalDriver(fresh_bench(project, "sim"))
    settings = load_settings((*BenchApp.BINDINGS, *MainScreen.BINDINGS), picture.theme)
    app = BenchApp(driver, project, settings)
    frames: list[Frame] = []
    async with app.run_test(size=picture.size) as pilot:
        await caught_up(app, pilot)
        for move in picture.play:
            if isinstance(move, Look):
                frames.append(Frame(await seen(app, pilot, move.title), move.seconds))
            else:
                await do(move, driver, app, pilot)
        svg = moving(frames) if frames else await seen(app, pilot)
    driver.close()
    return svg


async def seen(app: BenchApp, pilot: Pilot[None], title: str = "trcvtui") -> str:
    """Return the screen as it is, as SVG."""
    for field in app.screen.query(Input):
        field.cursor_blink = False
    await caught_up(app, pilot)
    return placed(app.export_screenshot(title=title))


def placed(svg: str) -> str:
    """Return a picture whose texts begin and end with a sign: not every viewer keeps blanks at an end."""
    return TEXT.sub(_without_blanks, svg)


def _without_blanks(text: re.Match[str]) -> str:
    before, x, between, length, after, content = text.groups()
    bare = content
    while bare.startswith(BLANK):
        bare = bare.removeprefix(BLANK)
    first = (len(content) - len(bare)) // len(BLANK)
    while bare.endswith(BLANK):
        bare = bare.removesuffix(BLANK)
    blanks = (len(content) - len(bare)) // len(BLANK)
    if not bare:
        return ""
    place, width = float(x) + first * CELL, float(length) - blanks * CELL
    return f'<text{before} x="{place:g}"{between} textLength="{width:g}"{after}>{bare}</text>'


async def do(move: str | int | Keys | Typed, driver: LocalDriver, app: BenchApp, pilot: Pilot[None]) -> None:
    """Let scans pass, send a bench command, type, or press keys."""
    match move:
        case int():
            driver.scan(move)
        case str():
            driver.submit(move)
        case Typed(text):
            await pilot.press(*text)
        case Keys(names):
            for name in names:
                await caught_up(app, pilot)
                await pilot.press(name)


async def caught_up(app: BenchApp, pilot: Pilot[None]) -> None:
    """Wait until the screen shows the bench as it is: what a picture asks for comes with the one after it."""
    for _ in range(3):
        before = app.view_model.live
        for _ in range(MOST_LOOKS):
            await pilot.pause(0.002)
            if app.view_model.live is not before:
                break
        await app.workers.wait_for_complete()
    await pilot.pause()


def gallery_page() -> str:
    """Return docs/gallery.md."""
    parts = [
        "# Gallery",
        "Every pane of the screen. `make pictures` draws them with fixed keys on a simulated bench; "
        "none is made by hand. More faults, with pictures: [DONE never comes](guide/done-never-comes.md), "
        "[the values are wrong](guide/values-wrong.md).",
    ]
    for picture in SHOWN:
        parts += [
            f"## {picture.name}",
            picture.about + ".",
            f"![{picture.name}](gallery/{picture.name}.svg)",
        ]
    return "\n\n".join(parts) + "\n"


def main(wanted: Sequence[str] = ()) -> None:
    """Draw them all, or those that are named."""
    os.chdir(HERE.parent)
    with tempfile.TemporaryDirectory() as nobody:  # the user's own settings are in no picture
        os.environ.update(XDG_CONFIG_HOME=nobody, XDG_STATE_HOME=nobody, TERM="xterm-256color")
        os.environ.pop("NO_COLOR", None)
        for folder, pictures in ((PICTURES, TOLD), (GALLERY, SHOWN)):
            folder.mkdir(exist_ok=True)
            for picture in pictures:
                if not wanted or picture.name in wanted:
                    (folder / f"{picture.name}.svg").write_text(asyncio.run(draw(picture)), encoding="utf-8")
    (HERE / "gallery.md").write_text(gallery_page(), encoding="utf-8")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
