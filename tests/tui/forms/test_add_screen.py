"""Adding to the project on the screen: a form that makes a command, its mistakes, what is not saved yet."""

from __future__ import annotations

import pytest
from textual.widgets import Static

from tests.tui.looking import SMALL, WIDE
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from tests.tui.on_a_line import LineBench, on_a_line
from trcvtui.project.edit import fields_of, propose_name
from trcvtui.project.project import Project
from trcvtui.tui.completion import complete
from trcvtui.tui.forms.add_screen import AddScreen, ChoiceField
from trcvtui.tui.forms.fields import kinds_of, make_add
from trcvtui.tui.forms.messages import UdtForm
from trcvtui.tui.view_model.validity import find_mistake

SIZES = pytest.mark.parametrize("size", [SMALL, (120, 40), WIDE], ids=["80x24", "120x40", "140x45"])


def form_of(looker: BenchLooker) -> AddScreen:
    form = looker.app.screen
    assert isinstance(form, AddScreen)
    return form


def fields(looker: BenchLooker) -> dict[str, ChoiceField]:
    return {field.key: field for field in form_of(looker).query(ChoiceField)}


async def fill(looker: BenchLooker, **texts: str) -> None:
    for key, text in texts.items():
        fields(looker)[key].value = text
    await looker.settle()


@SIZES
async def test_the_form_stands_whole_and_ends_with_its_command(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        await looker.press("A")
        assert "Add an instance" in looker.text
        assert "▸ add instance TRCV_C_3 block=TRCV_C connect=new data=new task=MAIN" in looker.text
        assert "tab field · ↑↓ choose · enter add · esc leave" in looker.text
        await looker.press("escape")
        assert looker.lines == []


async def test_keys_alone_add_a_connection_a_peer_and_an_instance_that_receives() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("A", "shift+tab", "down", "enter")
        assert looker.lines == ["add connect C3 ActiveEstablished=false LocalAddress=127.0.0.1 LocalPort=0"]
        looker.bench.scan()
        await looker.pictures()
        await looker.press("A")
        await fill(looker, inputs="CONT=1 EN_R=1")
        await looker.press("enter")
        looker.bench.scan(3)
        await looker.pictures()
        await looker.press("A")
        await fill(looker, kind="peer")
        await fill(looker, remote="@C3")
        await looker.press("enter")
        assert looker.lines[-1] == "add peer P3 active=true remote=@C3"
        looker.bench.do("peer P3 connect", scans=3)
        looker.bench.do("peer P3 send hex 01 02 03 04 05 06 07 08", scans=2)
        await looker.pictures()
        assert looker.bench.console.bench.runtime.data("rx1")[:8] == bytes(range(1, 9)), "on C3: it was free"
        assert "TRCV_C_3" in looker.text
        assert "+4 unsaved" in looker.text


async def test_a_mistake_stands_below_and_marks_its_field_and_enter_waits() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("A", "shift+tab", "down")
        await fill(looker, LocalPort="70000")
        assert "✗ connect C3: LocalPort: found '70000', expected a whole number from 0" in looker.text
        assert [key for key, field in fields(looker).items() if field.has_class("-bad")] == ["LocalPort"]
        await looker.press("enter")
        assert looker.lines == []
        await fill(looker, LocalPort="2000", name="C1")
        assert "'C1', which a CONNECT already has" in looker.text
        await fill(looker, name="C9")
        await looker.press("enter")
        assert looker.lines == [
            "add connect C9 ActiveEstablished=false LocalAddress=127.0.0.1 LocalPort=2000"
        ]


async def test_up_and_down_walk_through_what_is_known_to_fit() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("A", "tab", "tab")
        assert fields(looker)["connect"].has_focus
        await looker.press("down")
        assert fields(looker)["connect"].value == "C1"
        await looker.press("up", "up")
        assert fields(looker)["connect"].value == "C2"


async def test_in_a_field_without_a_list_they_go_to_the_field_above_or_below() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("A", "down")
        assert fields(looker)["block"].has_focus
        await looker.press("shift+tab", "up")
        assert fields(looker)["kind"].has_focus
    async with on_a_bench(SMALL) as looker:
        await looker.press("7", "o", "down")
        form = looker.app.screen
        assert isinstance(form, UdtForm) and form.focused is form._fields[1]
        await looker.press("up")
        assert form.focused is form._fields[0]


async def test_a_hint_ends_at_a_word() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("A")
        for hint in form_of(looker).query(".hint").results(Static):
            text = str(hint.render())
            assert len(text.splitlines()) == hint.size.height <= 2, f"{text!r} is cut"
            assert "…" not in text or text.endswith(", …")


async def test_what_was_added_is_selected_and_a_key_typed_at_once_is_for_it() -> None:
    async with on_a_bench(SMALL) as looker:
        await looker.press("6", "A", "enter", "t")
        assert len(looker.lines) == 1, "it waits"
        looker.bench.scan(2)
        await looker.pictures()
        await looker.pictures()
        assert looker.lines[1:] == ["set TRCV_C_3 CONT=1"]
        assert looker.app.view_model.selected == "TRCV_C_3"
        assert looker.app.focused is looker.app.main.instances
        await looker.press("space")
        looker.bench.scan()
        await looker.press("A", "enter")
        await looker.pictures()
        assert looker.app.view_model.selected == "TRCV_C_4", "held, too: no key waits for a scan"
        await looker.press("space")
        assert looker.lines[-1] == "go"


async def test_a_composed_message_is_kept_under_a_name_and_sent_from_the_library() -> None:
    async with on_a_bench(WIDE) as looker:
        await looker.press("7", "i")
        await looker.type("01 02")
        await looker.press("escape", "w")
        assert form_of(looker).kind == "message"
        assert fields(looker)["text"].value == "hex 01 02"
        await fill(looker, name="start")
        await looker.press("enter")
        assert looker.lines == ["add message start hex 01 02"]
        await looker.pictures()
        await looker.press("p")
        assert "start" in looker.text
        await looker.press("enter")
        assert looker.lines[-1] == "peer P1 send message start"


async def test_quit_tells_what_would_be_lost_and_again_after_any_other_key_or_addition() -> None:
    async with on_a_bench(SMALL) as looker:
        looker.bench.do("add connect C9")
        await looker.pictures()
        for keys in ("q", "2q"):
            await looker.press(*keys)
            assert "1 addition to the project unsaved" in looker.text
            assert looker.app.return_code is None and looker.app.is_running
        looker.bench.do("add connect C10")
        await looker.pictures()
        await looker.press("q")
        assert "2 additions to the project unsaved" in looker.text
        await looker.press("q")
        assert not looker.app.is_running


async def test_quit_asks_nothing_where_nothing_was_added() -> None:
    async with on_a_bench(SMALL) as looker:
        looker.bench.do("create TRCV_C X connect=C1")
        await looker.pictures()
        await looker.press("q")
        assert not looker.app.is_running


async def test_the_palette_reaches_every_kind() -> None:
    async with on_a_bench(WIDE) as looker:
        titles = {command.title: command for command in looker.app.get_system_commands(looker.app.screen)}
        assert "Save the project" in titles
        titles["Add a peer"].callback()
        await looker.settle()
        assert form_of(looker).kind == "peer"


@pytest.fixture
def project() -> Project:
    from tests.tui.fakes import bench_project

    return bench_project()


@pytest.mark.parametrize("kind", ["instance", "connect", "data", "peer", "udp_config", "addr"])
def test_what_the_form_begins_with_can_be_added_at_once(project: Project, kind: str) -> None:
    texts = {field.key: field.first for field in fields_of(kind, project)}
    line = make_add(kind, propose_name(kind, project), texts, project)
    assert find_mistake(line, project) == ""


def test_every_known_value_fits_its_field(project: Project) -> None:
    for kind in kinds_of(project):
        for field in fields_of(kind, project):
            for choice in field.choices:
                fault = find_mistake(make_add(kind, "N1", {field.key: choice}, project), project)
                assert f"{field.key}: found" not in fault.replace(f"{field.key}: found nothing", "")


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("add", "add"),
        ("add con", "add connect"),
        ("add connect ", "add connect C3"),
        ("add peer P", "add peer P3"),
        ("add peer P3 rem", "add peer P3 remote=@C1"),
        ("add connect C3 Act", "add connect C3 ActiveEstablished=false"),
        ("add instance N block=TRCV_C EN", "add instance N block=TRCV_C EN_R="),
        ("add instance N block=USEND_C con", "add instance N block=USEND_C config=new"),
        ("set instance TRCV_C_1 conn", "set instance TRCV_C_1 connect=C1"),
        ("add data rx2 ARR", "add data rx2 ARRAY[0.."),
        ("add message m t", "add message m text"),
        ("save p", "save project"),
    ],
)  # fmt: skip
def test_the_prompt_completes_it(project: Project, typed: str, completed: str) -> None:
    assert (complete(typed, project) or typed) == completed


# -- blocks on a ComBuffer -----------------------------------------------------------------------------------


def keys_of(shown: LineBench) -> list[str]:
    return [field.key for field in shown.app.screen.query(ChoiceField)][1:]


async def choose(shown: LineBench, key: str, value: str) -> None:
    next(field for field in shown.app.screen.query(ChoiceField) if field.key == key).value = value
    await shown.press()


@SIZES
async def test_the_form_asks_a_receivedata_for_its_combuffer_and_its_marks(size: tuple[int, int]) -> None:
    async with on_a_line(size) as shown:
        await shown.press("A")
        own = ["name", "block", "RxBuffer", "data", "pPrefix", "pSuffix", "task", "inputs"]
        assert keys_of(shown) == own, shown.text
        assert "add instance ReceiveData_1 block=ReceiveData RxBuffer=new data=" in shown.words
        assert "connect=" not in shown.text
        await choose(shown, "pPrefix", "prefix")
        await shown.press("enter")
        shown.driver.scan()
        made = shown.app.view_model.project.instance("ReceiveData_1")
        assert made is not None and made.pointers == ("prefix", "")


async def test_another_block_has_other_fields_and_what_was_typed_stays() -> None:
    async with on_a_line() as shown:
        await shown.press("A")
        await choose(shown, "name", "X")
        await choose(shown, "block", "SendByte")
        assert keys_of(shown) == ["name", "block", "TxBuffer", "task", "inputs"]
        assert "▸ add instance X block=SendByte TxBuffer=new task=MAIN" in shown.words
        assert isinstance(shown.app.screen.focused, ChoiceField) and shown.app.screen.focused.key == "block"
        await choose(shown, "block", "TRCV_C")
        assert keys_of(shown)[:3] == ["name", "block", "connect"]


async def test_the_form_adds_a_combuffer_where_blocks_can_be_on_one() -> None:
    async with on_a_line() as shown:
        project = shown.app.view_model.project
        for field in fields_of("combuffer", project)[1:]:
            others = {} if field.key == "line" else {"source": "serial", "port": "/dev/ttyUSB0"}
            for choice in field.choices:
                assert (
                    find_mistake(make_add("combuffer", "N1", {**others, field.key: choice}, project), project)
                    == ""
                )
        await shown.press("A")
        await choose(shown, "kind", "combuffer")
        assert "▸ add combuffer B1 source=sim" in shown.words
        await choose(shown, "source", "RX")
        await shown.press("enter")
        shown.driver.scan()
        assert [buffer.name for buffer in shown.app.view_model.project.combuffers] == ["RX", "B1"]
    async with on_a_bench(SMALL) as looker:
        assert "combuffer" not in kinds_of(looker.app.view_model.project)
