"""The UDT lab on the screen: two profiles side by side, which one fits, what cures it, files that change."""

from __future__ import annotations

import os
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import BOTH, SMALL, WIDE, same_screen
from tests.tui.stage import Stage, on_stage
from trcvtui.plc.ledger import PeerSent
from trcvtui.project.file import load_project
from trcvtui.tui.lab.lab import DATA, LabBytes
from trcvtui.tui.lab.screen import LabScreen
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.udt.layout.layout import lay_out, rules_for

MISMATCH = CONFIGS / "udt-mismatch.toml"
PROJECT = """
dialect = "baosky"

[[udt]]
file = "types.st"

[[data]]
name = "rx"
type = "Telegram"

[[connect]]
name = "C1"

[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
"""
TELEGRAM = """
TYPE Telegram :
STRUCT
    kind  : BYTE;
    value : LREAL;
    tag   : STRING[6];
    spots : ARRAY[1..3] OF INT;
END_STRUCT
END_TYPE
"""
UNUSED = """
TYPE Frame : STRUCT rows : ARRAY[1..GVL.ROWS] OF INT; cols : ARRAY[1..GVL.COLS] OF INT; END_STRUCT END_TYPE
"""
BAD = """
TYPE Bad : STRUCT x : NOBODY; END_STRUCT END_TYPE
"""


class LabStage(Stage):
    async def say(self, text: str) -> None:
        await self.press("colon")
        self.lab.ask._input.value = text
        await self.press("enter")

    @property
    def lab(self) -> LabScreen:
        assert self.app.lab is not None
        return self.app.lab

    def row(self, needle: str) -> str:
        return self.line(needle).replace("┃", " ").replace("│", " ")


@asynccontextmanager
async def lab(path: Path, size: tuple[int, int] = WIDE, scans: int = 20) -> AsyncIterator[LabStage]:
    async with on_stage(LabStage, load_project(path), size) as stage:
        await stage.scan(scans)
        await stage.press("L")
        yield stage


def project(folder: Path, types: str = TELEGRAM) -> Path:
    save(folder / "types.st", types, 1)
    (folder / "p.toml").write_text(PROJECT, encoding="utf-8")
    return folder / "p.toml"


def save(path: Path, text: str, at: int) -> None:
    path.write_text(text, encoding="utf-8")
    os.utime(path, (at, at))


# -- the story -----------------------------------------------------------------------------------------


@BOTH
async def test_the_mismatch_is_found_and_cured(size: tuple[int, int]) -> None:
    async with lab(MISMATCH, size, scans=300) as stage:
        assert "≠ 3 of 4 differ" in stage.row("p theirs")
        await stage.press("p", *"packed", "enter")
        assert "packed" in stage.row("p theirs"), "the guess was another one"
        await stage.press("f")
        assert "natural8, little-endian" in stage.row("▸ 1 "), "the profile of the sender leads"
        assert "24 bytes came, the type has 24" in stage.words
        await stage.press("enter")
        assert "natural8" in stage.row("p theirs")
        await stage.press("c")
        assert "_pad1 : ARRAY[0..6] OF BYTE;" in stage.text
        assert "TYPE AxisReport_natural8 :" in stage.text


async def test_on_a_message_theirs_reads_what_was_sent() -> None:
    async with lab(MISMATCH, scans=300) as stage:
        await stage.say("udt bytes message")
        await stage.press("1")
        assert "Drive message" in stage.text
        row = stage.row(" position ")
        assert row.split()[:3] == ["≠", "position", "LREAL"] and "-3.75" in row
        await stage.press("left_square_bracket")
        assert "112.25" in stage.row(" position ")


async def test_the_lab_stands_as_drawn(tmp_path: Path) -> None:
    for size in (WIDE, SMALL):
        async with lab(MISMATCH, size, scans=300) as stage:
            await stage.press("down", "down", "down")
            same_screen(stage.app, f"lab-{size[0]}x{size[1]}", tmp_path)


# -- the tree ------------------------------------------------------------------------------------------


@BOTH
async def test_branches_fold_and_open(tmp_path: Path, size: tuple[int, int]) -> None:
    async with lab(project(tmp_path), size) as stage:
        assert "[2]" in stage.text
        await stage.press("G", "up", "left")
        assert "▸≠  ▾ spots" in stage.text, "the owner of what was chosen"
        await stage.press("left")
        assert "▸ spots" in stage.text and "[2]" not in stage.text
        await stage.press("right")
        assert "▾ spots" in stage.text and "[2]" in stage.text


async def test_the_byte_under_the_cursor_finds_its_row_and_back(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.press("2", "home", *["right"] * 5)
        assert stage.row("value").lstrip().startswith("▸"), "byte 5 of ours"
        await stage.press("1", "down")
        assert stage.lab.hex.link == range(12, 20), "the next row: the text tag"


async def test_n_goes_from_difference_to_difference(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.press("n")
        assert stage.row(" value ").lstrip().startswith("▸≠")
        await stage.press("n", "N")
        assert stage.row(" value ").lstrip().startswith("▸≠")


# -- profiles ------------------------------------------------------------------------------------------


@BOTH
async def test_e_turns_the_byte_order_of_theirs_and_s_its_strings(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    async with lab(project(tmp_path), size) as stage:
        await stage.say("udt hex 01 00 00 00 00 00 00 00 00 00 F0 3F 06 02 68 69")
        await stage.press("1")
        assert "little-endian" in stage.row("p theirs")
        await stage.press("e", "s")
        theirs = stage.row("p theirs")
        assert "big-endian" in theirs and "STRING cstr" in theirs
        assert "little-endian" in stage.row("o ours"), "ours stays"
        await stage.press("e", "p", *"baosky", "enter", "e")
        assert "≠" in stage.row(" value ").split("LREAL")[0], "the same place, another value"


async def test_ours_and_theirs_are_exchanged(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.press("x")
        assert "natural8" in stage.row("o ours") and "baosky" in stage.row("p theirs")


async def test_swap_code_is_written_in_scl_too(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.press("e", "4", "c", "c", "d")
        assert "swap code for the sender, SCL" in stage.text
        assert "SWAP(" in stage.lab.cure.found.text


async def test_the_cure_is_yanked_into_a_file(state: Path, tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.press("4", "y")
        await stage.app.workers.wait_for_complete()
        await stage.press()
        (kept,) = (state / "trcvtui" / "yanks").glob("*.st")
        assert "TYPE Telegram_natural8" in kept.read_text(encoding="utf-8")
        assert "yanked the cure in ST" in stage.words


async def test_a_wrong_line_or_a_file_that_is_none_is_told_in_one_line(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        await stage.say("udt open nowhere.st")
        assert "✗" in stage.words and "nowhere.st" in stage.words and "Telegram of types.st" in stage.text
        await stage.say("udt theirs naturl8")
        assert "✗ udt theirs: found 'naturl8', expected one of baosky" in stage.words


# -- files ---------------------------------------------------------------------------------------------


async def test_a_changed_file_is_shown_at_once_and_comes_into_data_by_r(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        save(tmp_path / "types.st", TELEGRAM.replace("kind  : BYTE", "kind  : BYTE; more : DWORD"), 2)
        stage.lab.reload_files()
        await stage.press()
        assert " more " in stage.text
        assert "types.st has changed: Telegram now 32 B, before 28 B" in stage.words
        assert "DATA rx stays as it is until R (resize) or a restart" in stage.words
        assert stage.driver.console.bench.project.data[0].size == 28
        await stage.press("R")
        stage.driver.scan(1)
        await stage.press()
        assert stage.driver.console.bench.project.data[0].size == 32
        assert "DATA rx, 32 B" in stage.text


async def test_unknown_constants_are_asked_for_and_saved_with_the_project(tmp_path: Path) -> None:
    path = project(tmp_path, TELEGRAM + UNUSED)
    async with lab(path) as stage:
        assert "Constants that types.st uses" in stage.text
        await stage.press(*"12", "enter", *"16#3", "enter")
        assert stage.lab.lab.files.types.unknown_constants == ()
        await stage.press("t", *"Frame", "enter")
        assert "32 B" in stage.row("o ours"), "12 and 3 of INT, and the gap after"
        await stage.say("save project")
    assert load_project(path).constants == {"GVL.ROWS": 12, "GVL.COLS": 3}
    assert path.read_text(encoding="utf-8").startswith(PROJECT), "the rest stands as it stood"


async def test_problems_of_types_that_nobody_uses_are_listed(tmp_path: Path) -> None:
    async with lab(project(tmp_path, TELEGRAM + BAD)) as stage:
        assert "w: 1 problem in types.st" in stage.text
        await stage.press("w")
        assert "'NOBODY'" in stage.words
        await stage.press("escape")


async def test_a_file_of_any_format_is_opened_by_a_line_of_the_bench(tmp_path: Path) -> None:
    save(
        tmp_path / "device.scl",
        'TYPE "Report"\nSTRUCT\n kind : Byte;\n value : LReal;\nEND_STRUCT;\nEND_TYPE\n',
        1,
    )
    async with lab(project(tmp_path)) as stage:
        await stage.press("escape")
        assert stage.app.lab is None
        stage.app.submit(f"udt open {tmp_path / 'device.scl'}")
        await stage.press()
        await stage.press()
        assert "Report of device.scl" in stage.text
        assert "s7-standard · e big" in stage.row("p theirs"), "its source tells the sender's layout"
        await stage.say("udt project")
        assert "Telegram of types.st" in stage.text and "natural8" in stage.row("p theirs")


async def test_everything_is_in_the_palette(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        titles = {command.title for command in stage.app.get_system_commands(stage.app.screen)}
        assert {"Which profile fits?", "Choose our profile", "Next difference", "Leave the lab"} <= titles
        await stage.press("escape")
        titles = {command.title for command in stage.app.get_system_commands(stage.app.screen)}
        assert "UDT lab" in titles


async def test_the_mouse_chooses_rows_folds_and_opens_tabs(tmp_path: Path) -> None:
    async with lab(project(tmp_path), SMALL) as stage:
        y = next(n for n, line in enumerate(stage.text.splitlines()) if "spots" in line)
        x = stage.text.splitlines()[y].index("▾")
        await stage.pilot.click(offset=(x, y))
        await stage.press()
        assert "▸ spots" in stage.row("spots")
        tabs = stage.text.splitlines()[1]
        await stage.pilot.click(offset=(tabs.index("Bytes"), 1))
        await stage.press()
        assert stage.lab.focused is stage.lab.hex


# -- where DATA has never been written -------------------------------------------------------------------

PARTNER = """
program = '''
set TRCV_C_1 CONT=1
wait TRCV_C_1 STATUS=7004
set TRCV_C_1 EN_R=1
'''

[[peer]]
name = "P1"
active = true
remote = "@C1"
"""


@BOTH
async def test_on_a_bench_the_lab_opens_on_what_has_come_until_data_is_written(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    path = project(tmp_path)
    said = 'dialect = "baosky"\n'
    connect = 'name = "C1"\nLocalAddress = "127.0.0.1"\nLocalPort = 2000\n'
    text = PROJECT.replace(said, said + PARTNER).replace('name = "C1"\n', connect, 1)
    path.write_text(text, encoding="utf-8")
    async with on_stage(LabStage, load_project(path), size) as stage:
        await stage.scan(10)
        await stage.do("peer P1 connect", scans=10)
        await stage.do("peer P1 send hex 07 11 22 33 44", scans=10)
        await stage.press("L")
        assert "DATA rx has never been written: these are the bytes of the running job" in stage.words
        assert stage.lab.lab.bytes.content == bytes.fromhex("0711223344")
        await stage.press("escape")
        rest = lay_out(load_project(path).types.get_type("Telegram"), rules_for("baosky")).size - 5
        await stage.do("peer P1 send hex " + "01" * rest, scans=20)
        await stage.press("L")
        assert "has never been written" not in stage.words
        assert stage.lab.lab.bytes.source == DATA
        assert stage.lab.lab.bytes.content[:6] == bytes.fromhex("071122334401")


def looked_at(data: bytes, job: bytes, jobs_done: int) -> LabBytes:
    receiver = SimpleNamespace(name="R", data="rx", sends=False, jobs_done=jobs_done)
    snapshot, declared = SimpleNamespace(instances=[receiver]), SimpleNamespace(name="rx")
    view_model = SimpleNamespace(
        data=data, job_bytes=job, declaration=declared, snapshot=snapshot, instance=receiver, selected="R"
    )
    return LabBytes(cast(ViewModel, view_model))


def test_the_lab_opens_on_data_that_a_job_has_written_or_that_was_chosen() -> None:
    for data, job, done in ((bytes(8), b"\1", 1), (b"\0\1", b"\1", 0), (bytes(8), b"", 0)):
        found = looked_at(data, job, done)
        assert (found.choose_initial(), found.source) == ("", DATA)
    chosen = looked_at(bytes(8), b"\1", 0)
    chosen.is_chosen = True
    assert (chosen.choose_initial(), chosen.source) == ("", DATA)


# -- a partner outside the bench -----------------------------------------------------------------------

EACH = "peer P1 send hex 01{} repeat=20".format("42" * 34)


@pytest.mark.parametrize(
    ("line", "judged"),
    [
        (f"{EACH} every=T#200ms", r"By 8 messages by pauses: .* 35 bytes came"),
        (
            f"{EACH} every=T#10ms",
            r"By DATA rx, 40 B \(bytes came without a pause: .*not known\): (?!.*came,)",
        ),
        (
            f"{EACH} every=T#300ms split=20 gap=T#100ms",
            r"\(pieces of 15 to 20 B came: .*\): (?!.*bytes came)",
        ),
    ],
    ids=["with pauses", "a plain stream", "in pieces"],
)
async def test_messages_of_a_stranger_are_known_by_pauses_alone(
    tmp_path: Path, line: str, judged: str
) -> None:
    path = project(
        tmp_path, "TYPE Telegram : STRUCT kind : BYTE; rest : ARRAY[0..8] OF REAL; END_STRUCT END_TYPE"
    )
    passive = PROJECT.replace('"C1"\n\n', '"C1"\nLocalAddress = "127.0.0.1"\nLocalPort = 2000\n\n')
    path.write_text(passive + '\n[[peer]]\nname = "P1"\nremote = "@C1"\n', encoding="utf-8")
    async with lab(path) as stage:
        del stage.driver.console._ledger.index.listeners[PeerSent]  # what a partner outside does not tell
        await stage.do("set TRCV_C_1 CONT=1 EN_R=1", scans=10)
        await stage.do("peer P1 connect", scans=10)
        await stage.do(line, scans=400)
        await stage.press("f")
        assert re.search(judged, stage.words), stage.text


async def test_a_type_of_another_file_is_used_for_data_and_its_file_is_added_once(tmp_path: Path) -> None:
    path = project(tmp_path)
    (tmp_path / "other").mkdir()
    save(tmp_path / "other" / "o.st", "TYPE Order : STRUCT id : DINT; END_STRUCT END_TYPE", 1)
    async with lab(path) as stage:
        assert "use for" not in stage.text
        await stage.say("udt open other/o.st")
        assert "u use for rx" in stage.text
        await stage.press("u")
        await stage.scan(2)
        assert "use for" not in stage.text
        known = stage.app.view_model.project
        assert [each.name for each in known.udts] == ["types.st", "other/o.st"]
        assert (known.data[0].type_name, known.data[0].size) == ("Order", 4)
        await stage.say("udt project")
        await stage.say("udt type Telegram")
        await stage.press("u")
        await stage.scan(2)
        assert stage.app.view_model.project.data[0].type_name == "Telegram"
        await stage.say("udt open other/o.st")
        await stage.press("u")
        await stage.scan(2)
        known = stage.app.view_model.project
        assert [each.name for each in known.udts] == ["types.st", "other/o.st"]
        assert known.data[0].type_name == "Order"


async def test_without_data_the_lab_says_why_no_type_is_used(tmp_path: Path) -> None:
    path = project(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").partition("[[connect]]")[0], encoding="utf-8")
    async with lab(path) as stage:
        await stage.press("u")
        assert "needs an instance with DATA" in stage.words
        assert stage.app.view_model.project.udts[0].name == "types.st"


async def test_a_file_that_has_a_type_of_the_project_is_not_used(tmp_path: Path) -> None:
    async with lab(project(tmp_path)) as stage:
        save(tmp_path / "o.st", TELEGRAM.replace("LREAL", "REAL"), 1)
        await stage.say("udt open o.st")
        await stage.press("u")
        await stage.scan(2)
        assert "'Telegram' a second time" in stage.words
        assert len(stage.app.view_model.project.udts) == 1
