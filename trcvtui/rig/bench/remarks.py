"""What a command does other than one might think: said with its answer, and the command is carried out."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.plc.snapshot import InstanceSnapshot, Snapshot
from trcvtui.rig.commands import words as words
from trcvtui.rig.wording import count

RESET: Final = "COM_RST"
LATCHED: Final = ("LEN", "ADHOC")  # read when a job starts (design 6, row 17)
CONNECTED, NO_EFFECT = "connected", "without effect"


def remark_on(command: words.BenchCommand, snapshot: Snapshot) -> str:
    """Return the remark on a command that was given after this snapshot, mostly ""."""
    match command:
        case words.Pulse(name, "COM_RST"):
            return _on_reset(_instance(snapshot, name), snapshot)
        case words.Set(name, pins):
            instance = _instance(snapshot, name)
            said = [_on_latched(instance, *pin) for pin in pins if pin[0] in LATCHED]
            if any(pin == RESET and value for pin, value in pins):
                said.append(_on_reset(instance, snapshot))
            return "; ".join(filter(None, said))
    return ""


def _instance(snapshot: Snapshot, name: str) -> InstanceSnapshot | None:
    return next((each for each in snapshot.instances if each.name == name), None)


def _on_reset(instance: InstanceSnapshot | None, snapshot: Snapshot) -> str:
    """Say when a rising edge of COM_RST does nothing and is not remembered (design 6, row 13)."""
    if instance is None:
        return ""
    link = next((each for each in snapshot.connections if each.name == instance.connect), None)
    stands = link is not None and link.state == CONNECTED
    if not instance.pin("CONT") and (not stands or instance.condition == Condition.NO_JOB):
        return f"{NO_EFFECT}: CONT is 0, and the edge is not remembered"
    return (
        "" if stands else f"{NO_EFFECT}: {instance.connect} is not connected, and the edge is not remembered"
    )


def _on_latched(instance: InstanceSnapshot | None, pin: str, value: object) -> str:
    """Say when an input counts from the next job on only."""
    if instance is None or not instance.need or instance.pin(pin) == value:
        return ""
    return f"from the next job: the one that runs goes on with {count(instance.need, 'byte')}"
