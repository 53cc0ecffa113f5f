"""What goes over the broker: names of topics, messages as frozen records, JSON there and back.

Rule: what comes from a broker is hostile: its size, depth, types and texts are checked, nothing is believed.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar, Final, TypeVar
from urllib.parse import quote, unquote

from trcvtui.errors import mistake, one_line
from trcvtui.records import NamedTuple, dataclass

ROOT: Final = "trcvtui/v1"
MOST_BYTES: Final = 1 << 18  # of one message; a connection tells the broker so, too
MOST_TEXT: Final = 200  # characters of one text
MOST_TOPIC: Final = 1024  # characters
MOST_RECENT: Final = 64  # events that an agent retains of each instance
MOST_COUNT: Final = 1 << 53  # what every reader of JSON keeps exactly
EVENT_KINDS: Final = ("error", "finding", "note")
KINDS_AT: Final = {1: ("state",), 2: ("figures",), 3: ("status", "event", "recent")}  # by names after SITE

SPECIAL: Final = re.compile("[/+#%]")  # what a level of a topic has not, as it is

Scalar = str | int | float | bool | None
Kind = TypeVar("Kind", bound="FleetMessage")


class Topic(NamedTuple):
    """Whom a message is about: `line` and `instance` are "" where its kind has none."""

    site: str
    agent: str
    line: str
    instance: str
    kind: str

    def __str__(self) -> str:
        """Return the topic as the broker knows it."""
        names = (self.site, self.agent, self.line, self.instance)
        return "/".join((ROOT, *(encoded(name) for name in names if name), self.kind))


def encoded(name: str) -> str:
    """Return a name as one level of a topic: `/ + # %` and control characters are percent-encoded."""
    if name.isprintable() and not SPECIAL.search(name):
        return name
    return "".join(c if c.isprintable() and c not in "/+#%" else quote(c, safe="") for c in name)


def topic_of(text: str) -> Topic:
    """Return what a topic names; raise UserError for one that no agent writes."""
    head, _, rest = text[: MOST_TOPIC + 1].partition(f"{ROOT}/")
    *names, kind = rest.split("/")
    try:
        plain = [unquote(name, errors="strict") for name in names]
    except UnicodeDecodeError:
        plain = []
    is_ours = not head and len(text) <= MOST_TOPIC and kind in KINDS_AT.get(len(plain) - 1, ())
    if not is_ours or not all(plain) or [encoded(name) for name in plain] != names:
        raise mistake("broker", f"the topic '{_cut(text)}'", f"{ROOT}/SITE/AGENT/...")
    site, agent, line, instance = [*plain, "", ""][:4]
    return Topic(site, agent, line, instance, kind)


# -- messages: a row for each key ----------------------------------------------------------------------------


class MessageKey(NamedTuple):
    """One key of a message: its name in JSON, the field of the record, what its value is.

    `what`: text, flag, count, number, or one of the names in PATTERNS; `or_null`: it may be unknown.
    """

    key: str
    field: str
    what: str
    or_null: bool = False


PATTERNS: Final = {
    "STATUS": re.compile(r"[0-9A-F]{4}"),
    "state": re.compile(r"online|offline"),
    "kind": re.compile("|".join(EVENT_KINDS)),
    "id": re.compile(r"[0-9a-f]{1,32}-[0-9]{1,16}"),
}
TIME: Final = MessageKey("t", "t", "number")  # seconds of UTC since 1970


class FleetMessage:
    """What all messages have: their kind, as the topic ends, and their keys."""

    KIND: ClassVar[str]
    KEYS: ClassVar[tuple[MessageKey, ...]]

    def to_json(self) -> bytes:
        """Return what is published."""
        return json.dumps(self.plain(), separators=(",", ":"), allow_nan=False).encode()

    def plain(self) -> dict[str, Any]:
        """Return the keys with their values."""
        return {key.key: getattr(self, key.field) for key in self.KEYS}

    @classmethod
    def from_plain(cls: type[Kind], found: object, where: object) -> Kind:
        """Return the record of a JSON value; raise UserError."""
        if not isinstance(found, dict):
            raise mistake(str(where), "no object", f"the keys of {cls.KIND}")
        return cls(**{key.field: _value(key, found, where) for key in cls.KEYS})

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON schema."""
        return {
            "title": cls.KIND,
            "type": "object",
            "properties": {key.key: _schema_of(key) for key in cls.KEYS},
            "required": [key.key for key in cls.KEYS],
        }


@dataclass(frozen=True, slots=True)
class StateMessage(FleetMessage):
    """Whether an agent is there; its last will says offline. `state`: online, offline."""

    KIND: ClassVar[str] = "state"
    KEYS: ClassVar[tuple[MessageKey, ...]] = (
        MessageKey("state", "state", "state"),
        TIME,
        MessageKey("version", "version", "text"),
        MessageKey("host", "host", "text"),
    )
    state: str
    t: float
    version: str
    host: str

    def offline(self, t: float) -> StateMessage:
        """Return what its last will would have told."""
        return StateMessage("offline", t, self.version, self.host)


@dataclass(frozen=True, slots=True)
class StatusMessage(FleetMessage):
    """The outputs of an instance. `here` of `wanted` bytes are in its job; it shows this for `age_s`."""

    KIND: ClassVar[str] = "status"
    KEYS: ClassVar[tuple[MessageKey, ...]] = (
        TIME,
        MessageKey("STATUS", "status", "STATUS"),
        MessageKey("text", "text", "text"),
        MessageKey("BUSY", "busy", "flag"),
        MessageKey("DONE", "done", "flag"),
        MessageKey("ERROR", "error", "flag"),
        MessageKey("done", "jobs_done", "count"),
        MessageKey("errors", "errors", "count"),
        MessageKey("here", "here", "count"),
        MessageKey("wanted", "wanted", "count"),
        MessageKey("age_s", "age_s", "number"),
    )
    t: float
    status: str
    text: str
    busy: bool
    done: bool
    error: bool
    jobs_done: int
    errors: int
    here: int
    wanted: int
    age_s: float


@dataclass(frozen=True, slots=True)
class EventMessage(FleetMessage):
    """One ERROR edge, finding or note. `id` is BOOT-SEQ: SEQ counts from 1 in each instance without gaps."""

    KIND: ClassVar[str] = "event"
    KEYS: ClassVar[tuple[MessageKey, ...]] = (
        MessageKey("id", "id", "id"),
        TIME,
        MessageKey("kind", "kind", "kind"),
        MessageKey("STATUS", "status", "STATUS", True),
        MessageKey("cause", "cause", "cause"),
    )
    id: str
    t: float
    kind: str
    status: str | None
    cause: Mapping[str, Scalar]


@dataclass(frozen=True, slots=True)
class FiguresMessage(FleetMessage):
    """How a line runs. Rates in bytes a second; None: this system does not say."""

    KIND: ClassVar[str] = "figures"
    KEYS: ClassVar[tuple[MessageKey, ...]] = (
        TIME,
        MessageKey("state", "state", "text"),
        MessageKey("received_bytes_s", "received", "number"),
        MessageKey("sent_bytes_s", "sent", "number"),
        MessageKey("done_a_minute", "done_a_minute", "number"),
        MessageKey("errors_an_hour", "errors_an_hour", "number"),
        MessageKey("round_trip_ms", "round_trip_ms", "number", True),
        MessageKey("retransmissions", "retransmissions", "count", True),
    )
    t: float
    state: str
    received: float
    sent: float
    done_a_minute: float
    errors_an_hour: float
    round_trip_ms: float | None = None
    retransmissions: int | None = None


@dataclass(frozen=True, slots=True)
class RecentMessage(FleetMessage):
    """The newest events of an instance, the oldest first, and how many there were since the agent began."""

    KIND: ClassVar[str] = "recent"
    KEYS: ClassVar[tuple[MessageKey, ...]] = (
        TIME,
        MessageKey("count", "count", "count"),
        MessageKey("events", "events", "events"),
    )
    t: float
    count: int
    events: tuple[EventMessage, ...]

    def plain(self) -> dict[str, Any]:
        """Return the keys with their values."""
        return {"t": self.t, "count": self.count, "events": [event.plain() for event in self.events]}


MESSAGES: Final[dict[str, type[FleetMessage]]] = {
    made.KIND: made for made in (StateMessage, StatusMessage, EventMessage, FiguresMessage, RecentMessage)
}


class FromTopic(NamedTuple):
    """Where a message came from; as text it is asked for when something is wrong."""

    topic: Topic

    def __str__(self) -> str:
        """Return it in words."""
        return f"broker, {_cut(str(self.topic))}"


def read(topic: Topic, payload: bytes) -> FleetMessage | None:
    """Return the message of a topic, None: the topic is cleared; raise UserError for what is no message."""
    where = FromTopic(topic)
    if len(payload) > MOST_BYTES:
        raise mistake(str(where), f"{len(payload)} bytes", f"{MOST_BYTES} at most")
    if not payload:
        return None
    try:
        found = JSON.decode(payload.decode())
    except (ValueError, RecursionError):
        raise mistake(str(where), "no JSON", "a message of an agent") from None
    return MESSAGES[topic.kind].from_plain(found, where)


def _refuse(name: str) -> float:
    raise ValueError(name)


JSON: Final = json.JSONDecoder(parse_constant=_refuse)


def _value(key: MessageKey, found: Mapping[str, Any], where: object) -> Any:
    value = found.get(key.key)
    if value is None and key.or_null:
        return None
    match key.what, value:
        case "flag", bool():
            return value
        case "count", int() if not isinstance(value, bool) and 0 <= value <= MOST_COUNT:
            return value
        case "number", int() | float() if not isinstance(value, bool) and _is_sane(value):
            return value
        case "text", str():
            return _cut(value)
        case (("STATUS" | "state" | "kind" | "id"), str()) if PATTERNS[key.what].fullmatch(value):
            return value
        case "cause", dict() if len(value) <= MOST_RECENT:
            return {_cut(name): _scalar(each) for name, each in value.items()}
        case "events", list() if len(value) <= MOST_RECENT:
            return tuple(EventMessage.from_plain(each, where) for each in value)
    shown = _cut(repr(value)[: 2 * MOST_TEXT]) if isinstance(value, Scalar) else "a list or an object"
    raise mistake(f"{where}: {key.key}", shown, WANTED[key.what])


WANTED: Final = {
    "flag": "true or false",
    "count": "a whole number from 0 on",
    "number": "a number",
    "text": "text",
    "STATUS": "four hexadecimal digits",
    "state": "online or offline",
    "kind": "one of " + ", ".join(EVENT_KINDS),
    "id": "BOOT-SEQ",
    "cause": "an object",
    "events": f"a list of {MOST_RECENT} events at most",
}


def _is_sane(value: float) -> bool:
    return abs(value) <= MOST_COUNT and math.isfinite(value)


def _scalar(value: object) -> Scalar:
    """Return a value of a cause; what is none becomes text."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int | float):
        return value if _is_sane(value) else "?"
    return _cut(value) if isinstance(value, str) else "?"


def _cut(text: str) -> str:
    return one_line(text[:MOST_TEXT])


def _schema_of(key: MessageKey) -> dict[str, Any]:
    kinds: dict[str, dict[str, Any]] = {
        "flag": {"type": "boolean"},
        "count": {"type": "integer", "minimum": 0, "maximum": MOST_COUNT},
        "number": {"type": "number"},
        "text": {"type": "string"},
        "cause": {"type": "object"},
        "events": {"type": "array", "maxItems": MOST_RECENT, "items": {"$ref": "#/$defs/event"}},
    }
    made = kinds.get(key.what)
    if made is None:
        made = {"type": "string", "pattern": f"^({PATTERNS[key.what].pattern})$"}
    return {"anyOf": [made, {"type": "null"}]} if key.or_null else made
