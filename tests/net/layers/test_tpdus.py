"""ISO-on-TCP TPDUs: vectors both ways, every cut, and bytes that nobody should send."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.net.layers.iso_on_tcp import (
    Code,
    ConnectTpdu,
    DataTpdu,
    DisconnectTpdu,
    ErrorTpdu,
    MalformedTpdu,
    TpktReader,
    UnusedTpdu,
    encode_message,
    encode_tpdu,
)

E001, E002 = b"\xe0\x01", b"\xe0\x02"
Written = ConnectTpdu | DataTpdu | DisconnectTpdu | ErrorTpdu
VECTORS: dict[str, tuple[str, Written]] = {
    "CR in the order C1, C2, C0": (
        "03 00 00 16 11 e0 00 00 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 0a",
        ConnectTpdu(Code.CR, 0, 1, E001, E002, 10),
    ),
    "DT abc": ("03 00 00 0a 02 f0 80 61 62 63", DataTpdu(b"abc", True)),
    "DT ab, more follows": ("03 00 00 09 02 f0 00 61 62", DataTpdu(b"ab", False)),
    "DT empty": ("03 00 00 07 02 f0 80", DataTpdu(b"", True)),
    "DR refuse": ("03 00 00 0b 06 80 44 31 00 00 03", DisconnectTpdu(0x4431, 0, 3)),
    "DR normal": ("03 00 00 0b 06 80 00 05 44 31 80", DisconnectTpdu(5, 0x4431, 0x80)),
    "ER bad type": ("03 00 00 09 04 70 00 05 02", ErrorTpdu(5, 2)),
}
READ_ONLY = {
    "CR in the order C0, C1, C2": (
        "03 00 00 16 11 e0 00 00 00 01 00 c0 01 0a c1 02 e0 01 c2 02 e0 02",
        ConnectTpdu(Code.CR, 0, 1, E001, E002, 10),
    ),
    "CR with text TSAPs": (
        "03 00 00 1c 17 e0 00 00 44 31 00 c0 01 0a c1 05 54 43 50 2d 31 c2 05 54 43 50 2d 32",
        ConnectTpdu(Code.CR, 0, 0x4431, b"TCP-1", b"TCP-2", 10),
    ),
    "CC to it": (
        "03 00 00 1c 17 d0 44 31 00 05 00 c0 01 0a c1 05 54 43 50 2d 31 c2 05 54 43 50 2d 32",
        ConnectTpdu(Code.CC, 0x4431, 5, b"TCP-1", b"TCP-2", 10),
    ),
    "CR without parameters": ("03 00 00 0b 06 e0 00 00 00 01 00", ConnectTpdu(Code.CR, 0, 1)),
    "CR of class 4": ("03 00 00 0b 06 e0 00 00 00 01 40", ConnectTpdu(Code.CR, 0, 1)),
    "CR of class 2": ("03 00 00 0b 06 e0 00 00 00 01 20", ConnectTpdu(Code.CR, 0, 1, other_class=2)),
    "CR with a parameter that nobody knows": (
        "03 00 00 0f 0a e0 00 00 00 01 00 c4 02 01 02",
        ConnectTpdu(Code.CR, 0, 1),
    ),
    "DC": ("03 00 00 0a 05 c0 00 01 00 02", UnusedTpdu(0xC0)),
}
MALFORMED = {
    "TPKT version 4": "04 00 00 07 02 f0 80",
    "a TPKT of 6 bytes": "03 00 00 06 01 f0",
    "length indicator 0 in a TPDU of 3 bytes": "03 00 00 07 00 f0 80",
    "length indicator 9 in a TPDU of 3 bytes": "03 00 00 07 09 f0 80",
    "length indicator 255 in a TPDU of 3 bytes": "03 00 00 07 ff f0 80",
    "a CR of 4 bytes": "03 00 00 09 04 e0 00 00 00",
    "parameters of a CR that run over its end": "03 00 00 0e 09 e0 00 00 00 01 00 c1 02 e0",
    "a DR of 3 bytes": "03 00 00 08 03 80 00 05",
    "an ER of 2 bytes": "03 00 00 07 02 70 00",
}


def read(data: bytes) -> list[object]:
    return list(TpktReader().feed(data))


@pytest.mark.parametrize("name", [*VECTORS, *READ_ONLY])
def test_a_vector_is_read(name: str) -> None:
    text, value = (VECTORS | READ_ONLY)[name]
    assert read(bytes.fromhex(text)) == [value]


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_is_written(name: str) -> None:
    text, value = VECTORS[name]
    assert encode_tpdu(value).hex(" ") == text


@pytest.mark.parametrize("what", MALFORMED)
def test_what_cannot_be_read_is_named(what: str) -> None:
    assert read(bytes.fromhex(MALFORMED[what])) == [MalformedTpdu(what)]


def test_after_what_cannot_be_read_nothing_more_is_read() -> None:
    reader = TpktReader()
    assert reader.feed(b"\x04\0\0\x07") == [MalformedTpdu("TPKT version 4")]
    assert reader.feed(bytes.fromhex(VECTORS["DT abc"][0])) == []
    assert reader.held_bytes == 0


@pytest.mark.parametrize("cut", range(1, 22))
def test_a_tpdu_that_comes_in_two_pieces_is_the_same(cut: int) -> None:
    data, value = (
        bytes.fromhex(READ_ONLY["CR in the order C0, C1, C2"][0]),
        ConnectTpdu(Code.CR, 0, 1, E001, E002, 10),
    )
    reader = TpktReader()
    assert reader.feed(data[:cut]) == []
    assert reader.feed(data[cut:]) == [value]


@pytest.mark.parametrize(
    ("most", "size", "pieces"),
    [
        (1021, 8192, 9),
        (1021, 65536, 65),
        (125, 8192, 66),
        (125, 65536, 525),
        (2045, 8192, 5),
        (2045, 65536, 33),
    ],
)
def test_a_message_is_cut_into_as_many_dts_as_the_size_allows(most: int, size: int, pieces: int) -> None:
    found = read(encode_message(bytes(size), most))
    assert len(found) == pieces
    assert [piece.is_last for piece in found if isinstance(piece, DataTpdu)] == [False] * (pieces - 1) + [
        True
    ]


@given(st.binary(max_size=300), st.lists(st.integers(0, 300), max_size=6))
def test_no_bytes_crash_the_reader_or_make_it_hold_more_than_one_tpkt(data: bytes, cuts: list[int]) -> None:
    reader, whole = TpktReader(), TpktReader()
    marks = sorted({0, *(cut for cut in cuts if cut < len(data)), len(data)})
    found = [tpdu for begin, end in itertools.pairwise(marks) for tpdu in reader.feed(data[begin:end])]
    assert found == whole.feed(data)
    assert reader.held_bytes <= 65535


PIECES = st.binary(max_size=40)
TSAPS = st.binary(min_size=1, max_size=32)
REFS = st.integers(0, 65535)
TPDUS = st.one_of(
    st.builds(DataTpdu, PIECES, st.booleans()),
    st.builds(DisconnectTpdu, REFS, REFS, st.integers(0, 255)),
    st.builds(ErrorTpdu, REFS, st.integers(0, 255)),
    st.builds(
        ConnectTpdu, st.sampled_from([Code.CR, Code.CC]), REFS, REFS, TSAPS, TSAPS,
        st.none() | st.integers(7, 13), st.sampled_from([0, 1, 2, 3]),
    ),
)  # fmt: skip


@pytest.mark.slow
@given(st.lists(TPDUS, max_size=8))
def test_what_is_written_is_read_back(
    tpdus: list[ConnectTpdu | DataTpdu | DisconnectTpdu | ErrorTpdu],
) -> None:
    assert read(b"".join(map(encode_tpdu, tpdus))) == tpdus
