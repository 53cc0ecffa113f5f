"""Says for blocks on a ComBuffer what to check after an error, and what will go wrong with a framing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import RuleAnswer, tip
from trcvtui.net.serial_line import TCP_URL_PREFIXES
from trcvtui.plc.port_hints import describe_port_fault, port_hint
from trcvtui.plc.snapshot import ComBufferSnapshot, FramerSnapshot, InstanceSnapshot, Snapshot
from trcvtui.project.project import ComBufferDecl, Project
from trcvtui.wording import count


def explain_frame_too_long(e: Evidence) -> RuleAnswer:
    size = e.pin("SizeReceiveData")
    frame = f"{count(size, 'byte')} came" if size else "the size was reached"
    cause = f"{frame} without the suffix: the sender's suffix differs, or its frames are longer"
    return tip(cause, "{} shows which", f"framing {e.instance}")


def explain_wrong_frame_size(e: Evidence) -> RuleAnswer:
    found = e.pin("SizeReceiveData")
    room = f"1 to {e.data_size}, the size of {e.data}" if e.data_size else "at most the size of the variable"
    is_found = f"SizeReceiveData is {found}: it" if found is not None else "SizeReceiveData"
    return tip("", f"{is_found} has to be {room}")


def explain_string_too_long(e: Evidence) -> RuleAnswer:
    text = "the string was full before its text ended"
    return tip(text, "{} shows how texts end (key B)", f"framing {e.instance}")


# The block itself is right and waits for the line.
WAITING_CONDITIONS: Final = frozenset(
    {Condition.FRAME_AWAITED, Condition.FRAME_PART, Condition.BUFFER_EMPTY, Condition.SENDING}
)


def describe_port_wait(e: Evidence) -> str:
    """Return a text if the block waits for bytes from or to a port that does not exist, else ""."""
    return describe_port_fault(e.buffer) if e.condition in WAITING_CONDITIONS and not e.cause.pin else ""


def explain_port_trouble(e: Evidence) -> str:
    away, hint = describe_port_fault(e.buffer), port_hint(e.buffer)
    return hint if describe_port_wait(e) else ": ".join(part for part in (away, hint) if part)


# -- what will go wrong with a framing -------------------------------------------------------------------

MS: Final = 1_000_000
MUCH_NOISE: Final = 16  # bytes thrown away without a single frame


@dataclass(frozen=True, slots=True)
class FramedBlock:
    """A receiving block with framer and ComBuffer. If no TRCV_C feeds the ComBuffer, `feeder` is None."""

    instance: InstanceSnapshot
    framer: FramerSnapshot
    buffer: ComBufferDecl
    feeder: InstanceSnapshot | None
    readers: tuple[str, ...]
    now: ComBufferSnapshot | None
    interval_ns: int  # of the task that calls the block

    @property
    def prefix(self) -> bytes:
        return self.framer.prefix or b""

    @property
    def suffix(self) -> bytes:
        return self.framer.suffix or b""

    @property
    def is_tcp(self) -> bool:
        port = self.buffer.serial.port if self.buffer.serial is not None else ""
        return self.feeder is not None or port.startswith(TCP_URL_PREFIXES)

    @property
    def size_pin(self) -> str:
        return "the string" if self.framer.is_text else "SizeReceiveData"


def list_framing_warnings(snapshot: Snapshot, project: Project, name: str) -> tuple[str, ...]:
    """Return the warnings about an instance's framing, the worst first."""
    framed = _find_framed_block(snapshot, project, name)
    if framed is None:
        return ()
    return tuple([text for rule in FRAMING_RULES if (text := rule(framed))])


def _find_framed_block(snapshot: Snapshot, project: Project, name: str) -> FramedBlock | None:
    instance = snapshot.instance(name)
    if instance is None or instance.framer is None:
        return None
    buffer = next((b for b in project.combuffers if b.name == instance.connect), None)
    if buffer is None:
        return None
    task = project.task(instance.task)
    readers = [
        i.name
        for i in snapshot.instances
        if i.connect == instance.connect and block_row(i.block).reads_rx_buffer
    ]
    return FramedBlock(
        instance,
        instance.framer,
        buffer,
        snapshot.instance(buffer.source),
        tuple(readers),
        snapshot.combuffer(buffer.name),
        task.interval_ns if task is not None else snapshot.interval_ns,
    )


# -- the marks and the size ----------------------------------------------------------------------------------


def warn_long_marks(f: FramedBlock) -> str:
    """The marks alone exceed the size: every frame ends with an overrun, none with its suffix."""
    marks = len(f.prefix) + len(f.suffix)
    if not f.suffix or marks <= f.framer.size or f.framer.size <= 0:
        return ""
    end = "10 STRINGOVERRUN" if f.framer.is_text else "23 DATASIZEOVERRUN"
    return (
        f"prefix and suffix have {len(f.prefix)} + {len(f.suffix)} bytes, but {f.size_pin} is "
        f"{f.framer.size}: no frame can end with its suffix; each ends as {end}"
    )


def warn_no_end(f: FramedBlock) -> str:
    """Without suffix and Timeout only the size ends a frame."""
    if f.suffix or f.framer.timeout_ns or f.framer.size <= 0:
        return ""
    if f.framer.is_text:
        return "no suffix and Timeout = 0: the end of a text is never seen; set a suffix or a Timeout"
    size = count(f.framer.size, "byte")
    return f"no suffix and Timeout = 0: with fewer than {size} it waits forever; only Reset helps"


def warn_equal_marks(f: FramedBlock) -> str:
    """After one lost mark, the end of a frame is taken for the beginning of the next."""
    if not f.prefix or f.prefix != f.suffix:
        return ""
    return "prefix and suffix are equal: after one lost mark each end is read as a begin, until Reset"


def warn_only_noise(f: FramedBlock) -> str:
    """If the prefix never comes, all bytes are discarded, and the block seems to receive nothing."""
    tally = f.framer.tally
    if f.framer.discarded < MUCH_NOISE or tally.good or tally.gaps or tally.overruns:
        return ""
    thrown = count(f.framer.discarded, "byte")
    return f"{thrown} came without the prefix {f.prefix.hex(' ').upper()}: does the sender use another one?"


# -- the gap -------------------------------------------------------------------------------------------------


def warn_gap_on_tcp(f: FramedBlock) -> str:
    """On TCP a gap says nothing about which bytes were sent together (section 6)."""
    if not f.is_tcp or not f.framer.timeout_ns or f.suffix:
        return ""
    return (
        "a gap over TCP is a guess: the network joins and splits messages (Nagle, retransmission, "
        "proxies); use a suffix or a fixed size"
    )


def warn_no_gap(f: FramedBlock) -> str:
    """Without a suffix, texts that follow each other sooner than the gap fill the string together."""
    tally = f.framer.tally
    if f.suffix or not f.framer.timeout_ns or not tally.overruns or tally.gaps:
        return ""
    gap = f"{f.framer.timeout_ns / MS:g} ms"
    return (
        f"no suffix, and a gap of {gap} never comes: each frame ends at {count(f.framer.size, 'byte')} "
        f"({f.size_pin}), wherever that is; key B shows how the bytes split into frames"
    )


def warn_short_gap(f: FramedBlock) -> str:
    """A call handles bytes before the gap, so a gap shorter than a scan is never seen."""
    timeout = f.framer.timeout_ns
    if not 0 < timeout < f.interval_ns:
        return ""
    return (
        f"Timeout is {timeout / MS:g} ms, but {f.instance.name} is called every {f.interval_ns / MS:g} ms: "
        "it misses a gap that ends before its next call"
    )


# -- what comes before the framer ----------------------------------------------------------------------------


def warn_static_feeder(f: FramedBlock) -> str:
    """Section 6: a feeder with ADHOC = 0 passes on only whole blocks of LEN bytes, so frames come late."""
    if f.feeder is None or f.feeder.pin("ADHOC"):
        return ""
    return (
        f"{f.feeder.name} has ADHOC = 0: it passes on only whole blocks of LEN bytes, so a frame comes "
        "late, or with the next frame; ADHOC = 1 passes on whatever arrives"
    )


def warn_idle_feeder(f: FramedBlock) -> str:
    if f.feeder is None or f.feeder.pin("EN_R") is not False:
        return ""
    return f"{f.feeder.name} has EN_R = 0: no bytes come"


def warn_drops(f: FramedBlock) -> str:
    """A full ComBuffer with a `size` drops bytes; without `size` it would slow the sender down instead."""
    if f.feeder is None or not f.buffer.size:
        return ""
    return (
        f"{f.buffer.name} has size = {f.buffer.size}: when it is full, bytes are dropped; without "
        "`size` it slows the sender down instead"
    )


def warn_port_away(f: FramedBlock) -> str:
    return ": ".join(part for part in (describe_port_fault(f.now), port_hint(f.now)) if part)


def warn_lost_bytes(f: FramedBlock) -> str:
    if f.now is None or not f.now.lost:
        return ""
    return f"{count(f.now.lost, 'byte')} never reached a frame: {f.buffer.name} was full, or was emptied"


def warn_shared_buffer(f: FramedBlock) -> str:
    if len(f.readers) < 2:
        return ""
    return f"{' and '.join(f.readers)} read {f.buffer.name}: each byte reaches only one of them"


FRAMING_RULES: Final[tuple[Callable[[FramedBlock], str], ...]] = (
    warn_port_away, warn_long_marks, warn_no_gap, warn_idle_feeder, warn_gap_on_tcp, warn_static_feeder,
    warn_no_end, warn_only_noise, warn_lost_bytes, warn_drops, warn_shared_buffer, warn_equal_marks,
    warn_short_gap,
)  # fmt: skip
