"""`[[combuffer]]`: read, and joined up with the instances: who writes it, who feeds it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Final

from trcvtui.blocks.parameters import BUFFER_PIN
from trcvtui.net.serial_line import SerialSettings
from trcvtui.project.parts import NAME
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, InstanceDecl
from trcvtui.project.tables import TEXT, Kind, Table, of_text, shown, whole

QUEUE_SIZE: Final = whole(1, 65_536)
BAUD: Final = whole(50, 4_000_000)
DATA_BITS: Final = whole(5, 8)
PORT_KEYS: Final = ("port", "baud", "data_bits", "parity", "stop_bits", "handshake")


def _one_of(*words: str) -> Kind[str]:
    return of_text(" or ".join(words), lambda text: text if text in words else None)


def _stop_bits(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and value in (1, 1.5, 2) else None


STOP_BITS: Final = Kind("1, 1.5 or 2", _stop_bits, lambda text: {"1": 1.0, "1.5": 1.5, "2": 2.0}.get(text))
PARITY: Final = _one_of("none", "even", "odd", "mark", "space")
HANDSHAKE: Final = _one_of("none", "rts/cts", "dsr/dtr", "xon/xoff")
PORT_NAME: Final = of_text("the name of a port, such as /dev/ttyUSB0", lambda text: text.strip() or None)

# What one ComBuffer alone may name: what the one has in it, and what the other has to name.
ENDS: Final = (
    ("source", "whose bytes go to {}", "a source of its own: each byte goes to one ComBuffer"),
    ("line", "over which {} goes out", "a line of its own: one ComBuffer goes out over it"),
    ("port", "the port of {}", "a port of its own"),
)


def read_combuffer(table: Table) -> ComBufferDecl | None:
    """Return one ComBuffer."""
    name = table.must("name", NAME)
    source = table.get("source", TEXT, SIMULATED)
    size = table.get("size", QUEUE_SIZE, 0)
    per_cycle = table.get("per_cycle", QUEUE_SIZE, 0)
    line = table.get("line", TEXT, "")
    serial = None
    if source == SERIAL:
        serial = _read_serial(table)
    else:
        _refuse_port_keys(table)
    table.finish()
    if name is None:
        return None
    return ComBufferDecl(name, source, size, per_cycle, serial=serial, line=line)


def _read_serial(table: Table) -> SerialSettings | None:
    settings = SerialSettings(
        table.must("port", PORT_NAME) or "",
        table.get("baud", BAUD, 9600),
        table.get("data_bits", DATA_BITS, 8),
        table.get("parity", PARITY, "none"),
        table.get("stop_bits", STOP_BITS, 1.0),
        table.get("handshake", HANDSHAKE, "none"),
    )
    return settings if settings.port else None


def _refuse_port_keys(table: Table) -> None:
    for key in PORT_KEYS:
        if table.has(key):
            table.know(key)
            table.wrong(key, "a word of serial ports", 'source = "serial" beside it')


def find_shared_ends(tables: Sequence[Table]) -> None:
    """Record every source, line and port that an earlier ComBuffer has, and a cable from one with a line.

    Of a URL each opening is a connection of its own.
    """
    for key, has, expected in ENDS:
        seen: dict[str, str] = {}
        for table in tables:
            end, name = table.text(key), table.text("name")
            if not end or not name or end in (SIMULATED, SERIAL) or (key == "port" and "://" in end):
                continue
            if end in seen:
                table.wrong(key, f"{shown(end)}, {has.format(seen[end])}", expected)
            seen.setdefault(end, name)
    lines = {table.text("name"): table.text("line") for table in tables}
    for table in tables:
        source = table.text("source")
        if source and lines.get(source):
            found = f"{shown(source)}, which goes out over {lines[source]}"
            table.wrong("source", found, "a ComBuffer without a line")


def joined_up(
    buffers: Iterable[ComBufferDecl], instances: tuple[InstanceDecl, ...]
) -> tuple[ComBufferDecl, ...]:
    """Return the ComBuffers with what the instances make of them."""
    written = {i.connect for i in instances if BUFFER_PIN.get(i.block) == "TxBuffer"}
    names = {i.name for i in instances}
    return tuple([replace(b, is_written=b.name in written, is_fed=b.source in names) for b in buffers])
