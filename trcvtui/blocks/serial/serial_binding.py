"""What an instance on a ComBuffer is tied to."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.serial.com_buffer import ComBuffer
from trcvtui.blocks.table import BlockRow


@dataclass(frozen=True, slots=True)
class SerialBinding:
    """`data`, `prefix` and `suffix` None: the pointer is 0. `priority` is that of its task."""

    env: Environment
    buffer: ComBuffer
    data: DataArea | None
    prefix: DataArea | None
    suffix: DataArea | None
    instance: str
    priority: int = 1

    def class_of(self, row: BlockRow) -> str:
        """Return the class of a block on a ComBuffer."""
        return row.serial
