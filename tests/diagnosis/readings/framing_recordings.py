"""Recordings as a line makes them: chunks with the milliseconds before each."""

from __future__ import annotations

from collections.abc import Iterable

from trcvtui.blocks.serial.com_buffer import LineRecorder, LineRecording

MILLISECOND = 1_000_000
SCAN_NS = 10 * MILLISECOND


def recorded(chunks: Iterable[tuple[int, bytes]], source: str = "serial") -> LineRecording:
    """Return a recording of (milliseconds before it, bytes); the line is quiet for a second after it."""
    recorder, now = LineRecorder(), 0
    for pause, payload in chunks:
        now += pause * MILLISECOND
        recorder.add(payload, now)
    return recorder.make_recording(source, now + 1000 * MILLISECOND, SCAN_NS)


def every(pause: int, frames: Iterable[bytes], source: str = "serial") -> LineRecording:
    """Return frames that came one by one."""
    return recorded([(pause, frame) for frame in frames], source)


def cut_up(stream: bytes, sizes: Iterable[int], source: str = "tcp") -> LineRecording:
    """Return a stream that came scan by scan in pieces of these sizes, the rest in one."""
    pieces, at = [], 0
    for size in sizes:
        pieces.append(stream[at : at + size])
        at += size
    return recorded([(10, piece) for piece in (*pieces, stream[at:]) if piece], source)
