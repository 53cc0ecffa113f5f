"""Topics and messages: what an agent writes is read again; what is hostile is one line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.errors import UserError
from trcvtui.fleet.metrics import METRICS
from trcvtui.fleet.topics import (
    MESSAGE_TYPES,
    EventMessage,
    FiguresMessage,
    FleetMessage,
    RecentMessage,
    StateMessage,
    StatusMessage,
    Topic,
    parse_message,
    parse_topic,
)
from trcvtui.line.tap_capture import NOTE_NAMES, TapNote
from trcvtui.paths import configs_path

DOCS = Path(__file__).parents[2] / "docs"

AT = 1_795_000_000.25
EVENT = EventMessage(
    "5f0c-1", AT, "error", "80A6", {"text": "reset", "errno": "ECONNRESET", "injected": False}
)
ALL: list[FleetMessage] = [
    StateMessage("online", AT, "0.1.0", "pc-7"),
    StatusMessage(AT, "7006", "receiving", True, False, False, 7, 1, 12, 24, 0.5),
    EVENT,
    FiguresMessage(AT, "connected", 120.5, 0, 60, 2),
    RecentMessage(AT, 1, (EVENT,)),
]


def place(kind: str) -> Topic:
    return Topic(
        "plant 1", "pc/line", "C1" * (kind != "state"), "TRCV#1" * (kind not in ("state", "figures")), kind
    )


@pytest.mark.parametrize("message", ALL, ids=lambda message: message.KIND)
def test_a_message_comes_out_as_it_went_in(message: FleetMessage) -> None:
    topic = place(message.KIND)
    assert parse_topic(str(topic)) == topic
    assert parse_message(topic, message.to_json()) == message


names = st.text(min_size=1, max_size=20).filter(lambda text: text.encode(errors="replace").decode() == text)


@given(names, names, names, names)
def test_any_names_make_a_topic_of_five_levels_and_come_back(
    site: str, agent: str, line: str, instance: str
) -> None:
    topic = Topic(site, agent, line, instance, "status")
    assert str(topic).count("/") == 6
    assert not set(str(topic)) & set("+#\n\x1b\0")
    assert parse_topic(str(topic)) == topic


@pytest.mark.parametrize(
    "text",
    [
        "",
        "trcvtui/v1/",
        "trcvtui/v1/a/b",
        "trcvtui/v1/a//c/d/status",
        "trcvtui/v1/a/b/c/d/e/status",
        "trcvtui/v1/a/b/figures",
        "trcvtui/v1/a/b/%/figures",
        "trcvtui/v1/a/b/%41/figures",
        "trcvtui/v1/a/b/%ff/figures",
        "x/trcvtui/v1/a/b/state",
        "trcvtui/v1/\x1b[2J/b/state",
        "trcvtui/v1/" + "a" * 2000 + "/b/state",
    ],
)
def test_a_topic_that_no_agent_writes_is_one_line(text: str) -> None:
    with pytest.raises(UserError) as refused:
        parse_topic(text)
    [line] = refused.value.lines()
    assert line.isprintable() and len(line) < 400


@pytest.mark.parametrize(
    "payload",
    [
        b"{" * 100_000,
        b"[" * 100_000,
        b"\xff\xfe",
        b"null",
        b"[]",
        b"{}",
        b"x" * 1_000_000,
        b'{"state":"online","t":NaN,"version":"1","host":""}',
        b'{"state":"online","t":1e999,"version":"1","host":""}',
        b'{"state":"online","t":true,"version":"1","host":""}',
        b'{"state":"online\\n","t":1,"version":"1","host":""}',
        b'{"state":"\\u001b[2J","t":1,"version":"1","host":""}',
        b'{"state":"online","t":1,"version":["' + b"a" * 9999 + b'"],"host":""}',
        b'{"state":"online","t":' + b"9" * 5000 + b',"version":"1","host":""}',
    ],
    ids=range(14),
)
def test_a_payload_that_no_agent_writes_is_one_line(payload: bytes) -> None:
    with pytest.raises(UserError) as refused:
        parse_message(place("state"), payload)
    [line] = refused.value.lines()
    assert line.isprintable() and len(line) < 600


def test_escape_codes_and_length_of_texts_end_here() -> None:
    hostile = {"id": "0-1", "t": 0, "kind": "note", "STATUS": None}
    cause = {"\x1b]0;x\x07": "\x1b[31m" + "a" * 9999, "deep": [[[]]], "big": 10**18}
    event = parse_message(place("event"), json.dumps(hostile | {"cause": cause}).encode())
    assert isinstance(event, EventMessage)
    assert all(
        str(each).isprintable() and len(str(each)) < 900 for pair in event.cause.items() for each in pair
    )


def test_an_empty_payload_clears_a_topic() -> None:
    assert parse_message(place("recent"), b"") is None


def test_the_schema_that_comes_along_is_that_of_the_messages_and_the_page_names_each_field() -> None:
    shown = json.loads((configs_path() / "service" / "mqtt-messages.schema.json").read_text(encoding="utf-8"))
    _, schemas = msgspec.json.schema_components(MESSAGE_TYPES.values(), ref_template="#/$defs/{name}")
    assert shown["$defs"] == schemas
    page = (DOCS / "fleet-formats.md").read_text(encoding="utf-8")
    for kind, message in MESSAGE_TYPES.items():
        rows = " ".join(re.findall(rf"^\| `{kind}`.*", page, re.MULTILINE))
        fields = {*message.__struct_encode_fields__} - {"t"}
        assert fields <= set(re.findall(r"`(\w+)`", rows)), kind


def test_the_page_of_a_tap_names_each_note_and_its_fields() -> None:
    page = (DOCS / "fleet-formats.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", page))
    assert {*NOTE_NAMES.values(), *TapNote.__struct_fields__} <= named


def test_the_page_of_the_fleet_has_each_metric() -> None:
    page = (DOCS / "fleet.md").read_text(encoding="utf-8")
    for metric in METRICS:
        assert f"| `{metric.name}{'_total' * (metric.kind == 'counter')}` | " in page
