"""A session written as a scenario file that runs: the project by its name, the steps, what was seen."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake
from trcvtui.files import write_file
from trcvtui.project.tables import parse_toml, read_text, shown
from trcvtui.rig import demo_path
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.scenario.recorded_session import OUTSIDE, Session

SUFFIX: Final = ".toml"
MARKED: Final = " since scan "
FAR: Final = os.path.join(os.pardir, os.pardir, os.pardir)


def scenario_text(session: Session, bench: Bench, path: Path, before: str | None = None) -> str:
    """Return the text of a scenario file that shall stand at `path`.

    `before` is the project as the session began with it, where its file says something else by now. It comes
    into the scenario, and so does a project that came with the program: no file names the installation.
    """
    steps = "\n".join(session.steps()).replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    about = f"A session of {bench.runtime.scans} scans on {bench.kernel_name}, saved with what was seen"
    about += f"{MARKED}{session.marked_at}." if session.marked_at else "."
    about += session.outsiders().about
    head = {"name": path.stem, "about": about}
    lines = [_project(bench.project.path, path.parent, before), "", "[scenario]"]
    lines += [f"{key} = {_quoted(text)}" for key, text in head.items()]
    return "\n".join([*lines, 'steps = """', steps, '"""', ""])


def marked_scan(about: str) -> int:
    """Return behind which scan a session was marked, as its text says; 0: it was not."""
    _, mark, behind = about.partition(MARKED)
    number = behind.partition(".")[0]
    return int(number) if mark and number.isdecimal() else 0


def partners_left_out(about: str) -> str:
    """Return who took part in a session and can not be replayed, as its text says; "": nobody."""
    _, mark, behind = about.partition(OUTSIDE)
    who, _, where = behind.partition("): nothing is expected on ")
    if not mark:
        return ""
    told = f"{who} was a partner outside the bench and is not replayed"
    return f"{told}: nobody calls or sends in its place on {where.partition('.')[0]}"


def _project(own: Path, folder: Path, before: str | None) -> str:
    """Return the project's text with the files that it names as seen from a folder, or its name."""
    inside = Path(os.path.realpath(own)).is_relative_to(os.path.realpath(demo_path().parents[1]))
    if before is None and not inside:
        return f"project = {_quoted(_way_to(own, folder))}"
    from trcvtui.project.text import with_files_from  # read when first asked for

    text = with_files_from(read_text(own) if before is None else before, own.parent, folder, str(own))
    if "scenario" in parse_toml(text, str(own)):
        raise mistake("save scenario", f"{own}, which is a scenario itself", "a session of a project")
    return text.rstrip()


def _way_to(project: Path, folder: Path) -> str:
    """Return the project's path as seen from a folder; the whole of it where that would climb far."""
    whole = os.path.realpath(project)
    try:
        way = os.path.relpath(whole, os.path.realpath(folder))
    except ValueError:  # another drive
        return whole
    return whole if way.startswith(FAR) else way.replace(os.sep, "/")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def target(name: str, where: str) -> Path:
    """Return the path of a TOML file that is named in a command; raise UserError for another suffix."""
    bare = name.strip().strip("\"'")
    path = Path(bare).expanduser()
    if not path.name or bare.endswith(("/", os.sep)):
        raise mistake(where, shown(name), "the name of a file")
    if not path.suffix:
        return path.with_suffix(SUFFIX)
    if path.suffix != SUFFIX:
        raise mistake(where, shown(path.name), f"a name that ends in {SUFFIX}")
    return path


def write_new(path: Path, text: str, ours: Iterable[str], where: str) -> str:
    """Write a file that is not there yet, or is one of `ours`; return its real path; raise UserError."""
    whole = os.path.realpath(path)
    is_own = whole in ours
    write_file(path, text, where, is_own=is_own, is_new=not is_own)
    return whole
