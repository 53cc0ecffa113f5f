"""Mending the project on the screen: a part is changed in a form, removed, and what was done is undone."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.widgets import Static

from tests.tui.forms.test_add_screen import fields, fill, keys_of
from tests.tui.looking import BOTH, WIDE
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from tests.tui.on_a_line import on_a_line
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.picture.protocol import READ_ONLY
from trcvtui.project.file import load_project
from trcvtui.tui.forms.fields import all_parts, fields_to_change, format_value, make_set_line, values_of

CONFIGS = Path(__file__).parents[3] / "configs"


def connect(looker: BenchLooker, name: str) -> ConnectConfig | None:
    return looker.app.view_model.project.connect(name)


async def scanned(looker: BenchLooker) -> None:
    looker.bench.scan(2)
    await looker.pictures()


@BOTH
async def test_keys_change_a_port_remove_a_peer_and_undo_both(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        await looker.press("E")
        assert "▸   Change CONNECT C1" in looker.text, "that of the selected instance comes first"
        await looker.type("connect c2")
        await looker.press("enter")
        assert "Change CONNECT C2" in looker.text
        assert "no change yet" in looker.text
        assert fields(looker)["RemotePort"].value == "2001", "the keys of now stand there"
        await looker.press("tab", "tab")
        await looker.type("2500")
        assert "▸ set connect C2 LocalPort=2500" in looker.text
        said = str(looker.app.screen.query_one("#form-line", Static).content)
        assert "LocalPort none before, 2500 now; restarts: CONNECT C2, instance TRCV_C_2" in said
        assert looker.lines == [], "nothing was sent before it was seen"
        await looker.press("enter")
        await scanned(looker)
        assert looker.lines == ["set connect C2 LocalPort=2500"]
        changed = connect(looker, "C2")
        assert changed is not None and changed.local.port == 2500
        assert "+1 unsaved" in looker.text

        await looker.press("E")
        await looker.type("remove peer p2")
        await looker.press("enter")
        assert "▸ peer P2 is removed" in looker.text
        await looker.press("enter")
        await scanned(looker)
        assert looker.lines[1:] == ["remove peer P2"]
        assert looker.app.view_model.project.peer("P2") is None

        await looker.press("ctrl+z")
        assert "▸ taken back: peer P2 is added" in looker.text
        await looker.press("enter")
        await scanned(looker)
        assert looker.app.view_model.project.peer("P2") is not None
        await looker.press("ctrl+z")
        said = " ".join(looker.text.split())
        assert "LocalPort 2500 before, none now; restarts: CONNECT C2, instance TRCV_C_2" in said
        await looker.press("enter")
        await scanned(looker)
        changed = connect(looker, "C2")
        assert changed is not None and changed.local.port == 0
        assert looker.lines[2:] == ["undo", "undo"]
        assert "unsaved" not in looker.text
        await looker.press("ctrl+z")
        assert "no edit of the project to undo" in looker.text
        assert not looker.app.main.prompt.is_open


@BOTH
async def test_a_connect_in_use_is_not_removed_and_one_that_nobody_uses_is(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        await looker.press("E")
        await looker.type("remove connect c2")
        await looker.press("enter", "enter")
        await looker.pictures()
        assert "in use by instance TRCV_C_2" in " ".join(looker.text.split())
        looker.bench.do("remove TRCV_C_2")
        await scanned(looker)
        await looker.press("E")
        await looker.type("remove connect c2")
        await looker.press("enter", "enter")
        await scanned(looker)
        assert connect(looker, "C2") is None
        await looker.press("ctrl+z", "enter", "ctrl+z", "enter")
        await scanned(looker)
        assert connect(looker, "C2") is not None
        assert [each.name for each in looker.app.view_model.instances] == ["TRCV_C_1", "TRCV_C_2"]


async def test_a_mistake_marks_its_field_and_enter_waits_and_without_a_change_enter_leaves() -> None:
    async with on_a_bench() as looker:
        await looker.press("E", "enter")
        await fill(looker, LocalPort="70000")
        assert "✗ connect C1: LocalPort: found '70000', expected a whole number from 0" in looker.text
        assert [key for key, field in fields(looker).items() if field.has_class("-bad")] == ["LocalPort"]
        await looker.press("enter")
        await fill(looker, LocalPort="2000")
        assert "no change yet" in looker.text
        await looker.press("enter")
        assert looker.app.screen is looker.app.main and looker.lines == []


async def test_on_pane_7_the_selected_peer_comes_first() -> None:
    async with on_a_bench() as looker:
        await looker.press("7", "E", "enter")
        assert "Change peer P1" in looker.text
        await fill(looker, reconnect="T#50ms")
        assert "restarts: peer P1" in looker.text
        await looker.press("enter")
        assert looker.lines == ["set peer P1 reconnect=T#50ms"]


async def test_data_gets_another_type_or_layout_and_an_instance_another_data() -> None:
    async with on_a_bench() as looker:
        await looker.press("E")
        await looker.type("data variable small")
        await looker.press("enter")
        await fill(looker, type="ARRAY[0..9] OF BYTE", byte_order="big")
        await looker.press("enter")
        await looker.press("E")
        await looker.type("instance trcv_c_1")
        await looker.press("enter")
        assert list(fields(looker)) == ["block", "connect", "data", "task"]
        await fill(looker, data="small")
        await looker.press("enter")
        await scanned(looker)
        assert looker.lines == [
            "set data small ARRAY[0..9] OF BYTE byte_order=big",
            "set instance TRCV_C_1 data=small",
        ]
        made = looker.app.view_model.project.instance("TRCV_C_1")
        assert made is not None and made.data == "small"


async def test_the_block_of_an_instance_changes_with_its_fields_in_one_line() -> None:
    async with on_a_line(WIDE) as shown:
        await shown.press("E", *"instance", "enter")
        assert keys_of(shown)[:2] == ["RxBuffer", "data"], shown.text
        await shown.press("ctrl+u", *"SendByte")
        line = str(shown.app.screen.query_one("#form-line", Static).content)
        words = ("block=SendByte", "TxBuffer=RX", "RxBuffer=", "data=", "pPrefix=", "SizeReceiveData=")
        assert line.startswith("▸ set instance RD ") and all(word in line.split() for word in words)
        assert line.endswith("restarts: instance RD")


async def test_the_palette_changes_removes_and_undoes() -> None:
    async with on_a_bench() as looker:
        titles = {command.title: command for command in looker.app.get_system_commands(looker.app.screen)}
        for title in ("Change instance TRCV_C_1", "Remove peer P1", "Change DATA variable rx", "Undo"):
            assert title in titles
        titles["Change CONNECT C1"].callback()
        await looker.settle()
        assert "Change CONNECT C1" in looker.text
        await looker.press("escape")
        titles["Remove CONNECT C1"].callback()
        await looker.settle()
        assert looker.app.main.prompt._input.value == "remove connect C1"


async def test_a_line_that_is_typed_says_who_begins_anew_before_it_is_sent() -> None:
    async with on_a_bench() as looker:
        await looker.press("colon")
        await looker.type("set C1 Local")
        assert "restarts" not in looker.text
        await looker.type("Port=2500")
        assert "▸ CONNECT C1: LocalPort 2000 before, 2500 now; restarts: CONNECT C1" in looker.text
        await looker.press("escape")
        assert "restarts" not in looker.text and looker.lines == []


async def test_a_read_only_screen_changes_nothing_and_reads_no_line() -> None:
    async with on_a_bench() as looker:
        looker.bench.do("set C1 LocalPort=2500")
        await scanned(looker)
        looker.app.only_looks = True
        for key in ("E", "ctrl+z"):
            await looker.press(key)
            assert READ_ONLY in " ".join(looker.text.split())
            assert looker.app.screen is looker.app.main and not looker.app.main.prompt.is_open
        await looker.press("colon")
        await looker.type("set C1 LocalPort=2600")
        assert "restarts" not in looker.text
        await looker.press("enter")
        assert looker.lines == []


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_each_part_of_each_project_begins_as_it_is(path: Path) -> None:
    project = load_project(path)
    for part in (each for each in all_parts(project) if each.kind != "udt"):  # it has no key but its name
        now = values_of(part, project)
        fields = fields_to_change(part, now, project, format_value(now.get("block", "")))
        assert fields, part
        assert make_set_line(part, now, {field.key: field.first for field in fields}, project) == "", part
