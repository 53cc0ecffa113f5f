"""Write the table that `trcvtui status CODE` answers from, `trcvtui/status_table.py`: `make tables`."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.dialects.status_report import as_text, explain, is_number, with_telling
from trcvtui.rig.scenario.scenario_index import scenarios_of

TABLE: Final = Path(__file__).parents[1] / "trcvtui" / "status_table.py"
HEAD: Final = '''"""What `trcvtui status CODE` prints, each line once. `make tables` writes it."""

# fmt: off
'''


def table() -> str:
    """Return the module: the lines, then a row a card: dialects, code, whether as a number, its lines."""
    places: dict[str, int] = {}
    cards: dict[tuple[str, int, bool, tuple[int, ...]], list[str]] = {}  # by folder: each keeps its order
    for name, dialect in DIALECTS.items():
        folder = dialect.scenario_folder
        for one in with_telling(
            explain([dialect], None, None), lambda _, wanted, of=folder: scenarios_of(of, None, wanted)
        ):
            told = as_text([one]).replace(f" · {name}, manual ", " · {}, manual ", 1)
            lines = tuple(places.setdefault(line, len(places)) for line in told.split("\n"))
            cards.setdefault((folder, one.row.code, is_number(one.row), lines), []).append(name)
    rows = [(" ".join(names), *card) for (_, *card), names in cards.items()]
    return "\n".join(
        [
            HEAD,
            f"DIALECTS: tuple[str, ...] = {tuple(DIALECTS)}",
            "LINES: tuple[str, ...] = (",
            *(f"    {line!r}," for line in places),
            ")",
            "ROWS: tuple[tuple[str, int, bool, tuple[int, ...]], ...] = (",
            *(f"    {row!r}," for row in rows),
            ")",
            "",
        ]
    )


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
