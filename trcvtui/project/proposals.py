"""What a form proposes for a new instance to work on: the newest part that is free for it, else `new`."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.table import BlockRow, block_row
from trcvtui.project.project import Project

NEW: Final = "new"  # in a line: one is made


def free_connect(project: Project, block: str) -> str:
    row = block_row(block)
    fits = [c.name for c in project.connects if c.is_datagram == row.speaks_udp or not row.moves_bytes]
    return _free(fits, project, row) if fits or not row.speaks_udp else ""


def free_config(project: Project, block: str) -> str:
    return (
        ""
        if free_connect(project, block)
        else _free([c.name for c in project.udp_configs], project, block_row(block))
    )


def free_buffer(project: Project, block: str) -> str:
    return _free([buffer.name for buffer in project.combuffers], project, block_row(block))


def free_addr(project: Project, block: str) -> str:
    taken = {each.addr for each in project.instances}
    free = (each.name for each in reversed(project.addrs) if each.name not in taken)
    return next(free, NEW) if block_row(block).speaks_udp else ""


def free_data(project: Project, block: str) -> str:
    taken = {name for each in project.instances for name in (each.data, *each.pointers)}
    return next((each.name for each in reversed(project.data) if each.name not in taken), NEW)


def _free(names: list[str], project: Project, row: BlockRow) -> str:
    rows = [(each.connect, block_row(each.block)) for each in project.instances]
    is_free = (
        name for name in reversed(names) if not any(at == name and _is_in_the_way(row, r) for at, r in rows)
    )
    return next(is_free, NEW)


def _is_in_the_way(row: BlockRow, other: BlockRow) -> bool:
    """Return whether a block wants what another one works on for itself: not for the other direction."""
    if row.id_alone or (row.on_buffer and not (row.reads_buffer or row.writes_buffer)):
        return False  # it works on what another one has built
    if row.on_buffer:
        return other.reads_buffer or other.writes_buffer
    same_way = (row.receives and other.receives) or (row.sends and other.sends)
    return same_way or (_opens(row) and _opens(other) and not (row.builds and other.builds))


def _opens(row: BlockRow) -> bool:
    return row.builds or (row.has_id and not row.id_alone)  # TCON
