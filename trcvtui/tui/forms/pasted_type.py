"""A STRUCT that you paste into the form: enter writes it to a file beside the project."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Final

from trcvtui.errors import UserError, mistake
from trcvtui.project.tables import hidden_chars
from trcvtui.udt.sources import parse_source

MOST_CHARS: Final = 64 * 1024  # characters
LONGEST_NAME: Final = 60
UNNAMED: Final = "Pasted"  # the name of a STRUCT without one, and of its file


def prepare_pasted_type(text: str, base: Path) -> tuple[Path, str]:
    """Return a free file name in a folder, and the file's content, for a pasted text; raise UserError."""
    from trcvtui.engine.project_edits import refuse_shipped_file  # read when first asked for

    lines = text[: MOST_CHARS + 1].expandtabs(4).splitlines()
    hidden = hidden_chars("".join(lines))
    if hidden or len(text) > MOST_CHARS:
        found = f"{hidden[:40]} in it" if hidden else f"{len(text)} characters"
        raise mistake("paste", found, f"a STRUCT of at most {MOST_CHARS} characters, no control characters")
    source, name = "\n".join([*lines, ""]), UNNAMED
    with suppress(UserError):  # the form shows the mistake
        name = next((each.name for each in parse_source(source, UNNAMED, ".st").types), name)
    stem = re.sub(r"\W", "_", name)[:LONGEST_NAME]
    files = (base / f"{stem}{number if number > 1 else ''}.st" for number in count(1))
    file = next(file for file in files if not os.path.lexists(file))
    refuse_shipped_file(file, "paste")
    return file, source
