"""What looks like a fault, or like a session, and is none; and what is told in its place."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.diagnosis.doctor_cases import (
    MS,
    Built,
    S,
    Telegrams,
    Wire,
    begin,
    cotp,
    record,
    static,
    talk,
    verdicts_of,
)
from tests.recording.wire import ACK, PSH
from trcvtui.diagnosis.receiver import Receiver

Say = Callable[[Random, Built], None]
PLAIN = static(20, ports=frozenset((2000,)))


def verdicts_on(say: Say, folder: Path, *receivers: Receiver) -> list[dict[str, Any]]:
    made = Built("")
    say(Random(58), made)
    path = folder / "case.pcapng"
    path.write_bytes(made.file())
    return verdicts_of(path, receivers=receivers)


def causes(verdicts: list[dict[str, Any]], key: str = "findings") -> list[str]:
    return [one["cause"] for each in verdicts for one in each[key]]


def each_second(wire: Wire, *messages: bytes, who: str = "partner") -> None:
    for message in messages:
        wire.say(who, message)
        wire.wait(S)


# -- sessions ------------------------------------------------------------------------------------------------


def begins_like(head: bytes) -> Say:
    def say(r: Random, b: Built) -> None:
        wire, telegrams = Wire(r, b, begin(r)).open(), Telegrams(r, 18)
        each_second(wire, head + telegrams.next()[len(head) :], *[telegrams.next() for _ in range(12)])

    return say


@pytest.mark.parametrize("head", ["", "030000", "03000012", "1603", "1603030007", "170303000d", "150301"])
@pytest.mark.parametrize("receiver", [PLAIN, Receiver("", "", 20, is_only=True)], ids=["project", "type"])
def test_first_bytes_alone_make_no_session(head: str, receiver: Receiver, tmp_path: Path) -> None:
    (one,) = verdicts_on(begins_like(bytes.fromhex(head)), tmp_path, receiver)
    assert [each["cause"] for each in one["findings"]] == ["frame-short"] and one["not_judged"] == []


def tpdu(body: bytes) -> bytes:
    return b"\x03\x00" + struct.pack(">H", len(body) + 7) + b"\x02\xf0\x80" + body


def iso(r: Random, b: Built) -> None:
    wire = Wire(r, b, begin(r)).open()
    wire.say("partner", cotp(0xE0, b"\x01\x00", b"\x03\x02"))
    wire.say("plc", cotp(0xD0, b"\x01\x00", b"\x03\x02"))
    each_second(wire, *[tpdu(bytes((n, *range(10)))) for n in range(12)])


def tls(r: Random, b: Built) -> None:
    wire = Wire(r, b, begin(r)).open()
    wire.say("partner", record(22, b"\x01" + bytes(200)))
    wire.say("plc", record(22, b"\x02" + bytes(80)) + record(20, b"\x01") + record(22, bytes(40)))
    wire.say("partner", record(20, b"\x01") + record(22, bytes(40)))
    each_second(wire, *[record(23, r.randbytes(30)) for _ in range(12)])


@pytest.mark.parametrize("say", [iso, tls])
def test_a_session_where_the_project_says_plain_tcp_is_told_as_not_judged(say: Say, tmp_path: Path) -> None:
    (one,) = verdicts_on(say, tmp_path, PLAIN)
    assert one["findings"] == [] and one["quality"] == ["ends-early", "session"]
    assert {"cause": "frame-short", "quality": "session"} in one["not_judged"]


def middle_of_tls(r: Random, b: Built) -> None:
    tls(r, b)
    b.first_packet = 12


def test_the_middle_of_tls_accuses_no_message_of_a_type(tmp_path: Path) -> None:
    (one,) = verdicts_on(middle_of_tls, tmp_path, Receiver("", "", 40, is_only=True))
    assert one["findings"] == [] and "session" in one["quality"]


@pytest.mark.parametrize(("over", "is_judged"), [({"is_secure": True}, False), ({}, True)])
def test_a_reset_inside_tls_is_inside_no_job(over: dict[str, bool], is_judged: bool, tmp_path: Path) -> None:
    def say(r: Random, b: Built) -> None:
        wire = Wire(r, b, begin(r)).open()
        each_second(wire, *[bytes((n, *range(15))) for n in range(5)])
        wire.rst("partner")

    (one,) = verdicts_on(say, tmp_path, static(60, **over))
    assert any("inside a job" in text for each in one["findings"] for text in each["evidence"]) is is_judged


# -- messages ------------------------------------------------------------------------------------------------


def head_and_body(r: Random, b: Built) -> None:
    wire = Wire(r, b, begin(r)).open()
    for number in range(20):
        wire.say("partner", struct.pack(">HH", 0x1234, 60))
        wire.wait(40 * MS)
        wire.say("partner", bytes((number,)) + r.randbytes(59))
        wire.wait(S)


@pytest.mark.parametrize("type_size", [0, 4])
def test_a_body_that_is_a_multiple_of_its_head_is_not_merged(type_size: int, tmp_path: Path) -> None:
    assert "merged" not in causes(verdicts_on(head_and_body, tmp_path, static(128, adhoc=True)))


def odd_message(at: tuple[int, ...]) -> Say:
    def say(r: Random, b: Built) -> None:
        wire, telegrams = Wire(r, b, begin(r)).open(), Telegrams(r, 20)
        each_second(wire, *[telegrams.next(7 if n in at else 20) for n in range(18)])

    return say


@pytest.mark.parametrize(("at", "resets"), [((0,), False), ((3, 9), False), ((3,), True)])
def test_com_rst_is_offered_only_for_what_does_not_come_again(
    at: tuple[int, ...], resets: bool, tmp_path: Path
) -> None:
    (one,) = verdicts_on(odd_message(at), tmp_path, PLAIN)
    assert [each["cause"] for each in one["findings"]] == ["shifted"]
    assert [("COM_RST" in each["text"]) for each in one["findings"][0]["mend"]] == [resets]


# -- connections ---------------------------------------------------------------------------------------------


def ends_by_rst(*sizes: int, style: str = "alone", answers_last: bool = False) -> Say:
    def say(r: Random, b: Built) -> None:
        wire, telegrams = Wire(r, b, begin(r)).open(), Telegrams(r, 27)
        for number, size in enumerate(sizes, 1):
            wire.say("partner", telegrams.next(size))
            if style == "answered" and (number < len(sizes) or answers_last):
                wire.say("plc", b"OK\r\n")
            wire.wait(S)
        wire.rst("partner")

    return say


@pytest.mark.parametrize(
    ("say", "found"),
    [
        (ends_by_rst(27, 27, 9, 27, 27, 9), []),
        (ends_by_rst(27, 27, 27, 27, 9, style="answered", answers_last=True), []),
        (ends_by_rst(27, 27, 27, 27, 9, style="answered"), ["resets"]),
        (ends_by_rst(27, 27, 27, 27, 9), ["resets"]),
    ],
)
def test_a_reset_behind_a_whole_message_is_a_remark(say: Say, found: list[str], tmp_path: Path) -> None:
    verdicts = verdicts_on(say, tmp_path)
    assert causes(verdicts) == found and causes(verdicts, "remarks") == [*["resets"][len(found) :]]


def idle_client(beside: bool, host: str = "") -> Say:
    """One client falls silent, and a minute later another connection is built."""

    def say(r: Random, b: Built) -> None:
        at = begin(r)
        for start, often in (*([(0, 60)] if beside else []), (20 * S, 1), (90 * S, 10)):
            wire = Wire(r, b, at + start)
            if host:
                wire.plc, wire.partner = (host, 2000), (host, wire.partner[1])
            talk(r, wire.open(), Telegrams(r, 16), often, S, "answered")
            if often == 60:
                wire.fin("partner")

    return say


@pytest.mark.parametrize(
    ("say", "found"),
    [
        (idle_client(beside=False), ["no-keep-alive"]),
        (idle_client(beside=True), []),
        (idle_client(beside=False, host="127.0.0.1"), []),
    ],
    ids=["alone", "beside", "loopback"],
)
def test_an_idle_client_was_not_forgotten_where_another_one_lived_or_no_way_is(
    say: Say, found: list[str], tmp_path: Path
) -> None:
    assert causes(verdicts_on(say, tmp_path)) == found


def other_program(port: int, answer: bytes, often: int = 6, is_refused: bool = False) -> Say:
    """Beside the healthy line of port 2000 something asks another port, a connection each time."""

    def say(r: Random, b: Built) -> None:
        at = begin(r)
        talk(r, Wire(r, b, at).open(), Telegrams(r, 20), 20, S, "answered")
        for number in range(often):
            wire = Wire(r, b, at + number * S, port=port)
            if is_refused:
                wire.ask_to_connect("rst")
                continue
            wire.open().say("partner", b"GET /values HTTP/1.1\r\nHost: plc\r\n\r\n" if answer else b"?")
            wire.say("plc", answer or b"!")
            wire.fin("partner")

    return say


HTTP = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}"


@pytest.mark.parametrize(
    ("say", "project", "found"),
    [
        (other_program(80, HTTP), True, set()),
        (other_program(80, HTTP), False, set()),
        (other_program(81, b""), True, set()),
        (other_program(81, b""), False, {"closes-each-message"}),
        (other_program(8080, b"", is_refused=True), True, set()),
        (other_program(8080, b"", is_refused=True), False, {"refused"}),
    ],
)
def test_what_other_programs_do_beside_the_line_of_the_project_is_a_remark(
    say: Say, project: bool, found: set[str], tmp_path: Path
) -> None:
    verdicts = verdicts_on(say, tmp_path, *([PLAIN] if project else []))
    assert {*causes(verdicts)} == found
    assert found or causes(verdicts, "remarks")


def test_a_port_of_another_connect_of_the_project_is_its_own(tmp_path: Path) -> None:
    known = PLAIN._replace(ports=frozenset((2000, 8080)))
    assert causes(verdicts_on(other_program(8080, b"", is_refused=True), tmp_path, known))


def refusal_of_the_certificate(code: int) -> Say:
    def say(r: Random, b: Built) -> None:
        wire = Wire(r, b, begin(r)).open()
        wire.say("partner", record(22, b"\x01" + bytes(200)))
        wire.say("plc", record(21, bytes((2, code))))
        wire.fin("plc")

    return say


def test_each_alert_about_certificates_and_versions_says_what_it_means(tmp_path: Path) -> None:
    said = set()
    for code in (*range(42, 49), 70, 116):
        (first, *_) = verdicts_on(refusal_of_the_certificate(code), tmp_path)[0]["findings"]
        _, _, means = first["evidence"][0].partition("from the PLC end: ")
        assert "the partner" in means or code == 46
        said.add(means)
    assert len(said) == 9


@pytest.mark.parametrize("by", ["plc", "partner"])
def test_a_storm_names_the_end_that_closes(by: str, tmp_path: Path) -> None:
    def say(r: Random, b: Built) -> None:
        at = begin(r)
        for number in range(8):
            wire = Wire(r, b, at + number * 2 * S).open()
            each_second(wire, b"1", b"2")
            wire.put(by, b"!", ACK | PSH)
            wire.rst(by)

    (first, *_) = verdicts_on(say, tmp_path)[0]["findings"]
    assert first["cause"] == "reconnect-storm"
    assert {"plc": "the PLC end", "partner": "the partner"}[by] in first["mend"][0]["text"]
