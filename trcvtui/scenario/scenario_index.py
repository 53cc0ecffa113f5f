"""The scenarios that come with the source, and the STATUS codes that each scenario shows, by block."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from trcvtui.commands.patterns import parse_pattern
from trcvtui.dialects.status_report import parse_code
from trcvtui.errors import UserError
from trcvtui.project.tables import read_toml

SOURCE_ROOT: Final = Path(__file__).parents[2]

ShownCode = tuple[int, str]  # a code, and the block that shows it


def find_scenarios(
    folder: str, codes: Collection[int] | None = None, wanted: Callable[[str], bool] | None = None
) -> Mapping[ShownCode, tuple[str, ...]]:
    """Return the files of a folder that show a code at a block. Paths start at the source's root.

    With `codes`, only files that contain the digits of a code are parsed. To parse all would take 60 ms.
    `wanted` returns whether to read a file of this name.
    """
    showing: dict[ShownCode, list[str]] = {}
    for path in sorted((SOURCE_ROOT / "configs" / "scenarios" / folder).glob("*.toml")):
        if wanted is not None and not wanted(path.name):
            continue
        for shown in read_shown_codes(path) if codes is None or _mentions(path, codes) else ():
            showing.setdefault(shown, []).append(path.relative_to(SOURCE_ROOT).as_posix())
    return {shown: tuple(files) for shown, files in sorted(showing.items())}


def _mentions(path: Path, codes: Collection[int]) -> bool:
    try:
        text = path.read_bytes().upper()
    except OSError:
        return False
    return any(b"%X" % code in text for code in codes)


def read_shown_codes(path: Path) -> frozenset[ShownCode]:
    """Return the codes that a scenario file waits for or expects, none if the file is wrong."""
    try:
        document = read_toml(path)
        lines = [line.partition(" #")[0].split() for line in _step_lines(document)]
        created = {words[2]: words[1] for words in lines if words[:1] == ["create"] and len(words) > 2}
        blocks = _blocks_by_instance(document, path) | created
        return frozenset((code, blocks[words[1]]) for words in lines for code in _line_codes(words, blocks))
    except UserError:
        return frozenset()


def _step_lines(document: Mapping[str, Any]) -> list[str]:
    scenario = document.get("scenario")
    steps = scenario.get("steps") if isinstance(scenario, Mapping) else None
    return steps.splitlines() if isinstance(steps, str) else []


# -- the block of each instance ----------------------------------------------------------------------------


def _blocks_by_instance(document: Mapping[str, Any], path: Path) -> dict[str, str]:
    other = document.get("project")
    instances = (read_toml(path.parent / other) if isinstance(other, str) else document).get("instance")
    tables = instances if isinstance(instances, list) else []
    return {str(table.get("name")): str(table.get("block")) for table in tables if isinstance(table, Mapping)}


# -- the codes in a line -----------------------------------------------------------------------------------


def _line_codes(words: list[str], blocks: Mapping[str, str]) -> Iterator[int]:
    """Yield the codes of a line; of `expect X trace 7004 80C5! 7002*` they are 7004 and 80C5."""
    if words[:1] not in (["wait"], ["expect"]) or len(words) < 3 or words[1] not in blocks:
        return
    if words[2] == "trace":
        atoms = parse_pattern(" ".join(words[3:])).atoms
        yield from [atom.scan[0] for atom in atoms if atom.scan is not None and atom.least]
    for word in words[2:]:
        pin, _, value = word.partition("=")
        if pin == "STATUS":
            yield parse_code(value)
