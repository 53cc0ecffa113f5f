"""`--set PATH=VALUE`: put into a document as if it stood there, before anything is checked.

Rule: what is set is checked like what is written; its mistakes say `--set PATH` where a file's say the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from trcvtui.errors import Problem
from trcvtui.project.names import expected_name
from trcvtui.project.tables import Given, shown

TOP_KEYS: Final = ("dialect", "model", "start")
SECTIONS: Final = ("options", "sim")
ENTRIES: Final = (
    "task", "data", "connect", "udp_config", "addr", "instance", "peer", "message", "sequence", "certificate",
    "combuffer",
)  # fmt: skip
FORMS: Final = "PATH=VALUE such as connect.C1.LocalPort=2000 or options.retry=T#100ms"


def with_overrides(
    document: Mapping[str, Any], overrides: Iterable[str], problems: list[Problem]
) -> dict[str, Any]:
    """Return a copy of the document with every `PATH=VALUE` in it; of two of one path the last wins."""
    changed = {key: _copied(value) for key, value in document.items()}
    for override in overrides:
        path, equals, text = override.partition("=")
        path = path.strip()
        if not equals or not path:
            problems.append(Problem("--set", shown(override), FORMS))
            continue
        problem = _put(changed, path, Given(path, text.strip()))
        if problem is not None:
            problems.append(problem)
    return changed


def _copied(part: Any) -> Any:
    """Return a copy as deep as a path can reach, and no deeper: keys of a file may be nested without end."""
    if isinstance(part, list):
        return [dict(entry) if isinstance(entry, dict) else entry for entry in part]
    return dict(part) if isinstance(part, dict) else part


def _put(document: dict[str, Any], path: str, value: Given) -> Problem | None:
    match path.split("."):
        case [key] if key in TOP_KEYS:
            document[key] = value
        case ["constants", *parts] if parts:
            table = document.setdefault("constants", {})
            if isinstance(table, dict):
                table[".".join(parts)] = value
        case [section, key] if section in SECTIONS:
            table = document.setdefault(section, {})
            if isinstance(table, dict):
                table[key] = value
        case [kind, name, key] if kind in ENTRIES and key != "name":
            return _put_entry(document, kind, name, key, value)
        case [first, *_]:
            known = (*TOP_KEYS, *SECTIONS, *ENTRIES, "constants")
            expected = FORMS if first in known else expected_name(first, known, "part of a project")
            return Problem(f"--set {path}", shown(first if first not in known else path), expected)
    return None


def _put_entry(document: dict[str, Any], kind: str, name: str, key: str, value: Given) -> Problem | None:
    if kind == "task" and "task" not in document:
        document["task"] = [{"name": "MAIN"}]  # the default task can be set without being written
    tables = document.get(kind)
    entries = [t for t in tables if isinstance(t, dict)] if isinstance(tables, list) else []
    for entry in entries:
        if entry.get("name") == name:
            entry[key] = value
            return None
    names = [entry["name"] for entry in entries if isinstance(entry.get("name"), str)]
    return Problem(f"--set {value.path}", shown(name), expected_name(name, names, kind))
