"""The fields of a new ComBuffer, and of a block that works on one."""

from __future__ import annotations

from collections.abc import Sequence

from trcvtui.plc.wired_pins import buffer_pin, data_pin, mark_pins
from trcvtui.project.edit import names_of
from trcvtui.project.project import SERIAL, SIMULATED, Project
from trcvtui.tui.forms.add_described import AddField


def last_of(names: tuple[str, ...]) -> str:
    """Return the newest of these names, "" where there is none."""
    return names[-1] if names else ""


def block_field(project: Project, block: str) -> AddField:
    """Return the field of the block."""
    return AddField("block", "a block", project.dialect.blocks, block)


def buffered_fields(project: Project, block: str) -> Sequence[AddField]:
    """Return the fields of an instance on a ComBuffer, by the names of its pins."""
    buffers, data = names_of("combuffer", project), names_of("data", project)
    fields = [
        block_field(project, block),
        AddField(buffer_pin(block), "a ComBuffer", buffers, last_of(buffers)),
    ]
    if data_pin(block):
        fields.append(AddField("data", f"the variable of {data_pin(block)}", data, last_of(data)))
    fields += [AddField(pin, f"{mark}, none: 0", ("", *data)) for pin, mark in mark_pins(block).items()]
    return [
        *fields,
        AddField("task", "a task", tuple(task.name for task in project.tasks), project.tasks[0].name),
        AddField("inputs", _inputs_like(project, block)),
    ]


def _inputs_like(project: Project, block: str) -> str:
    names = [pin.name for pin in project.pins(block) if pin.direction != "out"]
    shown = [name for name in ("SizeReceiveData", "Length", "SendByte", "Timeout", "EN") if name in names]
    return f"such as {' '.join(f'{name}=1' for name in shown[:1])}" if shown else "none"


def combuffer_fields(project: Project) -> Sequence[AddField]:
    """Return the fields of a ComBuffer; an empty one is its default."""
    streams = {b: tuple(i.name for i in project.instances if i.block == b) for b in ("TRCV_C", "TSEND_C")}
    ports = tuple(buffer.name for buffer in project.combuffers if buffer.serial is not None)
    sources = (SIMULATED, SERIAL, *streams["TRCV_C"], *names_of("combuffer", project))
    return [
        AddField("source", "where bytes come from", sources, SIMULATED),
        AddField("port", "serial: a device, socket://"),
        AddField("baud", "serial: 9600"),
        AddField("parity", "serial: none", ("none", "even", "odd", "mark", "space")),
        AddField("stop_bits", "serial: 1", ("1", "1.5", "2")),
        AddField("data_bits", "serial: 8", ("8", "7", "6", "5")),
        AddField("handshake", "serial: none", ("none", "rts/cts", "dsr/dtr", "xon/xoff")),
        AddField("line", "what sends what is written", ("", *ports, *streams["TSEND_C"])),
        AddField("size", "bytes that have room, 300"),
        AddField("per_cycle", "bytes a scan, 0: all"),
    ]
