"""What the bytes tell: a frame that ends elsewhere than the peer's message, as the ledger proves it."""

from __future__ import annotations

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.formatting import count, plain
from trcvtui.tui.view_model.byte_origin import Provenance, Span


def notes_of(instance: InstanceSnapshot, provenance: Provenance) -> list[str]:
    """Return what is proven about frames and messages of an instance; nothing where they agree."""
    if instance.adhoc:
        return []
    return [*_shifted(instance, provenance), *_unfinished(instance, provenance)]


def _shifted(instance: InstanceSnapshot, provenance: Provenance) -> list[str]:
    """A message that begins inside DATA with the end of another one before it: the frames are shifted."""
    messages = provenance.messages(instance.name, of_job=False)
    if not messages or messages[-1].offset >= 0:
        return []
    if len(messages) == 1:
        return [_part(messages[0])]
    first = messages[-2]
    return [f"{_name(first)} begins at byte {first.offset} of DATA: frames and messages are shifted"]


def _part(message: Span) -> str:
    return f"DATA begins with byte {-message.offset} of {_name(message)}: one message fills several frames"


def _unfinished(instance: InstanceSnapshot, provenance: Provenance) -> list[str]:
    """The newest message is wholly here, and the job still waits for bytes that nobody has sent."""
    messages = provenance.messages(instance.name, of_job=True)
    if not messages or not 0 < instance.have < instance.need:
        return []
    newest = messages[0]
    if newest.offset + newest.size != instance.have:
        return []
    missing = count(instance.need - instance.have, "byte")
    return [f"{_name(newest)}, {newest.size} B, is wholly here and ends {missing} before the frame does"]


def _name(message: Span) -> str:
    return f"{plain(message.peer)}'s message {message.number}"
