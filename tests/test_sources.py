"""What a reader sees names manuals and pages that anyone can open, and nothing that only we have."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from trcvtui.cli.main import COMMANDS, main
from trcvtui.dialects import DIALECTS

ROOT = Path(__file__).parents[1]
PRIVATE = re.compile(
    r"(?<!-)\b(?:design|receivedata|baosky|performance|aesthetics)\.md|\b(?:siemens|udt)\.md \w?\d"
    r"|status-reproduction|\b(?:design|contract|decision) (?:section )?\d|\bSR \d|\brows? \d+\b(?! of|#)"
    r"|\bissue \d\d?\b|\([AU]\d+(?:, [AU]\d+)*\)|\[(?:M|mem|DEC|inf)\]|\breference/",
    re.IGNORECASE,
)
FILES = (
    *(ROOT / "trcvtui").rglob("*.py"),
    *(ROOT / "configs").rglob("*.toml"),
    *(ROOT / "docs").glob("*.md"),
    *ROOT.glob("*.md"),
)


def texts_of_dialects() -> Iterator[str]:
    for dialect in DIALECTS.values():
        yield from (dialect.title, dialect.follows, *(switch.text for switch in dialect.switches))
        for row in dialect.status:
            yield from (row.title, *row.causes, *row.checks, row.manual, row.unreached, row.unsure)


def helps(capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    for words in ([], *([name] for name in COMMANDS)):
        assert main([*words, "--help"]) == 0
        yield from capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(
    "text",
    ["siemens.md 1.5", "baosky.md 15.3", "design 6, row 16", "contract 4.3", "SR 2.2", "as ever (A1)",
     "(row 22)", "Row 7: no byte", "decision 21", "udt.md U12"],
)  # fmt: skip
def test_a_private_reference_is_found(text: str) -> None:
    assert PRIVATE.search(text)


def test_no_text_that_a_user_reads_names_what_only_we_have(capsys: pytest.CaptureFixture[str]) -> None:
    lines = [line for file in FILES for line in file.read_text(encoding="utf-8").splitlines()]
    read = [*lines, *texts_of_dialects(), *helps(capsys), *(file.name for file in FILES)]
    assert len(read) > 50_000
    assert [line for line in read if PRIVATE.search(line)] == []


def test_each_row_names_a_manual() -> None:
    manuals = ("Baosky library manual 7.15.", "STEP 7 help", "TwinCAT TF6340 help, ")
    sources = {row.manual for dialect in DIALECTS.values() for row in dialect.status}
    assert [source for source in sources if not source.startswith(manuals)] == []
