"""The frozen picture of a framer: its marks as the block would use them now."""

from __future__ import annotations

from collections.abc import Mapping

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.serial.receive_data import MILLISECOND
from trcvtui.blocks.serial.receive_string import text_of
from trcvtui.blocks.serial.reception import Reception
from trcvtui.blocks.serial.serial_binding import SerialBinding
from trcvtui.plc.snapshot import FramerSnapshot


def framer_snapshot(
    block: str, bound: SerialBinding, job: Reception, inputs: Mapping[str, bool | int]
) -> FramerSnapshot:
    """Return a receiving block's framer as it stands."""
    is_text = "SizeReceiveData" not in inputs
    if is_text:
        prefix, suffix = _text(bound.prefix), _text(bound.suffix)
        room = bound.data.size - 1 if bound.data is not None else 0
        size = min(room, 255 if block.endswith("255") else 80)
    else:
        prefix = _pointed(bound.prefix, int(inputs["LenPrefix"]))
        suffix = _pointed(bound.suffix, int(inputs["LenSuffix"]))
        size = int(inputs["SizeReceiveData"])
    return FramerSnapshot(
        prefix,
        suffix,
        size,
        int(inputs["Timeout"]) * MILLISECOND,
        is_text,
        job.framer.discarded,
        job.framer.noise,
        job.dropped,
        job.tally,
        job.last,
    )


def _text(area: DataArea | None) -> bytes | None:
    return text_of(area) if area is not None else None


def _pointed(area: DataArea | None, length: int) -> bytes | None:
    return bytes(memoryview(area.content)[:length]) if area is not None else None


def framer_key(bound: SerialBinding, job: Reception) -> tuple[object, ...]:
    """Return what a framer's picture depends on beside the pins and the job: cheaper than the picture."""
    written = [area.generation for area in (bound.prefix, bound.suffix) if area is not None]
    return job.framer.discarded, job.tally, *written
