"""Write the STATUS atlas of each table, `docs/status-NAME.md`: `make atlas`."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.dialects.status_report import as_page, explain, with_scenarios
from trcvtui.scenario.scenario_index import scenarios_of

HERE: Final = Path(__file__).parent


def pages() -> dict[str, tuple[Dialect, ...]]:
    """Return which dialects have a page together, by its name: one table, one folder of scenarios."""
    found: dict[str, tuple[Dialect, ...]] = {}
    for dialect in DIALECTS.values():
        found[dialect.scenario_folder] = (*found.get(dialect.scenario_folder, ()), dialect)
    return found


def page(dialects: tuple[Dialect, ...]) -> str:
    """Return the atlas of dialects that have one table."""
    first = dialects[0]
    found = with_scenarios(explain([first], None, None), {first.name: scenarios_of(first.scenario_folder)})
    follows = [(dialect.name, dialect.follows) for dialect in dialects if dialect.follows]
    return as_page("; ".join(dialect.title for dialect in dialects), found, "../", follows)


def main() -> None:
    """Write them all."""
    for name, dialects in pages().items():
        (HERE / f"status-{name}.md").write_text(page(dialects), encoding="utf-8")


if __name__ == "__main__":
    main()
