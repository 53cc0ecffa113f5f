"""The scenarios that come with the source, and which STATUS codes each of them shows.

What a scenario shows is read from its own `wait` and `expect` lines. They are only split into words here,
with the parser of trace patterns behind: loading the projects of all files would cost a command line a
quarter of a second. An installed program has no configs/: then the shelf is empty.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from trcvtui.dialects.status_report import parse_code
from trcvtui.errors import UserError
from trcvtui.plc.toml_file import read_toml
from trcvtui.rig.trace_pattern import parse_pattern

ROOT: Final = Path(__file__).parents[2]


def scenarios_of(dialect: str) -> Mapping[int, tuple[str, ...]]:
    """Return the scenario files that show a code, by code; paths start at the source's root."""
    showing: dict[int, list[str]] = {}
    for path in sorted((ROOT / "configs" / "scenarios" / dialect).glob("*.toml")):
        for code in codes_of(path):
            showing.setdefault(code, []).append(path.relative_to(ROOT).as_posix())
    return {code: tuple(files) for code, files in sorted(showing.items())}


def codes_of(path: Path) -> frozenset[int]:
    """Return the codes that a scenario file waits for or expects; none when the file is wrong."""
    try:
        scenario = read_toml(path).get("scenario")
        steps = scenario.get("steps") if isinstance(scenario, Mapping) else None
        lines = steps.splitlines() if isinstance(steps, str) else []
        return frozenset(code for line in lines for code in _codes_in(line.partition(" #")[0].split()))
    except UserError:
        return frozenset()


def _codes_in(words: list[str]) -> Iterator[int]:
    """Return the codes of a line such as `expect TRCV_C_1 trace 7004 80C5! 7002*`, here 7004 and 80C5."""
    if words[:1] not in (["wait"], ["expect"]):
        return
    if words[2:3] == ["trace"]:
        yield from _codes_of_pattern(" ".join(words[3:]))
    for word in words[2:]:
        pin, _, value = word.partition("=")
        if pin == "STATUS":
            yield parse_code(value)


def _codes_of_pattern(text: str) -> Iterator[int]:
    for atom in parse_pattern(text).atoms:
        if atom.scan is not None and atom.least:
            yield atom.scan[0]
