"""Named messages and sequences of a project: as commands, on the wire, and what is wrong with them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from trcvtui.bench.peers.queues import Outbox
from trcvtui.commands.counters_and_checksums import fill_message
from trcvtui.commands.peer import check_all_messages
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import PeerPlaySequence, PeerSend
from trcvtui.errors import UserError
from trcvtui.project.file import read_project
from trcvtui.project.project import Project

MS = 1_000_000


def test_a_named_message_is_sent_as_its_text_says(project: Project) -> None:
    send = parse_line("peer P1 send message hello", project, "w")
    assert isinstance(send, PeerSend)
    assert (send.payload, send.split, send.gap_ns) == (b"hello", (2,), 20 * MS)


def test_a_message_of_one_peer_is_not_that_of_another(project: Project) -> None:
    numbered = parse_line("peer P1 send message numbered", project, "w")
    assert (
        isinstance(numbered, PeerSend)
        and fill_message(numbered.payload, numbered.fills, 7) == b"\x01\x00\x07"
    )
    with pytest.raises(UserError) as caught:
        parse_line("peer P2 send message numbered", project, "w")
    assert caught.value.lines() == ["w: found 'numbered', expected hello"]


def test_a_sequence_keeps_its_pauses(project: Project) -> None:
    play = parse_line("peer P1 play start_up", project, "w")
    assert isinstance(play, PeerPlaySequence)
    outbox = Outbox()
    for pause, send in play.steps:
        outbox.put(send, 0, pause_ns=pause)
    gone = []
    for now in range(0, 200 * MS, 10 * MS):
        while (chunk := outbox.due_bytes(now)) is not None:
            gone.append((now // MS, bytes(chunk)))
            outbox.count_sent(len(chunk), now)
    assert gone == [(0, b"he"), (20, b"llo"), (120, b"\x01\x00\x00")]


HEAD = 'dialect = "baosky"\n[[connect]]\nname = "C1"\n[[peer]]\nname = "P1"\nremote = "@C1"\n'


def mistakes(folder: Path, text: str) -> list[str]:
    with pytest.raises(UserError) as caught:
        check_all_messages(read_project(tomllib.loads(HEAD + text), "b.toml", folder))
    return caught.value.lines()


def test_a_message_that_is_none_is_told_with_its_name(tmp_path: Path) -> None:
    text = '[[message]]\nname = "m"\ntext = "hex zz"\n'
    assert mistakes(tmp_path, text) == [
        "b.toml: message m: hex, position 1: found 'z', expected hex bytes such as 01 02 0A"
    ]


def test_a_sequence_of_an_unknown_message_is_told_with_its_step(tmp_path: Path) -> None:
    text = '[[message]]\nname = "m"\ntext = "hex 01"\n[[sequence]]\nname = "s"\nsteps = ["m", "mm", "T#x"]\n'
    assert mistakes(tmp_path, text) == [
        "b.toml: sequence s: steps #2: found 'mm', expected m, or a pause such as T#100ms",
        "b.toml: sequence s: steps #3: found 'T#x', expected a duration of at least T#0s, such as T#5ms",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[[message]]\nname = "m"\n', "b.toml: message m: text: found nothing, expected a text in quotes"),
        (
            '[[message]]\nname = "m"\ntext = "hex 01"\npeer = "P2"\n',
            "b.toml: message m: peer: found 'P2', expected P1",
        ),
        (
            '[[message]]\nname = "m"\ntext = "hex 01"\n[[message]]\nname = "m"\ntext = "hex 02"\n',
            "b.toml: message m: name: found 'm', which a message already has, expected an unused name",
        ),
    ],
)
def test_a_table_that_is_none_is_refused_by_the_loader(tmp_path: Path, text: str, expected: str) -> None:
    assert mistakes(tmp_path, text) == [expected]
