"""The report of an internal error: trace, versions, the project without secrets, the newest ledger lines.

Rule: the report has no payload: no message of a peer, no text of an exception, no detail of a note.
"""

from __future__ import annotations

import os
import platform
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from trcvtui import __version__, clock
from trcvtui.errors import UserError, one_line
from trcvtui.files import write_file
from trcvtui.net import connection
from trcvtui.paths import state_folder
from trcvtui.plc.containment import INTERNAL_ERROR, ExceptionNote
from trcvtui.plc.ledger import BenchNote, InputEdge, Line, StatusEdge
from trcvtui.project.keys import entries_of, entry_of
from trcvtui.project.project import Project

CONNECTION_FOLDER: Final = Path(connection.__file__).parent
MOST_LEDGER_LINES: Final = 100
MOST_REPORTS: Final = 20  # of one process, so that a repeated error cannot fill the disk
MOST_KEPT_REPORTS: Final = 100  # in the state folder
MOST_NAMES_TRIED: Final = 1000  # for reports of the same second
DECL_KINDS: Final = ("task", "data", "connect", "udp_config", "addr", "combuffer", "instance", "peer")
MESSAGE_KEYS: Final = frozenset(("says", "replies"))  # keys with messages of a peer
_written_reports: dict[tuple[str, Path | None], str] = {}


def write_report(trace: str, project: Project | None, lines: Sequence[Line], folder: Path | None) -> str:
    """Write a report into `folder` (None: state folder). Return "report PATH", or why there is none."""
    key = trace, folder
    if key in _written_reports and "\n" in trace:  # the same error again
        return _written_reports[key]
    if len(_written_reports) >= MOST_REPORTS:
        return f"no report: {MOST_REPORTS} are written"
    is_ours, folder = folder is None, folder or state_folder()
    now = datetime.fromtimestamp(clock.utc_ns() // clock.NS_PER_S)
    stem = f"trcvtui-error-{now:%Y%m%d-%H%M%S}"
    try:
        os.makedirs(folder, mode=0o700, exist_ok=True)
        names = (f"{stem}{f'-{number}' * (number > 1)}.txt" for number in range(1, MOST_NAMES_TRIED))
        path = next(folder / name for name in names if not (folder / name).exists())
        write_file(path, "\n".join((*_report_lines(trace, project, lines), "")), "report", is_new=True)
        # Only in the state folder: a folder that the user named is never tidied.
        for old in sorted(folder.glob("trcvtui-error-*.txt"))[:-MOST_KEPT_REPORTS] if is_ours else ():
            old.unlink(missing_ok=True)
    except (OSError, UserError, StopIteration) as failed:
        return one_line(f"no {failed}")
    _written_reports[key] = f"report {path}"
    return _written_reports[key]


def report_error(
    error: BaseException, project: Project, lines: Sequence[Line], folder: Path | None
) -> ExceptionNote:
    why = f"{locate_error(error)}; {write_report(textless_trace(error), project, lines, folder)}"
    files = [Path(frame.filename).parent for frame in traceback.extract_tb(error.__traceback__)]
    return ExceptionNote(why, CONNECTION_FOLDER in files)


def locate_error(error: BaseException) -> str:
    """Return an exception and its place in one line: `KeyError in receive_job.py:292`."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{place}"


def textless_trace(error: BaseException) -> str:
    """Return the trace of an exception and its causes, without texts. The last line names the exception."""
    before = error.__cause__ or error.__context__
    earlier = f"{textless_trace(before)}\n\n" if before is not None else ""
    return f"{earlier}{''.join(traceback.format_tb(error.__traceback__))}{locate_error(error)}"


def _report_lines(trace: str, project: Project | None, lines: Sequence[Line]) -> Iterator[str]:
    yield f"trcvtui {__version__}, Python {platform.python_version()}, {platform.platform()}"
    yield f"textual {_version('textual')}, rich {_version('rich')}, command {' '.join(sys.argv[1:2])}"
    yield from ("", "[trace]", trace, "", "[project]")
    if project is not None:
        with suppress(Exception):  # the project itself may be the cause of the error
            yield from _project_lines(project)
    yield from ("", f"[ledger] the newest {MOST_LEDGER_LINES} lines: scan, ns, event")
    for line in lines[-MOST_LEDGER_LINES:]:
        yield one_line(f"{line.scan} {line.t_ns} {_strip_payload(line.event)}")


def _project_lines(project: Project) -> Iterator[str]:
    yield f"dialect {project.dialect.name}, model {project.model}, options {dict(project.options)}"
    for kind in DECL_KINDS:
        for decl in entries_of(kind, project):
            keys = [f"{key}={value!r}" for key, value in entry_of(decl) if key not in MESSAGE_KEYS]
            yield one_line(f"{kind}: {' '.join(keys)}")


def _strip_payload(event: Any) -> Any:
    """Return an event without bytes on pins, details of notes, and values of inputs other than BOOL."""
    match event:
        case StatusEdge():
            return event.instance, event.outputs._replace(byte=None), event.condition, event.cause
        case InputEdge(instance, pin, value):
            return "input", instance, pin, value if isinstance(value, bool) else ".."
        case BenchNote(subject, what) if what != INTERNAL_ERROR:
            return "note", subject, what
    return event


def _version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
