"""For a new instance, a form proposes the newest possible part of the project, or else `new`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from trcvtui.blocks.table import BlockRow, block_row
from trcvtui.project.project import Project

NEW: Final = "new"  # as a value in a line: the part is created


def propose_part(kind: str) -> Callable[[Project, str], str]:
    """Return a function that proposes a project's part of this kind for a block."""
    return lambda project, block: _find_free_part(kind, project, block_row(block))


def _find_free_part(kind: str, project: Project, row: BlockRow) -> str:
    is_for_one = kind in ("addr", "data")
    taken = {name for i in project.instances for name in (i.addr, i.data, *i.pointers) if is_for_one}
    on = [(i.connect, block_row(i.block)) for i in project.instances if not is_for_one]
    fits = [c for c in project.connects if c.is_datagram == row.speaks_udp or not row.uses_network]
    if (
        (kind == "connect" and row.speaks_udp and not fits)
        or (kind == "udp_config" and row.datagrams and fits)
        or (kind == "addr" and not row.speaks_udp)
    ):
        return ""
    parts: Sequence[Any] = {
        "connect": fits, "udp_config": project.udp_configs, "combuffer": project.combuffers,
        "addr": project.addrs, "data": project.data,
    }[kind]  # fmt: skip
    names = (each.name for each in reversed(parts) if each.name not in taken)
    return next((n for n in names if not any(at == n and _competes(row, r) for at, r in on)), NEW)


def _competes(row: BlockRow, other: BlockRow) -> bool:
    """Return whether two blocks cannot share a part; a sender and a receiver can share a CONNECT."""
    if row.id_alone:
        return False  # it uses a connection that another block has established
    if row.has_com_buffer:
        is_user = row.reads_rx_buffer or row.writes_tx_buffer
        return is_user and (other.reads_rx_buffer or other.writes_tx_buffer)
    same_way = (row.receives_on_net and other.receives_on_net) or (row.sends_on_net and other.sends_on_net)
    return same_way or (_opens_link(row) and _opens_link(other) and not (row.owns_link and other.owns_link))


def _opens_link(row: BlockRow) -> bool:
    return row.owns_link or (row.has_id and not row.id_alone)  # TCON
