"""From a file to its types: suffix, text encoding, and files that cannot be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import golden
from trcvtui.capture.pcap import open_capture
from trcvtui.errors import UserError
from trcvtui.udt.sources import FORMATS, LARGEST_FILE, decode_text, extensions, read_files
from trcvtui.udt.types import ELEMENTARY, Struct

DATA = Path(__file__).parent / "data"


def line_of(path: Path) -> str:
    with pytest.raises(UserError) as refused:
        read_files([path])
    (line,) = refused.value.lines()
    return line.replace(str(path), "FILE")


def test_windows_1252_with_cr_lf_is_read() -> None:
    type_ = read_files([DATA / "windows_1252.st"]).get_type("Tür")
    assert isinstance(type_, Struct)
    assert [(m.name, m.type) for m in type_.members] == [("höhe", ELEMENTARY["INT"])]


@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_text_comes_back_from_every_encoding_it_may_have(codec: str) -> None:
    assert decode_text("TYPE Tür : INT;".encode(codec)) == "TYPE Tür : INT;"


def test_no_bytes_are_refused_as_text() -> None:
    for data in (bytes(range(256)), b"\xff\xfe\x00", b"\xfe\xff\xd8", b"\xef\xbb\xbf\xff"):
        assert isinstance(decode_text(data), str)


def test_a_byte_order_mark_is_no_text() -> None:
    assert read_files([DATA / "with_mark.st"]).names() == ["Motor"]


@pytest.mark.parametrize("suffix", [*FORMATS["IEC text"].extensions, ".ST"])
def test_the_suffix_chooses_the_reader(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"a{suffix}"
    file.write_text("TYPE A : INT; END_TYPE")
    assert read_files([str(file)]).names() == ["A"]


def test_what_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.docx").write_text("")
    (tmp_path / "dir.st").mkdir()
    with open(tmp_path / "big.st", "wb") as big:
        big.truncate(LARGEST_FILE + 1)
    assert line_of(tmp_path / "a.docx") == "FILE: found suffix '.docx', expected a file of type " + ", ".join(
        extensions()
    )
    assert (
        line_of(tmp_path / "no.st")
        == "FILE: found 'No such file or directory', expected a file that can be read"
    )
    assert line_of(tmp_path / "dir.st") == "FILE: found a folder, expected a file that can be read"
    assert line_of(tmp_path / "big.st").startswith(
        "FILE: found a larger file, expected at most 10485760 bytes"
    )
    with pytest.raises(UserError, match="embedded null"):
        read_files(["a\0.st"])


OTHERS = {
    "a.L5X": '<?xml version="1.0"?>\n<RSLogix5000Content SchemaRevision="1.0">',
    "a.L5K": "(*****\n  Exported\n*****)\nIE_VER := 2.11;\nCONTROLLER Own",
    "rockwell.xml": "<RSLogix5000Content>",
    "a.xdd": "<DDTExchangeFile>",
    "device.xdd": '<ISO15745ProfileContainer xmlns="x">',
    "a.xef": "<FEFExchangeFile>",
    "omron.xml": '<Project xmlns:smcext="https://www.ia.omron.com/Smc">',
    "a.smc2": "PK\3\4\0",
    "a.project": "PK\3\4\0",
    "a.export": "<ExportFile>",
    "a.zap13": "PK\3\4\0",
    "a.zip": "PK\3\4\0",
    "a.TcPOU": '<TcPlcObject Version="1.1">\n  <POU Name="P">',
    "pou.TcDUT": '<TcPlcObject Version="1.1">\n  <POU Name="P">',
    "empty.L5X": "",
    "snoop.txt": "snoop\0\0\0\0\0\0\2",
}


def test_files_of_others_are_named_as_types_and_as_captures_and_are_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = []
    for name, content in OTHERS.items():
        for codec in ("utf-8", "utf-16") if name.endswith(".xml") else ("utf-8",):
            Path(name).write_bytes(content.encode(codec))
            with pytest.raises(UserError) as refused:
                read_files([name])
        with pytest.raises(UserError) as as_capture, open_capture(name):
            pass
        said += [(f"file: {name}", [*refused.value.lines(), *as_capture.value.lines()])]
    golden.agree("file_mistakes", "files of others", said)


def test_several_files_are_read_as_one_set(tmp_path: Path) -> None:
    (tmp_path / "a.st").write_text("TYPE A : STRUCT b : B; END_STRUCT END_TYPE (* as <RSLogix5000Content> *)")
    (tmp_path / "b.st").write_text("TYPE B : INT; END_TYPE")
    assert read_files([tmp_path / "a.st", tmp_path / "b.st"]).names() == ["A", "B"]
    with pytest.raises(UserError) as refused:
        read_files([tmp_path / "c.st", tmp_path / "a.st", tmp_path / "d.st"])
    assert len(refused.value.lines()) == 2


@pytest.mark.parametrize("codec", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark_is_answered_with_a_word_about_the_encoding(
    codec: str, tmp_path: Path
) -> None:
    path = tmp_path / "t.st"
    path.write_bytes("TYPE T : INT; END_TYPE".encode(codec))
    with pytest.raises(UserError, match="NUL bytes, as in binary data or UTF-16 without a byte order mark"):
        read_files([path])
