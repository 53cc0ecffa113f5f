"""Write `docs/project-file.md`: every key of a project file, from its rows: `make atlas`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Switch
from trcvtui.project.key_rows import Key, TableRow
from trcvtui.project.keys import DESCRIBED_TABLES, SIM_ROW, TABLES, TOP_ROW
from trcvtui.project.tables import with_article
from trcvtui.udt.literals import format_duration

PAGE: Final = Path(__file__).parent / "project-file.md"
HEAD: Final = '''# The keys of a project file

A project file is TOML. Each `[[kind]]` adds an entry of its kind. A key that is left out has its default.
A key with * is needed, in entries that can have it.

`--set connect.C1.LocalPort=2000` replaces a key of the file for one run. The bench commands `add`, `set` and
`save project` take the same keys.

`make atlas` writes this page from `trcvtui/project/keys.py`.

## An example

```toml
dialect = "baosky"
model   = "T4"                     # 32 connections; T3: 8

program = """                      # what the PLC's program does by itself
wait TRCV_C_1 STATUS=7004
set TRCV_C_1 EN_R=1
"""

[options]                          # the points that the manual leaves open
not_connected = "pulse"            # 80A1: pulse, hold, never

[[data]]
name = "report"
type = "ARRAY[0..11] OF BYTE"      # or a UDT of yours: [[udt]] with file = "weight.st"

[[connect]]                        # TCP_CONNECTCONFIG
name = "C1"
ActiveEstablished = false
LocalAddress = "127.0.0.1"
LocalPort = 0                      # passive and 0: a free port, kept until STOP

[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "report"
CONT = true                        # inputs by their pin's name

[[peer]]                           # a partner that the bench plays
name = "Device"
active = true
remote = "@C1"                     # where C1 listens
reconnect = "T#500ms"              # connects again after a close
every = "T#1s"                     # sends a message every second
says = ["hex 01 00 00 00 00 00 20 40 64 00 00 00"]
```
'''
CHOICES: Final = {  # of the keys that are read before all others
    "dialect": ", ".join(DIALECTS),
    "model": "; ".join(
        f"{', '.join(each.models)} ({name})" for name, each in DIALECTS.items() if each.models
    ),
}
TAIL: Final = """
## `[options]`, `[constants]`

`[options]` has the switches of the dialect, for points that its manual leaves open. One more is
`black_box = "off"`: then the screen keeps nothing of a run for a later recording. `[constants]` has whole
numbers that the UDTs use, such as `"GVL.MAX" = 10`.
"""


def page() -> str:
    """Return the page."""
    return (
        HEAD + "".join(line + "\n" for line in _lines()) + TAIL + "".join(line + "\n" for line in _switches())
    )


def _lines() -> Iterator[str]:
    yield from _table("Above all tables", TOP_ROW)
    for kind, row in TABLES.items():
        yield from _table(f"`[[{kind}]]`", row)
        if kind in DESCRIBED_TABLES:
            yield from _table(f"`[[{kind}]]` of a Siemens dialect", DESCRIBED_TABLES[kind])
    yield from _table("`[sim]`", SIM_ROW)


def _table(title: str, row: TableRow) -> Iterator[str]:
    yield from ("", f"## {title}", "", row.help, "", "| key | means | takes |", "| --- | --- | --- |")
    for name, rows in _by_name(row.keys).items():
        says = " · ".join(dict.fromkeys(key.help for key in rows))
        takes = " · ".join(dict.fromkeys(_takes(key) for key in rows))
        yield f"| `{name}`{'*' * any(key.is_needed for key in rows)} | {says} | {takes} |"


def _takes(key: Key) -> str:
    if key.kind is None:
        return CHOICES.get(key.name, "")
    is_name = key.refers is not None and not key.refers.by_at and not key.refers.words
    return f"the name of {with_article(key.refers.what)}" if key.refers and is_name else key.kind.expected


def _switches() -> Iterator[str]:
    found: dict[Switch, list[str]] = {}
    for dialect in DIALECTS.values():
        for switch in dialect.switches:
            found.setdefault(switch, []).append(dialect.name)
    yield from ("", "| switch | dialects | means | takes, the default first |", "| --- | --- | --- | --- |")
    for switch, names in sorted(found.items(), key=lambda item: item[0].name):
        whose = "all" if len(names) == len(DIALECTS) else ", ".join(names)
        yield f"| `{switch.name}` | {whose} | {switch.text} | {_values(switch)} |"


def _values(switch: Switch) -> str:
    if switch.kind == "choice":
        others = [each for each in switch.values if each != switch.default]
        return ", ".join(f'`"{each}"`' for each in (switch.default, *others))
    if switch.kind == "bool":
        return "`true`, `false`" if switch.default else "`false`, `true`"
    if switch.kind == "duration":
        return f'`"{format_duration(int(switch.default))}"`, a duration'
    return f"`{switch.default}`, {switch.least} to {switch.most}"


def _by_name(rows: Iterable[Key]) -> dict[str, list[Key]]:
    found: dict[str, list[Key]] = {}
    for key in rows:
        found.setdefault(key.name, []).append(key)
    return found


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
