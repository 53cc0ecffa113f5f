"""`prefix RD hex 02` as a frozen value, and what the PLC is told by it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from trcvtui.plc import commands

NONE: Final = "none"


@dataclass(frozen=True, slots=True)
class SetMark:
    """`suffix RD hex 0D 0A`, `prefix RD none`; `pin` is the length, "" of a STRING."""

    instance: str
    mark: str
    payload: bytes
    data: str
    pin: str
    size: int  # of the variable
    text: str = field(default="", compare=False)

    def orders(self) -> tuple[commands.Command, ...]:
        """Return what the PLC is told; all of it takes effect in the same scan."""
        content = self.payload if self.pin else (self.payload + b"\0")[: self.size]
        write = (commands.WriteData(self.data, 0, content),) if content else ()
        length = (commands.SetInput(self.instance, self.pin, len(self.payload)),) if self.pin else ()
        return (*write, *length)

    def line(self) -> str:
        """Return the command as it is written."""
        written = self.text or (f"hex {self.payload.hex(' ')}" if self.payload else NONE)
        return f"{self.mark} {self.instance} {written}"
