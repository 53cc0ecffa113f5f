"""Whether a bench command line would be taken, asked of the very reader that the engine uses."""

from __future__ import annotations

from trcvtui.errors import UserError
from trcvtui.plc.project import Project

SCAN_CONTROL = ("hold", "go")


def fault_of(line: str, project: Project) -> str:
    """Return what is wrong with a line, "" when it would be taken."""
    from trcvtui.rig.bench import parse_line  # read at the first line, not before the first screen

    if line.strip() in SCAN_CONTROL:
        return ""
    try:
        parse_line(line, project, "prompt")
    except UserError as error:
        return error.lines()[0].removeprefix("prompt: ")
    return ""


def said_on_the_way(line: str, project: Project) -> str:
    """Return what a line makes beside what it adds, "" for nothing."""
    from trcvtui.rig.bench import parse_line  # as above
    from trcvtui.rig.bench_edit import told_on_the_way
    from trcvtui.rig.edit_words import Add

    command = parse_line(line, project, "prompt")
    return told_on_the_way(command) if isinstance(command, Add) else ""
