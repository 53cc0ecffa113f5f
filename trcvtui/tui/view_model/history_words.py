"""Where a byte of the past came from, in one line: the message first, as an engineer looks for that."""

from __future__ import annotations

from trcvtui.project.project import Project
from trcvtui.rig.history.window import JobSpan, MessageSpan, RecvSpan
from trcvtui.tui.formatting import moment, plain

Labels = tuple[JobSpan | None, RecvSpan | None, MessageSpan | None]


def origin_words(place: int, values: tuple[int | None, int | None], labels: Labels, project: Project) -> str:
    """Return value, message, job, field, recv call, scan and time of the byte at a position.

    `values` are what it is and what stood there in the job before.
    """
    job, recv, message = labels
    if job is None:
        return ""
    words = [_value_words(*values, job)]
    if message is not None:
        byte = message.first + place - message.position
        words.append(f"{plain(message.peer)} #{message.number} byte {byte}")
    byte = place - job.position
    words.append(_job_words(job, byte))
    if job.done and (field := field_at(project, job.instance, byte)):
        words.append(field)
    if recv is not None and recv.number:
        words += [f"recv {recv.number}", f"scan {recv.scan}", f"{moment(recv.t_ns)} s"]
    if not job.done:
        words.append(plain(job.reason))
    return " · ".join(words)


def _job_words(job: JobSpan, byte: int) -> str:
    """Return whose byte it is, and of which part of a frame."""
    if not job.instance:
        return "no job"
    if not job.done and not job.number:
        return plain(job.instance)
    if not job.is_frame:
        return f"{plain(job.instance)} job {job.number} byte {byte}"
    part = "prefix" if byte < job.prefix else "suffix" if byte >= job.size - job.suffix else "data"
    return f"{plain(job.instance)} frame {job.number} byte {byte}, {part}"


def _value_words(value: int | None, was: int | None, job: JobSpan) -> str:
    if value is None:
        return "value not kept" if job.done else "dropped"
    differs = was is not None and was != value
    return f"16#{value:02X} = {value}" + (f" (was {was:02X})" if differs else "")


def field_at(project: Project, instance: str, byte: int) -> str:
    """Return the path of the member of an instance's DATA that holds a byte, "" for padding."""
    data = next((decl.data for decl in project.instances if decl.name == instance), None)
    declared = project.data_decl(data) if data else None
    number = declared.layout.leaf_at(byte) if declared is not None else None
    return plain(declared.layout.leaf(number).path) if declared is not None and number is not None else ""
