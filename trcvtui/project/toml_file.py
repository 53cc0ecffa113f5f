"""A TOML file as a document; what keeps it from being read is one line with the place."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from trcvtui.errors import mistake
from trcvtui.files import read_bytes, reason_of
from trcvtui.project.names import NO_HIDDEN, hidden_in

LARGEST_FILE: Final = 10 * 1024 * 1024
# tomllib says where it stopped in the words of its message: "(at line 3, column 5)", "(at end of document)".
_PLACE: Final = re.compile(r"(.*) \(at (.*)\)", re.DOTALL)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the document of a TOML file; raise UserError when it cannot be read or is no TOML."""
    return parse_toml(read_text(path), str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text; raise UserError when it is none."""
    import tomllib

    try:
        return tomllib.loads(text)
    except ValueError as wrong:  # TOMLDecodeError, and numbers of more digits than Python reads
        found = _PLACE.fullmatch(str(wrong))
        message, place = found.groups() if found else (str(wrong), "")
        raise mistake(f"{where}: {place}" if place else where, f"no TOML ({message})", "TOML 1.0") from None
    except RecursionError:
        raise mistake(where, "brackets nested too deeply", "TOML 1.0") from None


def read_text(path: Path) -> str:
    """Return the text of a TOML file; raise UserError when it cannot be read."""
    hidden = hidden_in(str(path))
    if hidden:
        raise mistake(str(path), f"{hidden} in its name", NO_HIDDEN)
    try:
        content = read_bytes(path, LARGEST_FILE)
    except (OSError, ValueError) as failed:
        reason = reason_of(failed)
        if isinstance(failed, FileNotFoundError) and not path.parent.is_dir():
            reason = f"no folder {path.parent}"
        raise mistake(str(path), reason, "a TOML file that can be read") from None
    if len(content) > LARGEST_FILE:
        raise mistake(str(path), "a larger file", f"at most {LARGEST_FILE} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        line = content.count(b"\n", 0, wrong.start) + 1
        raise mistake(
            f"{path}: line {line}", f"byte 16#{content[wrong.start]:02X}", "TOML in UTF-8"
        ) from None
