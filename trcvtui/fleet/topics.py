"""Topics and messages on the broker: names, frozen structs, JSON in both directions.

Rule: everything from a broker may be hostile: size, depth, types and texts are checked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, NamedTuple
from urllib.parse import quote, unquote

import msgspec
from msgspec import Meta
from msgspec.structs import force_setattr

from trcvtui.errors import UserError, mistake, one_line

ROOT: Final = "trcvtui/v1"
MOST_MESSAGE_BYTES: Final = 1 << 18  # of one message; the MQTT CONNECT states a limit, too
MOST_TEXT_CHARS: Final = 200  # of one text
MOST_TOPIC_CHARS: Final = 1024
MOST_RECENT: Final = 64  # events that an agent retains of each instance
MOST_COUNT: Final = 1 << 53  # every JSON reader keeps integers up to here exactly
LEVEL_KINDS: Final = {1: ("state",), 2: ("figures",), 3: ("status", "event", "recent")}  # by names after SITE

SPECIAL_CHARS: Final = re.compile("[/+#%]")  # percent-encoded in a level of a topic

Scalar = str | int | float | bool | None


def _pattern_meta(pattern: str) -> Meta:
    # `$` alone accepts a line end after the text
    return Meta(pattern=f"^({pattern})(?!\n)$")


Count = Annotated[int, Meta(ge=0, le=MOST_COUNT)]
Number = Annotated[float, Meta(ge=-MOST_COUNT, le=MOST_COUNT)]
Code = Annotated[str, _pattern_meta("[0-9A-F]{4}")]
EventId = Annotated[str, _pattern_meta("[0-9a-f]{1,32}-[0-9]{1,16}")]


class Topic(NamedTuple):
    """The parts of a topic. If its kind has no line or instance, `line` or `instance` is ""."""

    site: str
    agent: str
    line: str
    instance: str
    kind: str

    def __str__(self) -> str:
        names = (self.site, self.agent, self.line, self.instance)
        return "/".join((ROOT, *(encode_level(name) for name in names if name), self.kind))


def encode_level(name: str) -> str:
    """Return a name as one level of a topic: `/ + # %` and control characters are percent-encoded."""
    if name.isprintable() and not SPECIAL_CHARS.search(name):
        return name
    return "".join(c if c.isprintable() and c not in "/+#%" else quote(c, safe="") for c in name)


def parse_topic(text: str) -> Topic:
    """Return the parts of a topic; raise UserError for a topic that no agent writes."""
    head, _, rest = text[: MOST_TOPIC_CHARS + 1].partition(f"{ROOT}/")
    *names, kind = rest.split("/")
    try:
        plain = [unquote(name, errors="strict") for name in names]
    except UnicodeDecodeError:
        plain = []
    is_ours = not head and len(text) <= MOST_TOPIC_CHARS and kind in LEVEL_KINDS.get(len(plain) - 1, ())
    # Only one spelling of each name: otherwise one agent could appear twice.
    if not is_ours or not all(plain) or [encode_level(name) for name in plain] != names:
        raise mistake("broker", f"the topic '{_clip(text)}'", f"{ROOT}/SITE/AGENT/...")
    site, agent, line, instance = [*plain, "", ""][:4]
    return Topic(site, agent, line, instance, kind)


# -- messages ------------------------------------------------------------------------------------------------


class FleetMessage(msgspec.Struct, frozen=True):
    """Base of all messages; each has a time `t` in seconds of UTC since 1970."""

    KIND: ClassVar[str]  # the last level of the topic
    TEXTS: ClassVar[tuple[str, ...]] = ()  # fields with free text: it is cut, control characters spelled out

    def __post_init__(self) -> None:
        for name in self.TEXTS:
            force_setattr(self, name, _clip(getattr(self, name)))

    def to_json(self) -> bytes:
        return msgspec.json.encode(self)


class StateMessage(FleetMessage, frozen=True):
    """The state of an agent: online, stale (no new scan), offline (by its last will)."""

    KIND = "state"
    TEXTS = ("version", "host")
    state: Annotated[str, _pattern_meta("online|stale|offline")]
    t: Number
    version: str
    host: str


class StatusMessage(
    FleetMessage,
    frozen=True,
    rename={"status": "STATUS", "busy": "BUSY", "done": "DONE", "error": "ERROR", "jobs_done": "done"},
):
    """The outputs of an instance, unchanged for `age_s` seconds. The job has `here` of `wanted` bytes."""

    KIND = "status"
    TEXTS = ("text", "finding")
    t: Number
    status: Code
    text: str
    busy: bool
    done: bool
    error: bool
    jobs_done: Count
    errors: Count
    here: Count
    wanted: Count
    age_s: Number
    finding: str = ""  # the doctor's surest cause, "": it has found nothing


class EventMessage(FleetMessage, frozen=True, rename={"status": "STATUS"}):
    """One ERROR edge, finding or note. `id` is BOOT-SEQ: SEQ counts from 1 in each instance without gaps."""

    KIND = "event"
    id: EventId
    t: Number
    kind: Annotated[str, _pattern_meta("error|finding|note")]
    status: Code | None
    cause: Annotated[dict[str, Any], Meta(max_length=MOST_RECENT)]  # values: Scalar

    def __post_init__(self) -> None:
        force_setattr(self, "cause", {_clip(name): _clean_scalar(each) for name, each in self.cause.items()})


class FiguresMessage(
    FleetMessage, frozen=True, rename={"received": "received_bytes_s", "sent": "sent_bytes_s"}
):
    """The figures of a line. Rates in bytes per second."""

    KIND = "figures"
    TEXTS = ("state",)
    t: Number
    state: str
    received: Number
    sent: Number
    done_a_minute: Number
    errors_an_hour: Number


class RecentMessage(FleetMessage, frozen=True):
    """The newest events of an instance, oldest first. `count` counts all events since the agent started."""

    KIND = "recent"
    t: Number
    count: Count
    events: Annotated[tuple[EventMessage, ...], Meta(max_length=MOST_RECENT)]


AnyMessage = StateMessage | StatusMessage | EventMessage | FiguresMessage | RecentMessage
MESSAGE_TYPES: Final[Mapping[str, type[AnyMessage]]] = {
    made.KIND: made for made in (StateMessage, StatusMessage, EventMessage, FiguresMessage, RecentMessage)
}


def parse_message(topic: Topic, payload: bytes) -> AnyMessage | None:
    """Return the message of a topic, None: the topic is cleared; raise UserError for a bad message."""
    if not payload:
        return None
    if len(payload) > MOST_MESSAGE_BYTES:
        raise _make_refusal(topic, f"{len(payload)} bytes", f"{MOST_MESSAGE_BYTES} at most")
    try:
        return msgspec.json.decode(payload, type=MESSAGE_TYPES[topic.kind])
    except (msgspec.MsgspecError, ValueError, RecursionError) as wrong:
        raise _make_refusal(topic, f"'{_clip(str(wrong))}'", "a message of an agent") from None


def _make_refusal(topic: Topic, found: str, expected: str) -> UserError:
    return mistake(f"broker, {_clip(str(topic))}", found, expected)


def _clean_scalar(value: object) -> Scalar:
    """Return a value of a cause, or `?` if the value is not allowed."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if abs(value) <= MOST_COUNT and math.isfinite(value) else "?"  # JSON has no NaN
    if isinstance(value, str):
        return _clip(value)
    return value if value is None or isinstance(value, bool) else "?"


def _clip(text: str) -> str:
    return one_line(text[:MOST_TEXT_CHARS])
