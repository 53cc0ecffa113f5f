"""A peer that answers by itself: rules over the stream, however it is cut; on the wire and in a project."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.bench.bench_project import bench_project
from tests.bench.peers.peer_wire import Wire, connected, write
from trcvtui.bench.peers.queues import ReplyRules
from trcvtui.commands.counters_and_checksums import fill_message
from trcvtui.commands.peer import read_replies
from trcvtui.commands.table import parse_line, rule_text
from trcvtui.commands.words import AddReply
from trcvtui.errors import UserError
from trcvtui.project.file import read_project
from trcvtui.project.project import Project

ROOM = 1000


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    return bench_project(tmp_path_factory.mktemp("bench"))


def rule(text: str, project: Project) -> AddReply:
    command = parse_line(f"peer P1 reply on {text}", project, "w")
    assert isinstance(command, AddReply)
    return command


def answers(text: str, pieces: Sequence[bytes], project: Project, room: int = ROOM) -> list[bytes]:
    """Return what a rule answers; each piece comes in a scan of its own."""
    replies = ReplyRules()
    assert replies.add(rule(text, project)) == ""
    found = []
    for now, piece in enumerate(pieces):
        found += [
            fill_message(send.payload, send.fills, n) for send, n in replies.find_answers(piece, now, room)
        ]
    return found


@pytest.mark.parametrize(
    ("text", "pieces", "hits"),
    [
        ("contains hex 05 0D", [b"..\x05\r..\x05\r"], 2),
        ("contains hex 05 0D", [b"..\x05", b"\r.."], 1),
        ("contains hex 05 0D", [b"..\x05", b".", b"\r"], 0),
        ("contains hex 01 01", [b"\x01\x01\x01"], 1),
        ("contains hex 01 01", [b"\x01", b"\x01", b"\x01", b"\x01"], 2),
        ("starts hex 01 02", [b"\x01\x02\x03", b"\x01\x02", b"\x03\x01\x02"], 2),
        ("starts hex 01 02", [b"\x01", b"\x02\x03"], 1),
        ("starts hex 01 02", [b"\x01", b"\x03\x01\x02", b"\x01\x02"], 1),
        ("field Point.y = 7", [b"\x01\x00\x07\x00", b"\x02\x00\x08\x00"], 1),
        ("field Point.y = 7", [b"\x01\x00", b"\x07", b"\x00\x02\x00\x07\x00\x05"], 2),
        ("field Point.y = 7", [b"\x00\x00\x00\x07\x00"], 0),
    ],
)
def test_a_rule_finds_what_it_looks_for(project: Project, text: str, pieces: list[bytes], hits: int) -> None:
    assert answers(f"{text} send hex 06", pieces, project) == [b"\x06"] * hits


@pytest.mark.slow
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_however_the_stream_is_cut_the_same_is_found(project: Project, data: st.DataObject) -> None:
    stream = data.draw(
        st.lists(st.sampled_from([b"a", b"b", b"ab", b"aab", b"\r"]), max_size=40).map(b"".join)
    )
    cuts = sorted(data.draw(st.sets(st.integers(0, len(stream)), max_size=10)))
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    for text in ('contains text "aab"', "field Point.x = 24929"):
        whole = answers(f"{text} send hex 06", [stream], project)
        assert answers(f"{text} send hex 06", pieces, project) == whole
    assert len(answers('contains text "aab" send hex 06', pieces, project)) == len(re.findall(b"aab", stream))


def test_each_answer_of_a_rule_has_the_next_number(project: Project) -> None:
    text = 'contains hex 05 send text "no {n:2}"'
    assert answers(text, [b"\x05\x05", b"\x05"], project) == [b"no 00", b"no 01", b"no 02"]


def test_what_there_is_no_room_to_answer_is_counted_as_missed(project: Project) -> None:
    replies = ReplyRules()
    replies.add(rule("contains hex 05 send hex 06", project))
    assert len(list(replies.find_answers(b"\x05" * 9, 0, 4))) == 4
    (told,) = replies.snapshot()
    assert (told.rule, told.hits, told.missed) == ("contains hex 05 send hex 06", 4, 5)


def test_rules_end_one_by_one_or_all(project: Project) -> None:
    replies = ReplyRules()
    for text in ("contains hex 01 send hex 0A", "contains hex 02 send hex 0B"):
        replies.add(rule(text, project))
    assert replies.remove(3, "P1") == "P1 has 2 rules, no number 3"
    assert replies.remove(1, "P1") == ""
    assert [told.rule for told in replies.snapshot()] == ["contains hex 02 send hex 0B"]
    assert replies.remove(0, "P1") == "" and not replies


def test_the_sixty_fifth_rule_is_refused(project: Project) -> None:
    replies = ReplyRules()
    for _ in range(64):
        assert replies.add(rule("contains hex 01 send hex 0A", project)) == ""
    assert "64 rules already" in replies.add(rule("contains hex 01 send hex 0A", project))


def test_an_answer_goes_over_the_connection_that_asked(wire: Wire, project: Project) -> None:
    peer, other = connected(wire)
    peer.replies.add(rule("contains hex 05 0D send hex 06 {n}", project))
    write(wire, other, b"..\x05")
    wire.step()
    write(wire, other, b"\r")
    assert wire.read(other, 2) == b"\x06\x00"
    write(wire, other, b"\x05\r\x05\r")
    assert wire.read(other, 4) == b"\x06\x01\x06\x02"
    assert peer.snapshot().replies[0].hits == 3


def test_a_new_connection_does_not_go_on_with_the_beginning_of_a_match(wire: Wire, project: Project) -> None:
    peer = wire.peer("P1", False)
    peer.listen()
    peer.replies.add(rule("contains hex 05 0D send hex 06", project))
    first = wire.client(peer)
    write(wire, first, b"\x05")
    wire.until(lambda: peer.snapshot().bytes_received == 1)
    second = wire.client(peer)
    write(wire, second, b"\r")
    wire.until(lambda: peer.snapshot().bytes_received == 2)
    assert peer.snapshot().replies[0].hits == 0


def test_a_peer_that_has_shut_down_answers_no_more(wire: Wire, project: Project) -> None:
    peer, other = connected(wire)
    peer.replies.add(rule("contains hex 05 send hex 06", project))
    peer.shutdown()
    write(wire, other, b"\x05")
    wire.until(lambda: peer.snapshot().bytes_received == 1)
    (told,) = peer.snapshot().replies
    assert (told.hits, told.missed) == (0, 1)
    assert wire.ending(other) == "FIN"


# -- in a project file -----------------------------------------------------------------------------------

HEAD = 'dialect = "baosky"\n[[connect]]\nname = "C1"\n[[peer]]\nname = "P1"\nremote = "@C1"\n'


def project_of(folder: Path, replies: str) -> Project:
    return read_project(tomllib.loads(f"{HEAD}replies = {replies}\n"), "b.toml", folder)


def test_a_project_gives_a_peer_its_rules(tmp_path: Path) -> None:
    project = project_of(tmp_path, '["contains hex 05 send hex 06", "starts hex 01 send hex 02"]')
    assert [rule_text(rule) for rule in read_replies(project)] == [
        "contains hex 05 send hex 06",
        "starts hex 01 send hex 02",
    ]


def test_a_wrong_rule_of_a_project_is_one_line_with_its_number(tmp_path: Path) -> None:
    project = project_of(
        tmp_path, '["contains hex 05 send hex 06", "contains hex 05", "has hex 01 send hex 1"]'
    )
    with pytest.raises(UserError) as caught:
        read_replies(project)
    assert caught.value.lines() == [
        "b.toml: peer P1: replies #2: found no further word, expected `send` and a payload",
        "b.toml: peer P1: replies #3: found 'has', expected one of contains, starts, field",
    ]
