"""The exported dissector in a real tshark: the same values as `udt decode`, however TCP cuts the bytes."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path

import pytest

from tests.udt.capture_file import write_capture
from tests.udt.export_types import EVERY_LAYOUT, plant, plant_bytes
from tests.udt.udt_strategies import layout_of, types_of
from trcvtui import clock
from trcvtui.engine.controller import fresh_bench
from trcvtui.errors import UserError
from trcvtui.net.os.kernel import OsKernel
from trcvtui.paths import demo_path
from trcvtui.project.file import load_project
from trcvtui.scenario.command import LivePace
from trcvtui.udt.exports import export
from trcvtui.udt.exports.lua import filter_name
from trcvtui.udt.layout.layout import Layout, Leaf, lay_out, rules_for
from trcvtui.udt.layout.values import decode, encode
from trcvtui.udt.sources import read_files
from trcvtui.udt.types import Member, Pointer, StringType, Struct, ValueKind

PORT = 2000
with_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")


def dissected(layout: Layout, segments: list[bytes], folder: Path) -> list[list[tuple[str, str]]]:
    """Return name and value of every field, for each value that tshark found in the segments."""
    script, capture = folder / "type.lua", folder / "capture.pcap"
    script.write_text(export(layout, "lua", PORT), encoding="utf-8")
    write_capture(capture, segments, PORT)
    command = ["tshark", "-r", str(capture), "-X", f"lua_script:{script}", "-T", "pdml"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "Lua" not in done.stderr, done.stderr
    protocol = filter_name(layout.name)
    return [
        [
            (field.get("name", "").removeprefix(protocol + "."), field.get("show", ""))
            for field in found.iter("field")
            if field.get("name", "").startswith(protocol + ".")
        ]
        for found in ElementTree.fromstring(done.stdout).iter("proto")
        if found.get("name") == protocol
    ]


def assert_same(layout: Layout, shown: list[tuple[str, str]], data: bytes) -> None:
    for leaf, value, (name, text) in zip(layout.leaves(), decode(layout, data), shown, strict=True):
        path = re.sub(r"\[[^\]]*\]", "", leaf.path).replace("größe", "gro_e")
        assert name in (path, path + "_2")
        wanted = digits(value, leaf) if isinstance(value, float) else value
        assert as_decoded(layout, leaf, text) == wanted, leaf.path


def as_decoded(layout: Layout, leaf: Leaf, text: str) -> object:
    """Return what tshark shows of a leaf as `udt decode` has it."""
    if isinstance(leaf.type, StringType):
        return text
    if isinstance(leaf.type, Pointer):
        return f"16#{int(text, 16):0{2 * leaf.size}X}"
    match layout.rules.storage(leaf.type).kind:
        case ValueKind.BOOL:
            return text in ("1", "True")
        case ValueKind.REAL:
            return digits(float(text), leaf)
        case ValueKind.INTEGER | ValueKind.BITS:
            return int(text, 0)
    return text


def digits(value: float, leaf: Leaf) -> str:
    """Return a number with the digits that tshark prints: six of a REAL, fifteen of an LREAL."""
    return f"{value:.{6 if leaf.size == 4 else 15}g}"


@pytest.mark.slow
@with_tshark
@pytest.mark.parametrize(("name", "more"), EVERY_LAYOUT)
def test_tshark_shows_what_udt_decode_shows(name: str, more: dict[str, str], tmp_path: Path) -> None:
    layout = plant(name, **more)
    data = plant_bytes(layout)
    [shown] = dissected(layout, [data], tmp_path)
    assert_same(layout, shown, data)


@with_tshark
def test_what_a_literal_leaves_out_is_beside_it_as_in_udt_decode(tmp_path: Path) -> None:
    layout = layout_of("a : ARRAY[0..2] OF LDATE; s : ARRAY[0..3] OF S5TIME; d : DATE;", "codesys-8")
    days = b"".join(n.to_bytes(8, "little", signed=True) for n in (-1, 86_400 * 10**9, 3_600_000_000_001))
    words = b"".join(n.to_bytes(2, "little") for n in (0x1015, 0x8150, 0x0150, 0x3999))
    data = days + words + (86_401).to_bytes(4, "little") + bytes(4)
    [shown] = dissected(layout, [data], tmp_path)
    assert [value for _, value in shown] == [str(value) for value in decode(layout, data[: layout.size])]


@with_tshark
@pytest.mark.parametrize("form", ["nul", "s7"])
def test_a_string_in_utf_8_is_shown_so(form: str, tmp_path: Path) -> None:
    members = (Member("u", StringType(6, utf8=True)), Member("l", StringType(6)))
    layout = lay_out(Struct("S", members), rules_for("baosky", None, form))
    data = encode(layout, {"u": "€é", "l": "é"})
    [shown] = dissected(layout, [data], tmp_path)
    assert [value for _, value in shown] == ["€é", "é"]


@with_tshark
def test_values_that_tcp_has_cut_and_joined_are_each_found_once(tmp_path: Path) -> None:
    layout = layout_of("id : UDINT; t : TIME; s : STRING[4];")
    values = [bytes([number]) + bytes(7) + b"\x04\x02ok\0\0" + bytes(2) for number in range(1, 6)]
    assert {len(value) for value in values} == {layout.size}
    stream = b"".join(values)
    cuts = [0, 1, 10, 36, 50, 79, len(stream)]
    found = dissected(layout, [stream[a:b] for a, b in pairwise(cuts)], tmp_path)
    assert found == [[("id", str(n)), ("t", "T#0ms"), ("s", "ok")] for n in range(1, 6)]


@pytest.mark.slow
@with_tshark
def test_the_demo_s_traffic_on_loopback_reads_in_tshark_as_in_udt_decode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = demo_layout()
    segments = demo_traffic(monkeypatch, 4 * layout.size)
    stream = b"".join(segments)
    assert len(segments) > 4, "the demo cuts some of its telegrams"
    found = dissected(layout, segments, tmp_path)
    assert [dict(shown)["tag"] for shown in found[:4]] == ["LINE-1", "LINE-1", "LINE-1", "JAM"]
    for number, shown in enumerate(found):
        assert_same(layout, shown, stream[number * layout.size :])


def demo_layout() -> Layout:
    types = read_files([demo_path().parent / "telegram.st"])
    return lay_out(types.get_type("Telegram"), rules_for(), "Telegram")


def demo_traffic(monkeypatch: pytest.MonkeyPatch, least: int) -> list[bytes]:
    """Run the demo on real sockets and return what its first TRCV_C received, recv for recv."""
    received: dict[object, list[bytes]] = {}
    recv = OsKernel.recv

    def recording(kernel: OsKernel, handle: object, into: memoryview) -> object:
        taken = recv(kernel, handle, into)  # type: ignore[arg-type]
        if isinstance(taken, int) and taken:
            received.setdefault(handle, []).append(bytes(into[:taken]))
        return taken

    monkeypatch.setattr(OsKernel, "recv", recording)
    bench, pace = fresh_bench(load_project(demo_path()), "live"), LivePace()
    end = clock.now_ns() + 20_000_000_000
    telegrams: list[bytes] = []
    while sum(map(len, telegrams)) < least and clock.now_ns() < end:
        pace.next_scan(bench)
        telegrams = next((found for found in received.values() if found[0][:4] == b"\1\0\0\0"), [])
    bench.close()
    return telegrams


def test_without_a_port_the_dissector_waits_for_decode_as() -> None:
    text = export(layout_of("a : INT;"), "lua")
    assert 'DissectorTable.get("tcp.port"):add_for_decode_as(proto)' in text
    assert 'DissectorTable.get("tcp.port"):add(2000, proto)' in export(layout_of("a : INT;"), "lua", 2000)


def test_an_array_is_one_line_however_long_it_is() -> None:
    short, long = (export(layout_of(f"a : ARRAY[1..{n}] OF DINT;"), "lua") for n in (2, 60_000))
    assert short.count("\n") == long.count("\n")


def test_a_type_with_too_many_members_is_refused_in_one_line() -> None:
    source = "TYPE T0 : STRUCT a : BYTE; b : BYTE; END_STRUCT END_TYPE\n"
    for n in range(1, 15):
        source += f"TYPE T{n} : STRUCT a : T{n - 1}; b : T{n - 1}; END_STRUCT END_TYPE\n"
    layout = lay_out(types_of(source).get_type("T14"), rules_for("packed"))
    with pytest.raises(UserError, match="T14: found 32768 members, expected at most 20000"):
        export(layout, "lua")


def test_a_type_without_a_value_is_refused_in_one_line() -> None:
    layout = lay_out(types_of("TYPE T : STRUCT END_STRUCT END_TYPE").get_type("T"), rules_for())
    with pytest.raises(UserError, match="T: found a type without a value"):
        export(layout, "lua")
