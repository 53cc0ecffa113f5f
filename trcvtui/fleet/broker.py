"""The connection to an MQTT 5 broker (URL, TLS, user, password). It reconnects by itself.

Rule 1: only this file uses paho. Our own thread runs paho's loop: an error in the broker's data ends
a connection, never the program. Each connection gets a new client. A used client would send old messages
again, after newer messages.
Rule 2: only the thread of paho's loop uses the socket. Messages of other threads wait in paho's queue.
"""

from __future__ import annotations

import os
import ssl
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, NamedTuple
from urllib.parse import urlsplit

from trcvtui import clock
from trcvtui.errors import UserError, mistake, one_line, require
from trcvtui.fleet.topics import MOST_MESSAGE_BYTES

if TYPE_CHECKING:
    from paho.mqtt.client import Client
    from paho.mqtt.properties import Properties

PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
USER, PASSWORD, PASSWORD_FILE = "TRCVTUI_MQTT_USER", "TRCVTUI_MQTT_PASSWORD", "TRCVTUI_MQTT_PASSWORD_FILE"
KEEP_ALIVE_S: Final = 30
CONNECT_TIMEOUT_S: Final = 5.0
LEAST_PAUSE_S, MOST_PAUSE_S = 1.0, 5.0  # between two tries
RIVAL_PAUSE_S, MOST_RIVAL_PAUSE_S = 5.0, 60.0  # if another program uses our name
SHORT_NS, MOST_SHORT = 30_000_000_000, 3  # so many short connections in a row suggest such a program
CLOSE_WAIT_S: Final = 1.5  # at most, for the last message
SESSION_TAKEN_OVER: Final = 0x8E  # MQTT 5, 3.14.2.1: another connection has our client id
NO_SUBSCRIBERS: Final = 0x10  # MQTT 5, 3.4.2.1: accepted, but there is no subscriber
LOOP_TIMEOUT_S: Final = 0.2
MOST_WAITING_BYTES: Final = 1 << 26  # of unread messages
MESSAGE_OVERHEAD: Final = 500  # memory of a message beside its payload
MOST_PASSWORD_CHARS: Final = 65_536
NO_TLS_TEXT: Final = "mqtt:// has no TLS: others can read and change messages on the way; expected mqtts://"


@dataclass(frozen=True, slots=True)
class BrokerAccess:
    """Address and credentials of a broker. No text of this record contains user or password."""

    host: str
    port: int
    has_tls: bool
    ca: str | None = None
    cert: str | None = None
    key: str | None = None
    user: str | None = field(default=None, repr=False)
    password: str | None = field(default=None, repr=False)

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.has_tls else 'mqtt'}://{host}:{self.port}"


class ConnAck(NamedTuple):
    """The broker has accepted the connection."""


class ConnectionLost(NamedTuple):
    """A connection has failed or ended. `why` has the reason in one line. BrokerConnection tries again."""

    why: str


class IncomingMessage(NamedTuple):
    """A message; its `topic` and `payload` are unchecked, and both may be hostile."""

    topic: str
    payload: bytes
    is_retained: bool


class PublishAck(NamedTuple):
    """The broker has acknowledged our message of this number."""

    number: int


class PublishRefusal(NamedTuple):
    """The broker has refused our message with this number. `why` has the reason in one line."""

    number: int
    why: str


class SubAck(NamedTuple):
    """The broker has answered the `subscribe` call that returned this number."""

    number: int


class SubscribeRefusal(NamedTuple):
    """The broker has refused a subscription: most often our user lacks the right."""

    why: str


BrokerEvent = (
    ConnAck | ConnectionLost | IncomingMessage | PublishAck | PublishRefusal | SubAck | SubscribeRefusal
)


class LastWill(NamedTuple):
    """The message that the broker publishes, retained, if the connection is lost."""

    topic: str
    payload: bytes


def parse_broker(
    url: str,
    ca: str | None = None,
    cert: str | None = None,
    key: str | None = None,
    environment: Mapping[str, str] = os.environ,
    where: str = "--mqtt",
) -> BrokerAccess:
    """Return the broker of a URL. Raise UserError with `where`, the option or key that has the URL."""
    wanted = "mqtts://HOST[:8883] or mqtt://HOST[:1883]"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise mistake(where, "no such URL", wanted) from None
    if "@" in url:  # a password on a command line is visible to other users
        raise mistake(where, "a user or password in the URL", f"{USER}, {PASSWORD} or {PASSWORD_FILE}")
    is_bare = parts.path in ("", "/") and not parts.query and not parts.fragment
    if parts.scheme not in PORTS or not parts.hostname or not is_bare or port == 0 or not url.isprintable():
        raise mistake(where, f"'{one_line(url)}'", wanted)
    has_tls = parts.scheme == "mqtts"
    if not has_tls and (ca or cert or key):
        raise mistake(where, "mqtt:// with a certificate", "mqtts://")
    if (cert is None) != (key is None):
        raise mistake("--mqtt-cert, --mqtt-key", "one of them", "both")
    for option, path in (("--mqtt-ca", ca), ("--mqtt-cert", cert), ("--mqtt-key", key)):
        if path is not None and not os.path.isfile(path):
            raise mistake(option, f"no file '{path}'", "a PEM file")
    made = BrokerAccess(
        parts.hostname,
        port or PORTS[parts.scheme],
        has_tls,
        ca,
        cert,
        key,
        environment.get(USER) or None,
        _read_password(environment),
    )
    if has_tls:
        _tls_context(made)  # report bad files now, not at the first connection
    return made


def _read_password(environment: Mapping[str, str]) -> str | None:
    path, given = environment.get(PASSWORD_FILE), environment.get(PASSWORD)
    if path and given:
        raise mistake(PASSWORD_FILE, f"{PASSWORD} as well", "one of them")
    if not path:
        return given or None
    try:
        with open(path, encoding="utf-8") as file:
            return file.read(MOST_PASSWORD_CHARS).rstrip("\r\n")
    except (OSError, ValueError) as failed:
        why = failed.strerror if isinstance(failed, OSError) else "not UTF-8"
        raise mistake(PASSWORD_FILE, f"'{why}' at '{path}'", "a file with the password") from None


def _tls_context(broker: BrokerAccess) -> ssl.SSLContext:
    try:
        made = ssl.create_default_context(cafile=broker.ca)
        if broker.cert is not None:
            made.load_cert_chain(broker.cert, broker.key, password=lambda: "")  # never ask on the terminal
    except (OSError, ValueError) as failed:
        raise mistake("--mqtt-ca, --mqtt-cert, --mqtt-key", f"'{failed}'", "PEM files that fit") from None
    return made


class BrokerConnection:
    """A connection that reconnects to its broker by itself. `news` yields its events in order."""

    def __init__(
        self, broker: BrokerAccess, client_id: str, will: LastWill | None = None, topics: tuple[str, ...] = ()
    ) -> None:
        require("paho.mqtt.client", "fleet", "--mqtt", "no paho-mqtt")
        self._broker, self._id, self._will, self._topics = broker, client_id, will, topics
        self._news: deque[BrokerEvent] = deque()
        self._waiting_bytes = 0
        self.dropped = 0  # messages that came faster than they were read
        self._client: Client | None = None
        self._is_up = False
        self._why = ""  # cause of the end of the connection
        self._rival_pause = 0.0  # seconds before the next try, if another program uses our name
        self._up_at = self._short = 0  # begin of the connection; number of short connections in a row
        self._ends = threading.Event()
        self._something = threading.Event()
        self._thread = threading.Thread(target=self._run, name="broker", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def take_events(self) -> Iterator[BrokerEvent]:
        """Yield the events since the last call; if you stop early, the next call yields the rest."""
        self._something.clear()
        while self._news:
            news = self._news.popleft()
            if isinstance(news, IncomingMessage):
                self._waiting_bytes -= len(news.payload) + MESSAGE_OVERHEAD
            yield news

    def wait_for_event(self, seconds: float) -> None:
        self._something.wait(seconds)

    def publish(self, topic: str, payload: bytes, is_retained: bool = False) -> int | None:
        """Send a message with QoS 1. Return the number for its `PublishAck`, None if not connected."""
        client = self._client
        if client is None or not self._is_up:
            return None
        try:
            sent = client.publish(topic, payload, qos=1, retain=is_retained)
        except (OSError, ValueError):
            return None
        return sent.mid if sent.rc == 0 else None

    def subscribe(self, topics: tuple[tuple[str, int], ...]) -> int | None:
        """Subscribe to topics with their QoS. Return the number for the `SubAck`, None if not connected."""
        client = self._client
        if client is None or not self._is_up:
            return None
        try:
            code, number = client.subscribe([*topics])
        except (OSError, ValueError):
            return None
        return number if code == 0 else None

    def close(self, last: LastWill | None = None) -> None:
        """Publish `last`, retained. Wait at most CLOSE_WAIT_S for the acknowledgement, then disconnect."""
        number = None if last is None else self.publish(last.topic, last.payload, True)
        until = clock.now_ns() + int(CLOSE_WAIT_S * 1e9)
        while number is not None and self._is_up and clock.now_ns() < until:
            self.wait_for_event(LOOP_TIMEOUT_S)
            if any(
                isinstance(news, ConnectionLost | PublishRefusal) or news == PublishAck(number)
                for news in self.take_events()
            ):
                break
        self._ends.set()
        client = self._client
        if client is not None:
            client.disconnect()
        if self._thread.is_alive():
            self._thread.join(LOOP_TIMEOUT_S * 2)

    # -- the thread --------------------------------------------------------------------------------------

    def _add_event(self, news: BrokerEvent) -> None:
        if isinstance(news, IncomingMessage):
            if self._waiting_bytes > MOST_WAITING_BYTES:  # bounds the memory against a flood
                self.dropped += 1
                return
            self._waiting_bytes += len(news.payload) + MESSAGE_OVERHEAD
        self._news.append(news)
        self._something.set()

    def _run(self) -> None:
        pause = LEAST_PAUSE_S
        while not self._ends.is_set():
            self._why = ""
            try:
                self._client = client = self._new_client()
                client.connect(
                    self._broker.host, self._broker.port, KEEP_ALIVE_S, properties=_connect_properties()
                )
                client.loop_forever(LOOP_TIMEOUT_S)
            except Exception as failed:  # rule 1: whatever the broker sends only ends this connection
                self._why = self._why or _describe_failure(failed)
            was_up, self._is_up = self._is_up, False
            self._close_socket()
            if not self._ends.is_set():
                self._add_event(ConnectionLost(f"{self._broker}: {self._why or 'the connection ended'}"))
                pause = LEAST_PAUSE_S if was_up else min(MOST_PAUSE_S, pause * 1.5)
                self._ends.wait(max(pause, self._rival_pause))

    def _close_socket(self) -> None:
        client, self._client = self._client, None
        socket = client.socket() if client is not None else None
        if socket is not None:
            socket.close()

    def _new_client(self) -> Client:
        from paho.mqtt.client import Client, MQTTv5
        from paho.mqtt.enums import CallbackAPIVersion

        api = CallbackAPIVersion.VERSION2
        client = Client(api, self._id, protocol=MQTTv5, reconnect_on_failure=False)
        client.connect_timeout = CONNECT_TIMEOUT_S
        if self._broker.has_tls:
            client.tls_set_context(_tls_context(self._broker))
        if self._broker.user is not None:
            client.username_pw_set(self._broker.user, self._broker.password)
        if self._will is not None:
            client.will_set(self._will.topic, self._will.payload, qos=1, retain=True)
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_message = lambda _, __, message: self._add_event(
            IncomingMessage(message.topic, bytes(message.payload), message.retain)
        )
        client.on_publish = self._on_publish
        client.on_subscribe = self._on_subscribe
        # Rule 2: with this callback only the loop's thread writes. Without it `publish` writes, too: two
        # threads in one SSL object corrupt memory (paho issue 722), and without TLS they mix messages.
        client.on_socket_register_write = lambda *_: None
        return client

    def _on_connect(self, client: Client, _: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._why = one_line(f"the broker refuses: {reason}")
        elif self._topics:
            client.subscribe([(topic, 1) for topic in self._topics])
        else:
            self._become_connected()

    def _on_subscribe(self, client: Client, _: Any, number: int, reasons: Any, properties: Any) -> None:
        refused = [reason for reason in reasons if reason.is_failure]
        if refused:
            self._add_event(SubscribeRefusal(one_line(f"{self._broker} refuses to subscribe: {refused[0]}")))
        if self._is_up:
            self._add_event(SubAck(number))
        else:
            self._become_connected()

    def _become_connected(self) -> None:
        self._is_up, self._up_at = True, clock.now_ns()
        self._add_event(ConnAck())

    def _on_disconnect(self, client: Client, _: Any, flags: Any, reason: Any, properties: Any) -> None:
        is_certain = reason.value == SESSION_TAKEN_OVER
        is_short = self._is_up and not flags.is_disconnect_packet_from_server
        self._short = self._short + 1 if is_short and clock.now_ns() < self._up_at + SHORT_NS else 0
        if is_certain or self._short >= MOST_SHORT:  # not every broker sends the reason
            uses = "uses" if is_certain else "may use"
            self._why = f"another program {uses} the name '{one_line(self._id)}': each needs its own name"
            self._rival_pause = min(MOST_RIVAL_PAUSE_S, 2 * self._rival_pause or RIVAL_PAUSE_S)
        else:
            self._why = self._why or one_line(f"the connection ended: {reason}")
            self._rival_pause = 0.0

    def _on_publish(self, client: Client, _: Any, number: int, reason: Any, properties: Any) -> None:
        if reason is not None and reason.is_failure and reason.value != NO_SUBSCRIBERS:
            self._add_event(PublishRefusal(number, one_line(str(reason))))
        else:
            self._add_event(PublishAck(number))


def _connect_properties() -> Properties:
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    limits = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    limits.MaximumPacketSize = MOST_MESSAGE_BYTES + 4096
    return limits


def _describe_failure(failed: Exception) -> str:
    if isinstance(failed, UserError):
        return failed.lines()[0]
    if isinstance(failed, ssl.SSLCertVerificationError):
        return one_line(f"wrong certificate: {failed.verify_message}")
    if isinstance(failed, OSError):
        return one_line(failed.strerror or str(failed) or "no connection")
    return one_line(f"not an MQTT 5 broker: {failed}")
