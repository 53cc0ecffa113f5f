"""The gap timer of a frame: the time since its last byte against Timeout, or why none runs."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.formatting import MS, bar
from trcvtui.tui.view_model.view_model import Scene

BAR: Final = 12
NO_WATCH: Final = "Timeout is 0: no gap ends a frame"


class Gap(NamedTuple):
    """How long no byte has come, of `limit_ns`; `reason` says why nothing runs, "" where it does."""

    elapsed_ns: int
    limit_ns: int
    reason: str


def gap_of(scene: Scene, instance: InstanceSnapshot) -> Gap | None:
    """Return the gap timer of the selected instance, None where its block has none."""
    framer, snapshot = instance.framer, scene.snapshot
    if framer is None or snapshot is None:
        return None
    limit = framer.timeout_ns
    if not limit:
        return Gap(0, 0, NO_WATCH)
    if not instance.busy or instance.last_receive_ns is None:
        return Gap(0, limit, "waits for a first byte")
    return Gap(max(0, scene.t_ns - instance.last_receive_ns), limit, _frozen(scene, snapshot.running))


def _frozen(scene: Scene, running: bool) -> str:
    if not running:
        return "frozen: the PLC is in STOP"
    if scene.is_frozen:
        return "frozen view: F shows it as it runs"
    if scene.picture is not None and scene.picture.holding:
        return "frozen: the scans are held"
    return ""


def gap_parts(gap: Gap) -> list[tuple[str, str]]:
    """Return the timer as a bar with its times, and its reason where it stands."""
    if not gap.limit_ns:
        return [("─" * BAR, "faint"), (f" {gap.reason}", "dim")]
    full, empty = bar(min(gap.elapsed_ns, gap.limit_ns), gap.limit_ns, BAR)
    near = gap.elapsed_ns * 4 >= gap.limit_ns * 3
    times = f" {_ms(gap.elapsed_ns)} of {_ms(gap.limit_ns)} ms"
    parts = [(full, "warn" if near else "busy"), (empty, "faint"), (times, "strong" if full else "dim")]
    return [*parts, (f" · {gap.reason}", "dim")] if gap.reason else parts


def _ms(ns: int) -> str:
    return f"{ns / MS:.6g}"
