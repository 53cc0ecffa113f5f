"""A block is one row: a made-up one works everywhere; no other code knows a block by its name."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.blocks.beacon import BEACON
from tests.dialects.nordwind import NORDWIND
from trcvtui.blocks.table import BLOCKS, BlockRow
from trcvtui.cli.main import main
from trcvtui.dialects import DIALECTS
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.errors import UserError
from trcvtui.history.pin_waveform import Waveform, WaveformCache
from trcvtui.history.waveform_text import row_names
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.edit import fields_of
from trcvtui.project.file import load_project
from trcvtui.project.project import Project
from trcvtui.project.st_call import st_text
from trcvtui.project.text import append_entries
from trcvtui.snapshots.bench import EngineTiming
from trcvtui.tui.completion import complete
from trcvtui.tui.panes.function_block import make_drawing

PACKAGE = Path(__file__).parents[2] / "trcvtui"

FILE = """
dialect = "nordwind"

[[data]]
name = "lamp"
type = "ARRAY[0..3] OF BYTE"

[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"

[[instance]]
name = "B1"
block = "BEACON"
connect = "C1"
data = "lamp"
REQ = true
"""


@pytest.fixture(autouse=True)
def the_one_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the row, and its name to the list of a dialect that offers it and says its STATUS."""
    monkeypatch.setitem(BLOCKS, BEACON.name, BEACON)
    offered = (*NORDWIND.blocks, BEACON.name)
    rows = tuple([replace(row, blocks=offered) for row in NORDWIND.status])
    monkeypatch.setitem(DIALECTS, NORDWIND.name, replace(NORDWIND, blocks=offered, status=rows))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "beacon.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


@pytest.fixture
def project(file: Path) -> Project:
    return load_project(file)


def test_a_project_file_has_it_and_is_written_with_it(project: Project) -> None:
    (beacon,) = project.instances
    assert (beacon.block, beacon.connect, beacon.data, beacon.inputs) == (
        "BEACON", "C1", "lamp", (("REQ", True),)
    )  # fmt: skip
    text = append_entries(FILE, [replace(beacon, name="B2")], "beacon.toml")
    keys = 'name = "B2"\nblock = "BEACON"\nconnect = "C1"\ndata = "lamp"\ntask = "MAIN"\nREQ = true\n'
    assert text.endswith(f"[[instance]]\n{keys}")


def test_a_pin_that_it_does_not_have_is_refused(file: Path) -> None:
    file.write_text(FILE.replace("REQ = true", "EN_R = true\nSEEN = true"), encoding="utf-8")
    with pytest.raises(UserError) as refused:
        load_project(file)
    told = [str(problem) for problem in refused.value.problems]
    assert any("EN_R" in line and "an unknown key" in line for line in told), told
    assert any("SEEN: found an output, expected an input: REQ" in line for line in told), told


def test_its_pins_are_drawn_with_their_letters_and_help(project: Project) -> None:
    drawing = make_drawing(project, "BEACON", "C1")
    assert [(pin.name, pin.letter, pin.text) for pin in drawing.inputs] == [
        ("REQ", "r", "1: the beacon is on")
    ]
    assert [pin.name for pin in drawing.outputs] == ["LIT", "SEEN", "STATUS"]


def test_the_form_offers_it(project: Project) -> None:
    fields = {field.key: field for field in fields_of("instance", project, "BEACON")}
    assert "BEACON" in fields["block"].choices
    assert fields["connect"].choices == ("new", "C1") and fields["data"].choices == ("new", "lamp")


def test_the_prompt_completes_it(project: Project) -> None:
    assert complete("create BEA", project) == "create BEACON"
    assert complete("create BEACON B2 R", project) == "create BEACON B2 REQ="
    assert complete("set B1 R", project) == "set B1 REQ="


def test_its_call_is_written_as_st(project: Project) -> None:
    text = st_text(project, ["B1"])
    assert "B1 : BEACON;" in text
    for line in ("REQ:=TRUE", "CONNECT:=C1", "LAMP:=lamp", "SEEN=>B1_SEEN", "STATUS=>B1_STATUS"):
        assert line in text


def test_it_is_called_and_its_waves_have_its_pins(project: Project) -> None:
    console = Controller(fresh_bench(project, "sim"))
    for scan in range(1, 7):
        if scan == 4:
            console.handle_line(scan, "set B1 REQ=0")
        console.scan()
    picture = console.picture(UpdateRequest(waves=(("B1", 0),)), EngineTiming(), 0)
    shelf = WaveformCache()
    shelf.add_deltas(picture.waves, picture.snapshot.interval_ns)
    wave = shelf.get_wave("B1")
    assert {"REQ", "SEEN", "LIT", "STATUS"} <= set(row_names(wave))
    assert _levels(wave, "SEEN") == [0, 0, 0, 1, 0, 0]
    assert _levels(wave, "LIT") == [1, 1, 1, 0, 0, 0]


def _levels(wave: Waveform, pin: str) -> list[int | None]:
    return [wave.lanes[pin].value_at(scan) for scan in range(1, 7)]


def test_its_status_words_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", "0041", "--block", "beacon", "--dialect", "nordwind"]) == 0
    assert "Sent" in capsys.readouterr().out


# -- the table --------------------------------------------------------------------------------

NAMED = [
    (row, path) for row in BLOCKS.values()
    for path in (row.shared, row.single, row.datagrams, row.on_config, row.serial) if path
]  # fmt: skip


@pytest.mark.parametrize(("row", "path"), NAMED, ids=[f"{row.name}-{path}" for row, path in NAMED])
def test_each_class_that_a_row_names_is_there(row: BlockRow, path: str) -> None:
    module, _, name = path.partition(":")
    assert hasattr(getattr(import_module(module), name), "call")


def test_pins_of_one_name_are_alike_in_every_block() -> None:
    kinds: dict[str, set[tuple[str, str, str]]] = {}
    for row in BLOCKS.values():
        for pin in row.pins:
            kinds.setdefault(pin.name, set()).add((str(pin.direction), pin.iec_type, pin.shows))
    assert {name: found for name, found in kinds.items() if len(found) > 1} == {}


# -- no name of a block outside the table ----------------------------------------------------------


def block_names_in(package: Path) -> Iterator[str]:
    """Yield a line for each text that is the name of a block: where it stands, and what to do."""
    pins = {name for row in BLOCKS.values() for name in (row.data_pin, *(pin.name for pin in row.pins))}
    names = BLOCKS.keys() - pins  # SendByte and SendString are pins, too
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if place.parts[0] == "dialects" or place.as_posix() == "blocks/table.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and node.value in names:
                yield (
                    f"{place}:{node.lineno} names the block {node.value}: ask its row "
                    f"(blocks/table.py, block_row), and give the row what it does not say yet"
                )


def test_no_code_outside_the_table_names_a_block() -> None:
    assert list(block_names_in(PACKAGE)) == []
