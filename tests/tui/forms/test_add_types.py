"""A file of types, and a pasted STRUCT, in the form: what is in it is seen before enter."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.widgets import Input, Static

from tests.tui.looking import SMALL
from tests.tui.stage import Stage, on_stage
from trcvtui.paths import demo_path
from trcvtui.project.file import load_project
from trcvtui.tui.completion import complete
from trcvtui.tui.forms.add_screen import AddScreen
from trcvtui.tui.forms.pasted_type import MOST_CHARS

SIZES = pytest.mark.parametrize("size", [SMALL, (100, 30)], ids=["80x24", "100x30"])
PROJECT = """dialect = "baosky"
[[data]]
name = "rx1"
type = "INT"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[instance]]
name = "R"
block = "TRCV_C"
connect = "C1"
data = "rx1"
CONT = true
[[peer]]
name = "P"
remote = "@C1"
"""
ORDER = (
    "TYPE Order :\r\nSTRUCT\r\n  id : DINT; // [b]no[/b]\r\n  weight : REAL;\r\nEND_STRUCT\r\nEND_TYPE\r\n"
)


@asynccontextmanager
async def form_of_types(path: Path, size: tuple[int, int] = SMALL) -> AsyncIterator[Stage]:
    async with on_stage(Stage, load_project(path), size) as stage:
        await stage.scan(3)
        stage.app.action_add("udt")
        await stage.press()
        yield stage


def said(stage: Stage) -> str:
    return str(stage.app.screen.query_one("#form-line", Static).content)


def name(stage: Stage) -> str:
    form = stage.app.screen
    assert isinstance(form, AddScreen)
    return form.name_of_part


async def paste(stage: Stage, text: str) -> None:
    stage.app.post_message(events.Paste(text))
    await stage.press()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "p.toml").write_text(PROJECT, encoding="utf-8")
    return tmp_path / "p.toml"


@SIZES
async def test_a_file_is_completed_shown_added_and_its_members_come_with_the_next_message(
    path: Path, size: tuple[int, int]
) -> None:
    (path.parent / "types").mkdir()
    (path.parent / "types" / "order.st").write_text(ORDER, encoding="utf-8")
    async with form_of_types(path, size) as stage:
        await stage.press(*"ty", "tab", "tab")
        assert name(stage) == "types/order.st"
        assert "1 type, here baosky little" in said(stage) and "Order 8 bytes" in said(stage)
        await stage.press("enter")
        await stage.scan(5)
        for line in ("set data rx1 type=Order", "peer P connect", "set R EN_R=1"):
            await stage.do(line, scans=5)
        await stage.do("peer P send hex 07 00 00 00 00 00 20 41", scans=5)
        await stage.press("6")
        assert "weight" in stage.text and "10.0" in stage.text


@SIZES
async def test_a_struct_that_is_pasted_becomes_a_file_beside_the_project_with_enter(
    path: Path, size: tuple[int, int]
) -> None:
    (path.parent / "Order.st").write_text("mine", encoding="utf-8")
    async with form_of_types(path, size) as stage:
        await stage.press(*"old")
        await paste(stage, ORDER)
        assert name(stage) == "Order2.st" and "Order 8 bytes" in said(stage)
        assert sorted(each.name for each in path.parent.iterdir()) == ["Order.st", "p.toml"]
        await stage.press("enter")
        await stage.scan(3)
        assert stage.app.view_model.project.types.names() == ["Order"]
    assert (path.parent / "Order.st").read_text(encoding="utf-8") == "mine"
    assert (path.parent / "Order2.st").read_text(encoding="utf-8") == ORDER.replace("\r\n", "\n")


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        (ORDER.replace("REAL", "NOBODY"), "found 'NOBODY'"),
        (ORDER.replace("id", "\x1b[31m"), r"found \x1b in it"),
        (ORDER + " " * MOST_CHARS, f"at most {MOST_CHARS} characters"),
        ("STRUCT\nhello", "✗"),
    ],
)
async def test_a_bad_paste_is_one_mistake_and_enter_writes_nothing(path: Path, text: str, wrong: str) -> None:
    async with form_of_types(path) as stage:
        await paste(stage, text)
        assert wrong in said(stage) and "✗" in said(stage)
        await stage.press("enter")
        assert isinstance(stage.app.screen, AddScreen)
    assert [each.name for each in path.parent.iterdir()] == ["p.toml"]


async def test_a_struct_without_a_name_is_called_as_its_file(path: Path) -> None:
    async with form_of_types(path) as stage:
        await paste(stage, "STRUCT a : INT; END_STRUCT")
        assert name(stage) == "Pasted.st" and "Pasted 4 bytes" in said(stage)


async def test_beside_the_demo_nothing_is_written(path: Path) -> None:
    before = sorted(demo_path().parent.iterdir())
    async with form_of_types(demo_path()) as stage:
        await paste(stage, ORDER)
        assert "which came with trcvtui" in said(stage)
        await stage.press("enter")
        assert isinstance(stage.app.screen, AddScreen)
    assert sorted(demo_path().parent.iterdir()) == before


async def test_a_file_that_goes_between_look_and_enter_is_a_mistake(path: Path) -> None:
    (path.parent / "order.st").write_text(ORDER, encoding="utf-8")
    async with form_of_types(path) as stage:
        await stage.press("down")
        assert "Order 8 bytes" in said(stage)
        (path.parent / "order.st").unlink()
        await stage.press("enter")
        assert "No such file or directory" in said(stage)


async def test_a_struct_goes_into_the_payload_of_a_peer_whole(path: Path) -> None:
    async with on_stage(Stage, load_project(path), (140, 45)) as stage:
        await stage.scan(3)
        await stage.press("7", "m", "escape", "m")
        await paste(stage, "STRUCT\n  a : INT; // first\nEND_STRUCT {a=1}")
        assert stage.app.screen.query_one("#payload", Input).value == "STRUCT a : INT; END_STRUCT {a=1}"
        assert stage.app.main.peer.composer.fault == ""


def test_paths_and_types_are_completed(path: Path) -> None:
    for folder in ("types", "my types"):
        (path.parent / folder).mkdir()
        (path.parent / folder / "order.st").write_text(ORDER, encoding="utf-8")
    (path.parent / "notes.md").write_text("", encoding="utf-8")
    path.write_text(PROJECT + '[[udt]]\nfile = "types/order.st"\n', encoding="utf-8")
    known = load_project(path)
    for typed, whole in (
        ("add udt t", "add udt types/"),
        ("add udt types/o", "add udt types/order.st"),
        ("udt open types/", "udt open types/order.st"),
        ("add udt my t", "add udt my types/"),
        ("add udt my types/", "add udt my types/order.st"),
        ("add udt n", None),
        ("set data rx1 type=O", "set data rx1 type=Order"),
        ("set rx1 O", "set rx1 Order"),
        ("add data rx2 O", "add data rx2 Order"),
        ("resize rx1 O", "resize rx1 Order"),
    ):
        assert complete(typed, known) == whole


async def test_no_other_field_takes_a_struct_for_a_file(path: Path) -> None:
    async with on_stage(Stage, load_project(path), SMALL) as stage:
        await stage.scan(3)
        stage.app.action_add("certificate")
        await stage.press("tab")
        await paste(stage, ORDER)
        form = stage.app.screen
        assert isinstance(form, AddScreen)
        assert form.line.startswith("add certificate 1 file=TYPE Order :")
