"""Write `docs/project-file.md`: every key of a project file, from its rows: `make atlas`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Switch
from trcvtui.project.key_rows import Key, TableRow
from trcvtui.project.keys import DESCRIBED, SIM, TABLES, TOP
from trcvtui.udt.literals import format_time

PAGE: Final = Path(__file__).parent / "project-file.md"
HEAD: Final = '''# The keys of a project file

A project file is TOML. Each `[[kind]]` is one more entry of its kind; a key that is left out has its default.
`--set connect.C1.LocalPort=2000` says a key in the place of the file; `add`, `set` and `save project` take
the same keys. A key with * must be there, where the table may have it.

This page is made from `trcvtui/project/keys.py`.

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

[[peer]]                           # a partner of our own
name = "Device"
active = true
remote = "@C1"                     # whatever C1 listens on
reconnect = "T#500ms"              # connect again by itself
every = "T#1s"                     # and say something every second
says = ["hex 01 00 00 00 00 00 20 40 64 00 00 00"]
```
'''
TAIL: Final = """
## `[options]`, `[constants]`

`[options]` has the switches of the dialect, the points that its manual leaves open: the table below.
`black_box = "off"` stands there too: then nothing of a run on the screen is kept for a recording.
`[constants]` has whole numbers that the UDTs use, such as `"GVL.MAX" = 10`.
"""


def page() -> str:
    """Return the page."""
    return (
        HEAD + "".join(line + "\n" for line in _lines()) + TAIL + "".join(line + "\n" for line in _switches())
    )


def _lines() -> Iterator[str]:
    yield from _table("Above all tables", TOP)
    for kind, row in TABLES.items():
        yield from _table(f"`[[{kind}]]`", row)
        if kind in DESCRIBED:
            yield from _table(f"`[[{kind}]]` of a Siemens dialect", DESCRIBED[kind])
    yield from _table("`[sim]`", SIM)


def _table(title: str, row: TableRow) -> Iterator[str]:
    yield from ("", f"## {title}", "", row.help, "", "| key | says | takes |", "| --- | --- | --- |")
    for name, rows in _by_name(row.keys).items():
        says = " · ".join(dict.fromkeys(key.help for key in rows))
        takes = "; or ".join(dict.fromkeys(_takes(key) for key in rows))
        yield f"| `{name}`{'*' * any(key.is_needed for key in rows)} | {says} | {takes} |"


def _takes(key: Key) -> str:
    if key.kind is None:
        return ""
    is_name = key.refers is not None and not key.refers.by_at and not key.refers.words
    return f"the name of a {key.refers.what}" if key.refers and is_name else key.kind.expected


def _switches() -> Iterator[str]:
    found: dict[Switch, list[str]] = {}
    for dialect in DIALECTS.values():
        for switch in dialect.switches:
            found.setdefault(switch, []).append(dialect.name)
    yield from ("", "| switch | dialects | says | takes, the default first |", "| --- | --- | --- | --- |")
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
        return f'`"{format_time(int(switch.default))}"`, a duration'
    return f"`{switch.default}`, {switch.least} to {switch.most}"


def _by_name(rows: Iterable[Key]) -> dict[str, list[Key]]:
    found: dict[str, list[Key]] = {}
    for key in rows:
        found.setdefault(key.name, []).append(key)
    return found


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
