"""The ComBuffers of a project: which of them are written by a send block, which are fed by a TRCV_C."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from trcvtui.blocks.parameters import BUFFER_PIN
from trcvtui.plc.project import ComBufferDecl, InstanceDecl


def joined_up(
    buffers: Iterable[ComBufferDecl], instances: tuple[InstanceDecl, ...]
) -> tuple[ComBufferDecl, ...]:
    """Return the ComBuffers with what the instances make of them."""
    written = {i.connect for i in instances if BUFFER_PIN.get(i.block) == "TxBuffer"}
    names = {i.name for i in instances}
    return tuple([replace(b, is_written=b.name in written, is_fed=b.source in names) for b in buffers])
