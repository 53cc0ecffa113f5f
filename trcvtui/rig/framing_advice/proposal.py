"""What the advice on framings says: frozen proposals, the best first, each with its evidence in sentences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trcvtui.blocks.framing.frame import Framing
from trcvtui.rig.framing_advice.trial import LengthField, Placed

MOST_SHOWN: Final = 8  # frames of a preview
MOST_BYTES_SHOWN: Final = 48  # of each
NAMES: Final = {
    0x00: "NUL", 0x01: "SOH", 0x02: "STX", 0x03: "ETX", 0x04: "EOT", 0x05: "ENQ", 0x06: "ACK", 0x0A: "LF",
    0x0D: "CR", 0x09: "TAB", 0x15: "NAK", 0x17: "ETB", 0x1B: "ESC", 0x20: "SP",
}  # fmt: skip


class Kind(StrEnum):
    """What parts the frames."""

    PREFIX = "constant prefix"
    SUFFIX = "constant suffix"
    PREFIX_SUFFIX = "constant prefix and suffix"
    LENGTH = "length field"
    SIZE = "fixed size"
    GAP = "gap"


@dataclass(frozen=True, slots=True)
class ShownFrame:
    """One frame of a preview: its first bytes, how many it has, where it stands, what ended it."""

    content: bytes
    size: int
    start: int
    ending: str


@dataclass(frozen=True, slots=True)
class Proposal:
    """One way to cut the recording.

    `rank` counts from 1; proposals that cut alike share one. `framing` is what ReceiveData is to be set to,
    None: it cannot be (`field` says what parts the frames, `instead` what does it). `frames` of `of_frames`
    ended as they should and have `explained` of `total` bytes; `noise`, `left` and `broken` are the rest.
    `longest` is the longest frame; `bits` is the weight of the evidence: how much shorter it can be told.
    """

    rank: int
    kind: Kind
    title: str
    framing: Framing | None
    field: LengthField | None
    evidence: tuple[str, ...]
    doubt: tuple[str, ...]
    instead: str
    frames: int
    of_frames: int
    explained: int
    total: int
    noise: int
    left: int
    broken: int
    longest: int
    bits: float
    preview: tuple[ShownFrame, ...]

    @property
    def can_be_set(self) -> bool:
        """Return whether ReceiveData can cut so."""
        return self.framing is not None


@dataclass(frozen=True, slots=True)
class FramingAdvice:
    """The proposals, the best first, and in one sentence what they rest on, or why there are none."""

    proposals: tuple[Proposal, ...]
    said: str

    def text(self) -> str:
        """Return it as lines of text."""
        lines = [self.said]
        first: dict[int, int] = {}
        for number, each in enumerate(self.proposals, 1):
            alike = first.setdefault(each.rank, number)
            lines.append(f"{number}. {each.title}{f' (cuts as {alike} does)' if alike != number else ''}")
            lines += [f"   {sentence}" for sentence in (*each.evidence, *each.doubt)]
            lines += [f"   {each.instead}"] if each.instead else []
        return "\n".join(lines)


def shown(frames: tuple[Placed, ...]) -> tuple[ShownFrame, ...]:
    """Return the first frames, each cut to what can be shown."""
    return tuple(
        [
            ShownFrame(frame.content[:MOST_BYTES_SHOWN], len(frame.content), frame.start, str(frame.ending))
            for frame in frames[:MOST_SHOWN]
        ]
    )


def named(mark: bytes) -> str:
    """Return a mark as `0D 0A (CR LF)`."""
    names = [NAMES.get(byte, f"'{chr(byte)}'" if 0x20 < byte < 0x7F else "") for byte in mark]
    return f"{mark.hex(' ').upper()} ({' '.join(names)})" if all(names) else mark.hex(" ").upper()
