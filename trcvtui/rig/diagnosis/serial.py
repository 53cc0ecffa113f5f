"""What to look at when a block on a ComBuffer shows an error (ComError_t)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.wording import count, port_away, port_hint

Rule = Callable[[Evidence], str]


def _says(text: str) -> Rule:
    return lambda e: text


def _overrun(e: Evidence) -> str:
    size = e.pin("SizeReceiveData")
    frame = f"{count(size, 'byte')} came" if size else "the size was reached"
    return (
        f"{frame} without the suffix: the suffix differs, or frames are longer; `framing {e.instance}` tells"
    )


def _size(e: Evidence) -> str:
    found = e.pin("SizeReceiveData")
    room = f"1 to {e.data_size}, the size of {e.data}" if e.data_size else "what the variable holds"
    is_found = f"SizeReceiveData is {found}: it" if found is not None else "SizeReceiveData"
    return f"{is_found} has to be {room}"


def _string(e: Evidence) -> str:
    return f"the text is longer than the string, or its suffix differs: `framing {e.instance}` tells"


# Where nothing is wrong with the block itself, it waits for the line.
WAITS: Final = frozenset(
    {Condition.FRAME_AWAITED, Condition.FRAME_PART, Condition.BUFFER_EMPTY, Condition.SENDING}
)


def waits_for_the_port(e: Evidence) -> str:
    """Return that the port is not there, for a block that waits for what comes or goes over it."""
    return port_away(e.buffer) if e.condition in WAITS and not e.cause.pin else ""


def _port(e: Evidence) -> str:
    away, hint = port_away(e.buffer), port_hint(e.buffer)
    return hint if waits_for_the_port(e) else ": ".join(part for part in (away, hint) if part)


ALWAYS: Final[tuple[Rule, ...]] = (_port,)
NEXT: Final[dict[Condition, tuple[Rule, ...]]] = {
    Condition.PARAMETER_CHANGED: (
        _says("prefix, suffix, size and data have to stay while a frame is half here; Reset before a change"),
    ),
    Condition.SEND_OVERRUN: (_says("send less at a time, or give the ComBuffer a larger `size`"),),
    Condition.STRING_OVERRUN: (_string,),
    Condition.ZERO_CHARACTER: (_says("a byte 00 is no character: bytes of any value are for ReceiveData"),),
    Condition.NULL_POINTER: (
        _says("the length is larger than the variable that the pointer names, or there is none"),
    ),
    Condition.NULL_RECEIVE_POINTER: (_says("`data` has to name the variable that takes what is received"),),
    Condition.RECEIVE_LENGTH_WRONG: (_size,),
    Condition.DATA_OVERRUN: (_overrun,),
}
