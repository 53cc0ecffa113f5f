"""Whether the engine would take a bench command line, checked by the engine's own parser."""

from __future__ import annotations

from trcvtui.errors import UserError
from trcvtui.project.project import Project

SCAN_CONTROL_LINES = ("hold", "go")
PROMPT_PLACE = "prompt"


def find_mistake(line: str, project: Project) -> str:
    """Return what is wrong with a line, "" if the engine would take it."""
    from trcvtui.commands.table import parse_line  # with the first line, not before the first screen

    if line.strip() in SCAN_CONTROL_LINES:
        return ""
    try:
        parse_line(line, project, PROMPT_PLACE)
    except UserError as error:
        wrong = error.problems[0]
        place = wrong.where[len(PROMPT_PLACE) + 2 :]  # `connect C3: LocalPort`: a form marks that field
        return f"{place}: {wrong.message}" if place else wrong.message
    return ""


def preview_edit(line: str, project: Project) -> str:
    """Return the effect of a line that edits the project: what the line changes, makes and restarts."""
    from trcvtui.commands.edit import describe_edit
    from trcvtui.commands.table import parse_line  # as above
    from trcvtui.commands.words import EDIT_COMMANDS

    try:
        command = parse_line(line, project, "prompt")
    except UserError:
        return ""
    return describe_edit(command, project) if isinstance(command, EDIT_COMMANDS) else ""
