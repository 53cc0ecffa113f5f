"""Write the STATUS atlas of each dialect, `docs/status-NAME.md`: `make atlas`."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.dialects.status_page import as_page
from trcvtui.dialects.status_report import explain, with_scenarios
from trcvtui.rig.scenario_shelf import scenarios_of

HERE: Final = Path(__file__).parent


def page(dialect: Dialect) -> str:
    """Return the atlas of a dialect."""
    shelves = {dialect.name: scenarios_of(dialect.shelf)}
    found = with_scenarios(explain([dialect], None, None), shelves)
    return as_page(dialect.title, found, "../")


def main() -> None:
    """Write them all."""
    for dialect in DIALECTS.values():
        (HERE / f"status-{dialect.name}.md").write_text(page(dialect), encoding="utf-8")


if __name__ == "__main__":
    main()
