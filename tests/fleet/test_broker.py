"""The way to a broker: what is refused before a connection, and what becomes of one."""

from __future__ import annotations

import socket
import subprocess
from functools import partial
from pathlib import Path

import pytest

from tests.certificates import Certificates
from tests.fleet.mosquitto import Mosquitto, needs_mosquitto, tls_lines
from tests.waiting import until
from trcvtui import clock
from trcvtui.errors import UserError
from trcvtui.fleet import broker as fleet_broker
from trcvtui.fleet.broker import (
    BrokerAccess,
    BrokerConnection,
    BrokerEvent,
    ConnAck,
    ConnectionLost,
    IncomingMessage,
    LastWill,
    PublishAck,
    PublishRefusal,
    parse_broker,
)


def seen(connection: BrokerConnection, kind: type[BrokerEvent]) -> list[BrokerEvent]:
    """Wait for news of a kind; return all news up to it."""
    found: list[BrokerEvent] = []

    def came() -> bool:
        found.extend(connection.take_events())
        return any(isinstance(each, kind) for each in found)

    until(came)
    return found


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("http://x", "found 'http://x', expected mqtts://HOST[:8883] or mqtt://HOST[:1883]"),
        ("mqtts://", "expected mqtts://HOST"),
        ("mqtts://x:0", "expected mqtts://HOST"),
        ("mqtts://x:99999", "found no such URL"),
        ("mqtts://x/path", "expected mqtts://HOST"),
        ("mqtts://me:secret@x", "found a user or password in the URL, expected TRCVTUI_MQTT_USER"),
        ("mqtts://x\x1b[2J", "expected mqtts://HOST"),
    ],
)
def test_a_wrong_url_is_one_line_without_a_secret(url: str, told: str) -> None:
    with pytest.raises(UserError) as refused:
        parse_broker(url, environment={})
    [line] = refused.value.lines()
    assert told in line and line.isprintable() and "secret" not in line


def test_ports_of_a_url_and_a_password_that_is_in_no_text(tmp_path: Path) -> None:
    (tmp_path / "word").write_text("secret\n")
    plain = parse_broker(
        "mqtt://h", environment={"TRCVTUI_MQTT_USER": "u", "TRCVTUI_MQTT_PASSWORD": "secret"}
    )
    filed = parse_broker("mqtts://[::1]", environment={"TRCVTUI_MQTT_PASSWORD_FILE": str(tmp_path / "word")})
    assert (plain.port, plain.password, filed.port, filed.password) == (1883, "secret", 8883, "secret")
    assert (str(plain), str(filed)) == ("mqtt://h:1883", "mqtts://[::1]:8883")
    assert "secret" not in repr(plain) + repr(filed)


@needs_mosquitto
def test_a_message_goes_over_the_broker_and_is_acknowledged(broker: Mosquitto) -> None:
    reader = BrokerConnection(BrokerAccess("127.0.0.1", broker.port, False), "reader", topics=("a/#",))
    writer = BrokerConnection(
        BrokerAccess("127.0.0.1", broker.port, False), "writer", LastWill("a/will", b"gone")
    )
    reader.start()
    seen(reader, ConnAck)
    assert writer.publish("a/b", b"too early") is None
    writer.start()
    seen(writer, ConnAck)
    number = writer.publish("a/b", b"1")
    assert PublishAck(number or 0) in seen(writer, PublishAck)
    assert seen(reader, IncomingMessage)[-1] == IncomingMessage("a/b", b"1", False)
    writer.close()
    reader.close()


def test_what_nobody_takes_is_bounded_in_messages_and_in_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_broker, "MOST_WAITING_BYTES", 1000)
    connection = BrokerConnection(BrokerAccess("127.0.0.1", 1, False), "reader")
    for kept, dropped in ((2, 6), (3, 12)):
        for _ in range(8):
            connection._add_event(IncomingMessage("a", b"123456", False))
        assert (len([*connection.take_events()]), connection.dropped) == (kept, dropped)
        connection._add_event(ConnectionLost("told in any case"))


@needs_mosquitto
def test_a_broker_that_is_killed_is_one_line_and_its_return_is_noticed(broker: Mosquitto) -> None:
    connection = BrokerConnection(BrokerAccess("127.0.0.1", broker.port, False), "x")
    connection.start()
    seen(connection, ConnAck)
    broker.kill()
    [lost] = [each for each in seen(connection, ConnectionLost) if isinstance(each, ConnectionLost)][:1]
    assert lost.why.isprintable() and "\n" not in lost.why
    assert broker.start()
    seen(connection, ConnAck)
    connection.close()


def test_a_broker_that_sends_garbage_ends_a_connection_and_nothing_else() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        connection = BrokerConnection(BrokerAccess("127.0.0.1", server.getsockname()[1], False), "x")
        connection.start()
        for garbage in (
            b"HTTP/1.1 400 Bad Request\r\n\r\n",
            b"\x20\xff\xff\xff\xff\xff",
            b"\x20\x03\x00\x00\x05",
        ):
            end, _ = server.accept()
            with end:
                end.recv(4096)
                end.sendall(garbage)
                end.shutdown(socket.SHUT_WR)
            [lost] = [each for each in seen(connection, ConnectionLost) if isinstance(each, ConnectionLost)][
                :1
            ]
            assert lost.why.isprintable()
        connection.close()


@needs_mosquitto
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # paho leaves a refused socket
def test_tls_and_password_are_asked_for_and_a_wrong_one_is_one_line(
    certificates: Certificates, tmp_path: Path
) -> None:
    words, ca_file = tmp_path / "words", certificates.pem("ca")
    password_program = "/usr/bin/mosquitto_passwd"
    subprocess.run([password_program, "-c", "-b", str(words), "me", "right"], check=True, capture_output=True)
    words.chmod(0o644)
    broker = Mosquitto(tmp_path, f"allow_anonymous false\npassword_file {words}\n{tls_lines(certificates)}")
    try:
        outcomes = []
        for ca, password in ((ca_file, "right"), (ca_file, "wrong"), (None, "right")):
            given = {"TRCVTUI_MQTT_USER": "me", "TRCVTUI_MQTT_PASSWORD": password}
            connection = BrokerConnection(
                parse_broker(f"mqtts://127.0.0.1:{broker.port}", ca, environment=given), "x"
            )
            connection.start()
            outcomes.append(seen(connection, ConnAck if password == "right" and ca else ConnectionLost)[0])
            connection.close()
        taken, refused, strange = outcomes
        assert isinstance(taken, ConnAck)
        assert (
            isinstance(refused, ConnectionLost)
            and "Not authorized" in refused.why
            and "wrong" not in refused.why
        )
        assert isinstance(strange, ConnectionLost) and "wrong certificate" in strange.why
    finally:
        broker.kill()


@needs_mosquitto
def test_what_an_acl_forbids_is_refused_and_not_taken(tmp_path: Path) -> None:
    rights = tmp_path / "acl"
    rights.write_text("topic read secret/#\n")
    rights.chmod(0o644)
    broker = Mosquitto(tmp_path, f"allow_anonymous true\nacl_file {rights}\nuser root")
    connection = BrokerConnection(BrokerAccess("127.0.0.1", broker.port, False), "x")
    try:
        connection.start()
        seen(connection, ConnAck)
        number = connection.publish("secret/a", b"1", True)
        [refused] = [
            each for each in seen(connection, PublishRefusal) if isinstance(each, PublishRefusal | PublishAck)
        ]
        assert refused == PublishRefusal(number or 0, "Not authorized")
    finally:
        connection.close()
        broker.kill()


def says_that_the_name_is_taken(connection: BrokerConnection) -> bool:
    return any("may use the name 's/a'" in str(news) for news in connection.take_events())


@needs_mosquitto
def test_two_of_one_name_both_say_so(broker: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_broker, "LEAST_PAUSE_S", 0.05)
    monkeypatch.setattr(fleet_broker, "RIVAL_PAUSE_S", 0.05)
    one, other = (BrokerConnection(BrokerAccess("127.0.0.1", broker.port, False), "s/a") for _ in range(2))
    for each in (one, other):
        each.start()
        seen(each, ConnAck)
    for each in (one, other):
        until(partial(says_that_the_name_is_taken, each))
    for each in (one, other):
        each.close()


@needs_mosquitto
def test_a_broker_that_hangs_holds_the_end_up_for_less_than_five_seconds(broker: Mosquitto) -> None:
    connection = BrokerConnection(BrokerAccess("127.0.0.1", broker.port, False), "x")
    connection.start()
    seen(connection, ConnAck)
    broker.stop()
    began = clock.now_ns()
    connection.close(LastWill("a", b"last"))
    assert clock.now_ns() - began < 5_000_000_000
