"""`add udt FILE`: one more file of types while the bench runs; taken back, saved, recorded, read again."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.engine.test_project_save import answer, driven, say
from tests.local_driver import LocalDriver
from tests.replay.journals import again, on_the_screen
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import PeerSend
from trcvtui.errors import UserError
from trcvtui.net.results import Endpoint
from trcvtui.project.file import load_project
from trcvtui.project.project import PeerDecl, Project
from trcvtui.replay.command import find_difference
from trcvtui.scenario.scenario import load_scenario

PROJECT = """dialect = "baosky"
[[udt]]
file = "t.st"
[[data]]
name = "rx"
type = "T"
"""
EMPTY = 'dialect = "baosky"\n[[data]]\nname = "rx"\ntype = "INT"\n'
TYPES = "TYPE T : STRUCT a : INT; END_STRUCT END_TYPE\n"
ORDER = "TYPE Order : STRUCT id : DINT; t : T; END_STRUCT END_TYPE\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a project with one type, and a file with one more that has it."""
    (tmp_path / "p.toml").write_text(PROJECT, encoding="utf-8")
    (tmp_path / "t.st").write_text(TYPES, encoding="utf-8")
    (tmp_path / "order.st").write_text(ORDER, encoding="utf-8")
    return tmp_path


@pytest.fixture
def driver(folder: Path) -> Iterator[LocalDriver]:
    yield from driven(folder / "p.toml")


def names(driver: LocalDriver) -> list[str]:
    return driver.console.bench.project.types.names()


def test_a_file_is_added_told_used_saved_and_there_again(driver: LocalDriver, folder: Path) -> None:
    told = answer(driver, "add udt order.st")
    assert "1 type, here baosky" in told and "Order 8 bytes" in told
    assert answer(driver, "set data rx type=Order").startswith("DATA variable rx: type T before, Order now")
    picture = say(driver, "save project")
    assert picture.answers[-1].error == "" and picture.unsaved == 0
    saved = load_project(folder / "p.toml")
    assert [each.name for each in saved.udts] == ["t.st", "order.st"]
    assert (saved.data[0].type_name, saved.data[0].size) == ("Order", 8)


def test_undo_takes_the_row_back_and_not_the_file(driver: LocalDriver, folder: Path) -> None:
    say(driver, "add udt order.st", "undo")
    assert names(driver) == ["T"] and (folder / "order.st").exists()
    assert say(driver).unsaved == 0


def test_a_type_that_data_has_is_not_taken_away(driver: LocalDriver) -> None:
    said = say(driver, "add udt order.st", "add data more Order", "remove udt order.st").answers
    assert "in use by DATA variable more" in said[-1].error and "\n" not in said[-1].error
    assert names(driver) == ["T", "Order"]
    assert "in use by DATA variable rx" in answer(driver, "remove udt t.st")


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("gone.st", None, "gone.st: found 'No such file or directory'"),
        ("bad.st", "TYPE B : STRUCT x : NOBODY; END_STRUCT END_TYPE", "bad.st:1:21: found 'NOBODY'"),
        ("bad.st", "hello", "bad.st:1:1: found 'hello'"),
        ("none.st", "", "none.st: found no type"),
        ("other.st", TYPES, "other.st:1:6: found 'T' a second time"),
        ("folder.st", os.mkdir, "folder.st: found a folder"),
        ("fifo.st", os.mkfifo, "fifo.st: found a FIFO"),
        ("huge.st", lambda path: os.truncate(path, 1 << 30), "huge.st: found a larger file"),
        ("t.toml", TYPES, "suffix '.toml'"),
    ],
)
def test_what_has_no_type_for_the_project_is_refused(
    driver: LocalDriver, folder: Path, name: str, text: object, found: str
) -> None:
    types = driver.console.bench.project.types
    if isinstance(text, str):
        (folder / name).write_text(text, encoding="utf-8")
    elif callable(text):
        if name == "huge.st":
            (folder / name).touch()
        text(folder / name)
    (said,) = say(driver, f"add udt {name}").answers
    assert found in said.error and "\n" not in said.error
    assert driver.console.bench.project.types is types


def test_200_types_are_told_in_some_lines_and_one_that_is_too_large_is_named(
    driver: LocalDriver, folder: Path
) -> None:
    many = "".join(f"TYPE M{n} : STRUCT a : INT; END_STRUCT END_TYPE\n" for n in range(199))
    large = "TYPE Large : ARRAY[0..9999999] OF BYTE; END_TYPE\n"
    (folder / "many.st").write_text(large + many, encoding="utf-8")
    told = answer(driver, "add udt many.st").splitlines()
    assert told[0].startswith("200 types") and told[-1] == "and 192 more"
    assert told[1].startswith("Large: found 10000000")
    assert "10000000" in answer(driver, "add data l Large")


def test_a_file_of_another_folder_is_named_from_that_of_the_project(
    driver: LocalDriver, folder: Path
) -> None:
    (folder / "far").mkdir()
    (folder / "order.st").rename(folder / "far" / "an order.st")
    say(driver, f'add udt "{folder}/far/an order.st"')
    assert [each.name for each in driver.console.bench.project.udts] == ["t.st", "far/an order.st"]
    other = folder / "far" / "o.toml"
    assert say(driver, f"save project {other}").answers[-1].error == ""
    assert [each.name for each in load_project(other).udts] == ["../t.st", "an order.st"]
    say(driver, "undo")
    assert names(driver) == ["T"]


def test_a_file_is_added_once_by_whatever_name(driver: LocalDriver, folder: Path) -> None:
    (folder / "a b").mkdir()
    say(driver, "add udt order.st")
    for name in ("order.st", "./order.st", "a b/../order.st", f"{folder}/order.st"):
        assert "'order.st', which a UDT file already has" in answer(driver, f"add udt {name}")
    assert say(driver).unsaved == 1


def test_a_name_with_blanks_needs_no_quotes(driver: LocalDriver, folder: Path) -> None:
    (folder / "an order.st").write_text(ORDER, encoding="utf-8")
    say(driver, "add udt an order.st")
    assert names(driver) == ["T", "Order"]
    assert answer(driver, "remove udt an order.st") == "UDT file an order.st is removed"


def test_a_row_that_was_removed_does_not_come_back_with_a_reload(driver: LocalDriver, folder: Path) -> None:
    say(driver, "remove data rx", "remove udt t.st", "udt reload")
    assert names(driver) == [] and say(driver).unsaved == 2
    assert answer(driver, "undo") == "taken back: UDT file t.st is added"


def test_rows_that_were_written_by_hand_come_with_a_reload_and_stand_once(
    driver: LocalDriver, folder: Path
) -> None:
    say(driver, "add message hi hex 01")
    with (folder / "p.toml").open("a", encoding="utf-8") as file:
        file.write('[[udt]]\nfile = "order.st"\n')
    assert answer(driver, "udt reload").startswith("2 types read")
    assert names(driver) == ["T", "Order"] and say(driver).unsaved == 1
    assert say(driver, "save project").answers[-1].error == ""
    assert (folder / "p.toml").read_text(encoding="utf-8").count("order.st") == 1


def test_a_row_of_no_file_is_a_mistake_of_a_reload(driver: LocalDriver, folder: Path) -> None:
    (folder / "p.toml").write_text(PROJECT + '[[udt]]\nfile = "gone.st"\n', encoding="utf-8")
    assert "gone.st: found 'No such file" in answer(driver, "udt reload")
    (folder / "p.toml").write_text(PROJECT + '[[udt]]\nfile = "t.st"\n', encoding="utf-8")
    assert "'t.st', which a UDT file already has" in answer(driver, "udt reload")
    (folder / "p.toml").unlink()
    assert answer(driver, "udt reload").startswith("1 type read")


def test_without_a_file_the_mistake_says_how_one_comes(folder: Path) -> None:
    (folder / "p.toml").write_text(EMPTY, encoding="utf-8")
    for driver in driven(folder / "p.toml"):
        for line in ("set data rx type=Order", "add data more Order", "resize rx Order"):
            assert "no UDT file in this project: A adds one" in answer(driver, line)
        say(driver, "add udt t.st")
        assert "A adds one" not in answer(driver, "set data rx type=Order")


def test_a_session_with_a_file_is_saved_as_a_scenario_that_stands_elsewhere(
    driver: LocalDriver, folder: Path
) -> None:
    (folder / "far").mkdir()
    say(driver, "add udt order.st", "add data more Order", f"save scenario {folder}/far/s.toml")
    steps = [step.line for step in load_scenario(folder / "far" / "s.toml").steps]
    assert "add udt ../order.st" in steps


def test_a_recorded_run_is_done_again_without_the_files(folder: Path) -> None:
    lines = "add udt order.st\nadd data more Order\nudt reload\nremove data more\nundo\nremove udt t.st\nundo"
    bench, entries = on_the_screen(folder / "p.toml", lines)
    shutil.rmtree(folder)
    run = again(entries)
    assert find_difference(run) == ""
    project = run.bench.project
    assert project.types.names() == bench.project.types.names() == ["T", "Order"]
    assert [each.size for each in project.data] == [each.size for each in bench.project.data]


@pytest.mark.parametrize("dialect", ["baosky", "s7-1500", "twincat"])
def test_a_job_that_runs_takes_the_type_as_a_resize_and_no_connection_ends(
    folder: Path, dialect: str
) -> None:
    (folder / "p.toml").write_text(
        PROJECT.replace("baosky", dialect)
        + '[[connect]]\nname = "C1"\nLocalAddress = "127.0.0.1"\nLocalPort = 2000\n'
        + '[[instance]]\nname = "R"\nblock = "TRCV_C"\nconnect = "C1"\ndata = "rx"\nCONT = true\n'
        + '[[peer]]\nname = "P"\nremote = "@C1"\n',
        encoding="utf-8",
    )
    seen = []
    for change in ("set data rx type=Order", "resize rx Order"):
        for driver in driven(folder / "p.toml"):
            say(driver, "add udt order.st", "", "", "peer P connect", "", "", "set R EN_R=1", "")
            say(
                driver,
                "peer P send hex 01",
                "",
                change,
                "",
                "peer P send hex 02 03 04 05 06 07 08",
                "",
                "",
                "",
            )
            bench = driver.console.bench
            seen.append(
                (bench.runtime.data("rx"), bench.runtime.instance_snapshot("R"), bench.peers["P"].snapshot())
            )
    assert seen[0] == seen[1]
    assert seen[0][2].state == "connected"


@pytest.mark.parametrize(
    ("udt", "sent"),
    [
        (
            "STRUCT a : INT; s : STRUCT b : BYTE; END_STRUCT; END_STRUCT {a=1, s={b=2}}",
            "01 00 00 00 02 00 00 00",
        ),
        ("struct a : T; end_struct; {a={a=3}}", "03 00 00 00"),
        ("STRUCT END_STRUCT {}", "found"),
        ("STRUCT a : INT {a=1}", "expected STRUCT a : INT; END_STRUCT {a=1}"),
        ("STRUCT a : NOBODY; END_STRUCT {a=1}", "found 'NOBODY', expected a known type"),
    ],
)
def test_a_peer_sends_a_struct_that_stands_in_its_line(driver: LocalDriver, udt: str, sent: str) -> None:
    try:
        command = parse_line(f"peer P send udt {udt}", with_peer(driver.console.bench.project), "prompt")
    except UserError as refused:
        assert sent in refused.lines()[0]
    else:
        assert isinstance(command, PeerSend) and command.payload.hex(" ") == sent


def with_peer(project: Project) -> Project:
    return replace(project, peers=(PeerDecl("P", False, Endpoint("127.0.0.1", 0)),))
