"""Arguments that are read without argparse are what argparse reads; it has all the others."""

from __future__ import annotations

import random
from types import SimpleNamespace

import pytest

from trcvtui.cli.arguments import PlainParser
from trcvtui.cli.full_parser import FullParser
from trcvtui.cli.main import COMMANDS, _fill

WORDS = """
a.toml b.toml - -- -5 -h 7006 0 '' sim live text json jsonl csv md s7 80C5 4 08 x=y --help --version --netns
--netns=1 --read-only --write --as-root --kernel --kernel=sim --port --port=8080 --theme --theme=dark dark
--format --format=text --format=xml --out --out=o --set --set=a=b --dialect --block --type --type=T --layout
--byte-order --text --pointer-size --string-even --constant --constant=A=1 --with --to --to=lua --as --as=st
scl padded show decode encode export compare fit cure --dialekt --form
"""
LINES = """
run a.toml --kernel sim --netns
serve a.toml --port=8080 --write
scenario a.toml b.toml --format jsonl
scenario --set a=1 --set=b=2 a.toml
status
status 7006 --dialect baosky
status --block TRCV_C 7006
st a.toml TRCV_C_1
scenario a.toml --dialect a --dialect b
conversations a.pcapng b.pcap --plc 10.0.0.5:2000 --format json
recording strip a.pcapng b.pcapng --no-payload --anonymise
recording dissector
report a.pcapng --out a.html --no-payload
udt show a.st --type T --with b.st
udt decode a.st 01 02 03 --format md
udt decode a.st -
udt compare a.st --layout c --layout s7-standard
udt cure a.st --as st
udt export a.st --to lua --port 2000
"""
DEEPER = {
    "udt": ("show", "decode", "encode", "export", "compare", "fit", "cure"),
    "recording": ("strip", "dissector"),
}
NEEDED = {"report": ("--out", "a.html")}


def read_by_argparse(words: list[str]) -> SimpleNamespace | None:
    parser = FullParser(prog="trcvtui")
    parser.add_argument("--version", action="version", version="trcvtui")
    _fill(parser, words)
    try:
        return parser.parse_args(words, SimpleNamespace())
    except SystemExit:
        return None


def read_here(words: list[str]) -> SimpleNamespace | None:
    parser = PlainParser()
    _fill(parser, words)
    return parser.read(words)


@pytest.mark.parametrize(
    "first",
    [
        [],
        *([name, *NEEDED.get(name, ())] for name in COMMANDS),
        *([c, name] for c in DEEPER for name in DEEPER[c]),
    ],
)
def test_what_is_read_here_is_what_argparse_reads(
    first: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    chance = random.Random(7)
    taken = 0
    for _ in range(1500):
        words = [*first, *chance.choices(WORDS.split(), k=chance.choice((0, 1, 2, 2, 3, 3, 4, 5)))]
        here = read_here(words)
        if here is not None:
            assert here == read_by_argparse(words), words
            taken += len(words) > len(first)
    assert taken >= 5 or not first or first[0] in DEEPER


@pytest.mark.parametrize("line", LINES[:-1].split("\n"))
def test_the_usual_lines_need_no_argparse(line: str) -> None:
    here = read_here(line.split())
    assert here is not None
    assert here == read_by_argparse(line.split())
