"""Each class of mistake in a project file: the exact line that the user reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from trcvtui.errors import UserError
from trcvtui.project.file import load_project

ADDRESS = "an IPv4 address, four numbers from 0 to 255"
PORT = "a whole number from 0 to 65535"
UDINT = "a whole number from 0 to 4294967295"
PORT_OR_NAME = "a port from 0 to 65535, or @NAME of a peer or CONNECT"
END_OR_NAME = "an IPv4 address and a port such as 127.0.0.1:2000, or @NAME of a CONNECT"
NAME = "a name of letters, digits and _ that begins with no digit"
INTERVAL = "a duration from T#100us on, such as T#10ms"
DELAY = "a duration from T#0s on, such as T#5ms"
RETRY = "a duration such as T#1s500ms, not negative"

GOOD = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"
[[connect]]
name = "C1"
%CONNECT%
[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
%INSTANCE%
[[peer]]
name = "P1"
active = true
remote = "@C1"
%PEER%
"""


@pytest.fixture(autouse=True)
def _work_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def lines_of(text: str | bytes) -> list[str]:
    Path("b.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(UserError) as caught:
        load_project("b.toml")
    return [str(problem) for problem in caught.value.problems]


def with_line(part: str, line: str) -> str:
    text = GOOD
    for place in ("CONNECT", "INSTANCE", "PEER"):
        text = text.replace(f"%{place}%", line if place == part else "")
    return text


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('LocalAddress = "300.1.1.1"', f"LocalAddress: found '300.1.1.1', expected {ADDRESS}"),
        ('LocalAddress = "127.1"', f"LocalAddress: found '127.1', expected {ADDRESS}"),
        ('LocalAddress = "localhost"', f"LocalAddress: found 'localhost', expected {ADDRESS}"),
        ("LocalAddress = 7", f"LocalAddress: found 7, expected {ADDRESS}"),
        ("LocalPort = 70000", f"LocalPort: found 70000, expected {PORT}"),
        ("LocalPort = -1", f"LocalPort: found -1, expected {PORT}"),
        ('LocalPort = "2000"', f"LocalPort: found '2000', expected {PORT}"),
        ("LocalPort = true", f"LocalPort: found true, expected {PORT}"),
        ("LocalPort = 2000.0", f"LocalPort: found 2000.0, expected {PORT}"),
        ('ActiveEstablished = "yes"', "ActiveEstablished: found 'yes', expected true or false"),
        ("ActiveEstablished = 2", "ActiveEstablished: found 2, expected true or false"),
        ("ActiveEstablished = 1.0", "ActiveEstablished: found 1.0, expected true or false"),
        ("SendDelayOpt = []", "SendDelayOpt: found a list, expected true or false"),
        ("KeepAliveTimeInterval = 65536", f"KeepAliveTimeInterval: found 65536, expected {PORT}"),
        ("RemotePort = 65536", f"RemotePort: found 65536, expected {PORT_OR_NAME}"),
        ('RemotePort = "@P9"', "RemotePort: found 'P9', expected one of P1, C1"),
        ('RemotePort = "P1"', f"RemotePort: found 'P1', expected {PORT_OR_NAME}"),
        ("LocalPrt = 1", "LocalPrt: found an unknown key, expected LocalPort"),
        ("localport = 1", "localport: found an unknown key, expected LocalPort"),
        (
            "colour = 1",
            "colour: found an unknown key, expected one of name, ActiveEstablished, LocalAddress, LocalPort, "
            "RemoteAddress, RemotePort, SendDelayOpt, KeepAliveTimeInterval",
        ),
    ],
)
def test_a_mistake_in_a_connect(line: str, said: str) -> None:
    assert lines_of(with_line("CONNECT", line)) == [f"b.toml: connect C1: {said}"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('task = "FAST"', "task: found 'FAST', expected MAIN"),
        ("LEN = 4294967296", f"LEN: found 4294967296, expected {UDINT}"),
        ("LEN = -1", f"LEN: found -1, expected {UDINT}"),
        ('LEN = "4"', f"LEN: found '4', expected {UDINT}"),
        ("LEN = 0x" + "F" * 40, f"LEN: found a number beyond any range, expected {UDINT}"),
        ('ADHOC = "TRUE"', "ADHOC: found 'TRUE', expected true or false"),
        ("DONE = true", "DONE: found an output, expected an input: EN_R, CONT, LEN, ADHOC, COM_RST"),
        ("EN_r = true", "EN_r: found an unknown key or input pin, expected EN_R"),
        (
            "SPEED = 1",
            "SPEED: found an unknown key or input pin, expected one of name, block, connect, data, "
            "task, EN_R, "
            "CONT, LEN, ADHOC, COM_RST",
        ),
    ],
)
def test_a_mistake_in_an_instance(line: str, said: str) -> None:
    assert lines_of(with_line("INSTANCE", line)) == [f"b.toml: instance TRCV_C_1: {said}"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('block = "TRCV_C"', 'block = "TRCVC"', "instance TRCV_C_1: block: found 'TRCVC', expected TRCV_C"),
        ('block = "TRCV_C"', "", "instance TRCV_C_1: block: found nothing, expected a text in quotes"),
        ('connect = "C1"\n', "", "instance TRCV_C_1: connect: found nothing, expected a text in quotes"),
        ('connect = "C1"', 'connect = "C2"', "instance TRCV_C_1: connect: found 'C2', expected C1"),
        ('data = "rx"', 'data = "ry"', "instance TRCV_C_1: data: found 'ry', expected rx"),
        ('name = "TRCV_C_1"', 'name = "1X"', f"instance #1: name: found '1X', expected {NAME}"),
        ('name = "TRCV_C_1"', "", f"instance #1: name: found nothing, expected {NAME}"),
        (
            'name = "TRCV_C_1"',
            'name = "rx"',
            "instance rx: name: found 'rx', the name of another data, expected a name of its own",
        ),
        (
            'name = "TRCV_C_1"',
            'name = "peer"',
            "instance peer: name: found 'peer', a word of the bench commands, expected a name of its own",
        ),
        (
            'name = "P1"',
            'name = "C1"',
            "peer C1: name: found 'C1', the name of another connect, expected a name of its own",
        ),
        ('type = "ARRAY[0..3] OF BYTE"', "", "data rx: type: found nothing, expected a text in quotes"),
        (
            'type = "ARRAY[0..3] OF BYTE"',
            'type = "ARRAY[0..99999999] OF BYTE"',
            "data rx: type: found 100000000 bytes, expected at most 4194304 bytes",
        ),
        ('remote = "@C1"', "", f"peer P1: remote: found nothing, expected {END_OR_NAME}"),
        (
            'remote = "@C1"',
            'remote = "localhost:1"',
            f"peer P1: remote: found 'localhost:1', expected {END_OR_NAME}",
        ),
        ('remote = "@C1"', 'remote = "@C7"', "peer P1: remote: found 'C7', expected C1"),
        (
            'remote = "@C1"',
            'remote = "127.0.0.1:70000"',
            f"peer P1: remote: found '127.0.0.1:70000', expected {END_OR_NAME}",
        ),
        (
            "active = true",
            "active = false",
            "peer P1: remote: found an address to connect to, expected active = true, or local alone",
        ),
        ('dialect = "baosky"', "", "dialect: found nothing, expected a text in quotes"),
        ('dialect = "baosky"', 'dialect = "boasky"', "dialect: found 'boasky', expected baosky"),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\nmodel = "T5"',
            "model: found 'T5', expected one of T3, T4",
        ),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\nmodle = "T3"',
            "modle: found an unknown key, expected model",
        ),
        ('dialect = "baosky"', 'dialect = "baosky"\nstart = 1', "start: found 1, expected a text in quotes"),
        ('dialect = "baosky"', 'dialect = "baosky"\nsim = 1', "sim: found 1, expected a table [sim]"),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\noptions = []',
            "options: found a list, expected a table [options]",
        ),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\ntask = 1',
            "task: found 1, expected tables that begin with [[task]]",
        ),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\n[task]\nname = "X"',
            "task: found a table, expected tables that begin with [[task]]",
        ),
        (
            'dialect = "baosky"',
            'dialect = "baosky"\n[[udt]]',
            "udt #1: file: found nothing, expected a text in quotes",
        ),
    ],
)
def test_a_mistake_elsewhere(old: str, new: str, said: str) -> None:
    text = with_line("", "").replace(old, new)
    assert lines_of(text) == [f"b.toml: {said}"]


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            '[[task]]\nname = "A"\ninterval = "10ms"',
            f"b.toml: task A: interval: found '10ms', expected {INTERVAL}",
        ),
        (
            '[[task]]\nname = "A"\ninterval = "T#0s"',
            f"b.toml: task A: interval: found 'T#0s', expected {INTERVAL}",
        ),
        ('[[task]]\nname = "A"\ninterval = 10', f"b.toml: task A: interval: found 10, expected {INTERVAL}"),
        (
            '[[task]]\nname = "A"\npriority = 256',
            "b.toml: task A: priority: found 256, expected a whole number from 0 to 255",
        ),
        (
            '[[task]]\nname = "A"\n[[task]]\nname = "A"',
            "b.toml: task A: name: found 'A', the name of another task, expected a name of its own",
        ),
        (
            '[sim]\naddresses = "10.0.0.1"',
            "b.toml: sim: addresses: found '10.0.0.1', expected a list of IPv4 addresses such as "
            '["10.0.0.1"]',
        ),
        ("[sim]\nadresses = []", "b.toml: sim: adresses: found an unknown key, expected addresses"),
        ('[sim]\nlatency = "T#-5ms"', f"b.toml: sim: latency: found 'T#-5ms', expected {DELAY}"),
        (
            '[options]\nnot_connected = "puls"',
            "b.toml: options.not_connected: found 'puls', expected pulse or hold or never",
        ),
        ('[options]\nretry = "1s"', f"b.toml: options.retry: found '1s', expected {RETRY}"),
        (
            '[[data]]\nname = "a"\ntype = "Telegram"',
            "b.toml: data a: type:1:1: found 'Telegram', expected a known type",
        ),
        (
            '[[data]]\nname = "a"\ntype = "INT"\nsize = 3',
            "b.toml: data a: size: found an unknown key, expected one of name, type, "
            "layout, byte_order, text, pointer_size, string_even",
        ),
        (
            '[[udt]]\nfile = "nix.st"\n[[data]]\nname = "a"\ntype = "Telegram"',
            "nix.st: found No such file or directory, expected a file that can be read",
        ),
    ],
)
def test_a_mistake_in_a_table_of_its_own(tables: str, said: str) -> None:
    assert lines_of(f'dialect = "baosky"\n{tables}\n') == [said]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("dialect = \n", "b.toml: line 1, column 11: found no TOML (Invalid value), expected TOML 1.0"),
        (
            'dialect = "a"\n[[connect]]\nname "C1"\n',
            "b.toml: line 3, column 6: found no TOML (Expected '=' after a key in a key/value pair), "
            "expected TOML 1.0",
        ),
        (
            "a = 1\na = 2\n",
            "b.toml: line 2, column 6: found no TOML (Cannot overwrite a value), expected TOML 1.0",
        ),
        ("a = " + "[" * 100_000, "b.toml: found brackets nested too deeply, expected TOML 1.0"),
        (b"# \xff\n\xff", "b.toml: line 1: found byte 16#FF, expected TOML in UTF-8"),
    ],
)
def test_what_is_no_toml_is_named_with_its_place(content: str | bytes, said: str) -> None:
    assert lines_of(content) == [said]


def test_a_file_that_ends_too_early_says_so() -> None:
    (line,) = lines_of('a = """x')  # the rest of the wording is the TOML reader's own
    assert line.startswith("b.toml: end of document: found no TOML (")


def test_a_number_of_5000_digits_is_a_mistake_and_no_crash() -> None:
    (line,) = lines_of("a = " + "9" * 5000)
    assert line.startswith("b.toml: found no TOML (")


@pytest.mark.parametrize("path", ["nix.toml", "."])
def test_a_file_that_cannot_be_read(path: str) -> None:
    with pytest.raises(UserError) as caught:
        load_project(path)
    assert len(caught.value.lines()) == 1
    assert caught.value.lines()[0].endswith("expected a TOML file that can be read")


def test_all_mistakes_are_told_together() -> None:
    text = with_line("CONNECT", 'LocalPort = 70000\nLocalAddress = "x"').replace('"rx"', '"r x"')
    assert (
        lines_of(text)
        == [
            f"b.toml: connect C1: LocalAddress: found 'x', expected {ADDRESS}",
            f"b.toml: connect C1: LocalPort: found 70000, expected {PORT}",
        ]
        or len(lines_of(text)) == 3
    )


def test_a_bad_udt_is_told_once_however_many_variables_have_it() -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : NIX; END_STRUCT END_TYPE")
    data = "".join(f'[[data]]\nname = "d{n}"\ntype = "T"\n' for n in range(3))
    assert lines_of(f'dialect = "baosky"\n[[udt]]\nfile = "t.st"\n{data}') == [
        "t.st:1:21: found 'NIX', expected a known type"
    ]


def test_control_codes_of_a_file_stay_visible_text() -> None:
    (line,) = lines_of(with_line("CONNECT", 'LocalAddress = "\\u001b[31m\\n"'))
    assert "found '\\x1b[31m\\n'" in line and line.isprintable()


@pytest.mark.parametrize(
    ("type_", "said"),
    [
        ("ARRAY[0..999999999] OF BYTE", "type: found 1000000000 bytes, expected at most 4194304 bytes"),
        ("STRING[70000]", "type: found STRING[70000], expected at most 254 characters"),
        ("Long", "type.text: found STRING[300], expected at most 254 characters"),
    ],
)
def test_a_type_that_is_too_large_is_named_with_its_place(type_: str, said: str) -> None:
    udt = "TYPE Long : STRUCT text : STRING[300]; END_STRUCT END_TYPE"
    Path("long.st").write_text(udt, encoding="utf-8")
    files = '[[udt]]\nfile = "long.st"\n'
    assert lines_of(f'dialect = "baosky"\n{files}[[data]]\nname = "rx"\ntype = "{type_}"\n') == [
        f"b.toml: data rx: {said}"
    ]
