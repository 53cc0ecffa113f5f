"""Explain STATUS words as text and as JSON: pure functions from rows to text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.blocks.table import block_row
from trcvtui.dialects.dialect import INTERNAL_FAULT, Dialect
from trcvtui.errors import mistake
from trcvtui.wording import format_columns

CODE_PATTERN: Final = re.compile(r"\s*(?:(?:W(?:ORD)?#)?16#|0x)?([0-9a-f]{1,4})\s*", re.IGNORECASE | re.ASCII)
REACH_TEXT: Final = {
    Reproducibility.REAL: "by real traffic, also on this machine alone",
    Reproducibility.LOGIC: "by the pins alone, without a network",
    Reproducibility.NAMESPACE: "by a dead link: `link C1 down`, simulated or live on Linux",
    Reproducibility.INJECTED: "by a fault injected before the named call: `fault CALL ERRNO`",
    Reproducibility.NEVER: "by nothing on this bench",
}
MOST_SCENARIOS: Final = 3
NOTE_PREFIX: Final = "note-"  # begins the name of a scenario that plays a note of the manual

ScenariosByCode = Mapping[tuple[int, str], Sequence[str]]  # a code and a block: the files that show it
NO_SCENARIOS: Final[ScenariosByCode] = {}


class Explanation(Struct, frozen=True):
    """One row, the dialect that it belongs to, and the scenario files that show it."""

    dialect: str
    row: StatusRow
    scenarios: tuple[str, ...] = ()

    def select_scenarios(self) -> tuple[str, ...]:
        """Return the scenarios named for this code, first those whose name begins with the code.

        For an error, a few scenarios of the manual's notes follow. If none fits, take the first few.
        """
        named = sorted(filter(self._is_named_in, self.scenarios), key=lambda file: self._place_in(file) > 0)
        notes = [file for file in self.scenarios if _is_note_scenario(file) and file not in named]
        return (*named, *notes[: MOST_SCENARIOS if self.row.error else 0]) or self.scenarios[:MOST_SCENARIOS]

    def may_select(self, file: str) -> bool:
        """Return whether `select_scenarios` prefers a scenario of this name if it shows the code."""
        return self._is_named_in(file) or (self.row.error and _is_note_scenario(file))

    def _is_named_in(self, file: str) -> bool:
        return self._place_in(file) >= 0

    def _place_in(self, file: str) -> int:
        return file.rpartition("/")[2].upper().find(self.row.word[3:])


def _is_note_scenario(file: str) -> bool:
    return file.rpartition("/")[2].startswith(NOTE_PREFIX)


def parse_code(text: str) -> int:
    """Return the code of `80C5`, `16#80C5`, `W#16#80C5` or `0x80c5`; raise UserError for other texts."""
    found = CODE_PATTERN.fullmatch(text) if len(text) <= 32 else None
    if found is None:
        raise mistake("CODE", f"'{text[:32]}'", "a STATUS word such as 80C5, 16#80C5, W#16#80C5 or 0x80c5")
    return int(found.group(1), 16)


def parse_number(text: str) -> int | None:
    """Return the number of a decimal such as `23`, as Error of ReceiveData shows it, else None."""
    digits = text.strip()
    return int(digits) if digits.isdecimal() and digits.isascii() and len(digits) <= 5 else None


def select_dialects(dialects: Sequence[Dialect], name: str | None) -> tuple[Dialect, ...]:
    """Return the dialect of that name, or all of them; raise UserError for an unknown name."""
    chosen = tuple(d for d in dialects if name is None or d.name == name.casefold())
    if not chosen:
        raise mistake("--dialect", f"'{name}'", "one of " + ", ".join(d.name for d in dialects))
    return chosen


def find_explanations(
    dialects: Sequence[Dialect], code: int | None, block: str | None, number: int | None = None
) -> list[Explanation]:
    """Return the rows that have this code and block. None selects all. Raise UserError if no row has both.

    For blocks whose Error is a UINT, `number` is the code read as a decimal, or None if it is no decimal.
    """
    wanted = None if block is None else _find_block(dialects, block)
    decimal = code if number is None else number
    found = [
        Explanation(dialect.name, row)
        for dialect in dialects
        for row in dialect.status
        if (decimal if is_number(row) else code) in (None, row.code)
        and (wanted is None or wanted in row.blocks)
    ]
    if not found:
        names = ", ".join(dialect.name for dialect in dialects)
        table = f"the table of {names}" if wanted is None else f"the table of {wanted} ({names})"
        reads_decimals = all(any(map(is_number, dialect.status)) for dialect in dialects)
        shown = f"16#{code:04X}" + (f", or the number {number}" if number and reads_decimals else "")
        if f"{code:04X}" in INTERNAL_FAULT.values:
            shown += f", {INTERNAL_FAULT.text}"
        option = f"--dialect {names}" if len(dialects) == 1 else "--all"
        raise mistake("CODE", shown, f"a code in {table}; `trcvtui status {option}` lists them")
    return found


def select_one_dialect(found: Sequence[Explanation], name: str | None) -> tuple[list[Explanation], list[str]]:
    """Return the rows of a dialect, and the names of the other dialects with rows.

    If `name` is None, take the first dialect that has rows. Raise UserError if the named dialect has none.
    """
    names = list(dict.fromkeys(one.dialect for one in found))
    chosen = names[0] if name is None else name.casefold()
    others = [each for each in names if each != chosen]
    if chosen not in names:
        raise mistake("CODE", f"{found[0].row.word} of {', '.join(others)}", f"a code of {chosen}")
    return [one for one in found if one.dialect == chosen], others


def is_number(row: StatusRow) -> bool:
    """Return whether the blocks of a row show the code as a number (Error), not as a WORD."""
    return all(block_row(block).has_com_buffer for block in row.blocks)


def add_scenarios(
    found: Iterable[Explanation], by_dialect: Mapping[str, ScenariosByCode]
) -> list[Explanation]:
    """Return the rows with the scenarios that show them. `by_dialect` has the scenarios of each dialect."""
    return [
        replace(one, scenarios=_scenarios_of(one.row, by_dialect.get(one.dialect, NO_SCENARIOS)))
        for one in found
    ]


def add_card_scenarios(
    found: Iterable[Explanation], scenarios_of: Callable[[str, Callable[[str], bool]], ScenariosByCode]
) -> list[Explanation]:
    """Return the rows with enough scenarios for a card. `scenarios_of` reads the files that a test accepts.

    If a preferred scenario shows the code, other scenarios are not read. Reading all files takes 100 ms.
    """
    return [_with_card_scenarios(one, scenarios_of) for one in found]


def _with_card_scenarios(
    one: Explanation, scenarios_of: Callable[[str, Callable[[str], bool]], ScenariosByCode]
) -> Explanation:
    scenarios = _scenarios_of(one.row, scenarios_of(one.dialect, one.may_select))
    return replace(
        one, scenarios=scenarios or _scenarios_of(one.row, scenarios_of(one.dialect, lambda file: True))
    )


def _scenarios_of(row: StatusRow, by_code: ScenariosByCode) -> tuple[str, ...]:
    return tuple(sorted({file for block in row.blocks for file in by_code.get((row.code, block), ())}))


def _find_block(dialects: Sequence[Dialect], block: str) -> str:
    known = sorted({name for dialect in dialects for row in dialect.status for name in row.blocks})
    found = next((name for name in known if name.upper() == block.upper()), None)
    if found is None:
        raise mistake("--block", f"'{block}'", "one of " + ", ".join(known))
    return found


def as_json(found: Iterable[Explanation]) -> str:
    """Return a JSON list of objects. New keys come after `checks`."""
    import json  # here: the text needs none, and a command line starts faster without

    return json.dumps([_as_object(one) for one in found], indent=2)


def describe_reach(row: StatusRow) -> str:
    """Return how a code can be brought about here, or why it cannot."""
    told = f"can be brought about {REACH_TEXT[row.reach]}"
    return f"{told}: {row.unreached}" if row.unreached else told


def _as_object(one: Explanation) -> dict[str, object]:
    row = one.row
    said = {"unreached": row.unreached, "unsure": row.unsure}
    return {
        "code": row.word,
        "dialect": one.dialect,
        "blocks": list(row.blocks),
        "error": row.error,
        "title": row.title,
        "causes": list(row.causes),
        "checks": list(row.checks),
        "manual": row.manual,
        "reach": str(row.reach),
        "scenarios": list(one.scenarios),
        **{key: text for key, text in said.items() if text},
    }


def as_text(found: Iterable[Explanation], others: Sequence[str] = (), asked: str | None = None) -> str:
    """Return a card for each row: what it means, likely causes, what to look at next.

    The last line names the `others` that have the code. If `asked` lacks it, the first line says so.
    """
    cards = [(one.dialect, _card(one)) for one in found]
    lacks = asked not in (None, cards[0][0])
    first = [f"{asked} has no such code; this is how {cards[0][0]} explains it:"] if lacks else []
    last = [f"also in: {', '.join(others)} (--dialect NAME, or --all)"] if others else []
    return "\n\n".join([*first, *(card for _, card in cards), *last])


def _card(one: Explanation) -> str:
    row = one.row
    lines = [
        f"{row.word}  {row.title}",
        f"  {'ERROR=1' if row.error else 'no error'} · {', '.join(row.blocks)} · {one.dialect}",
        "  likely causes",
        *(f"    - {cause}" for cause in row.causes),
        "  look at",
        *(f"    - {check}" for check in row.checks),
        *([f"  not certain: {row.unsure}"] if row.unsure else []),
        f"  {describe_reach(row)}",
        *(f"  to see it: trcvtui scenario {file}" for file in one.select_scenarios()),
        f"  source: {row.manual}",
    ]
    return "\n".join(lines)


def as_table(found: Iterable[Explanation]) -> str:
    """Return one line for each row, with dialect, code, `!` for ERROR=1, title and blocks."""
    rows = (
        (
            one.dialect,
            f"{one.row.word} {'!' if one.row.error else ' '}",
            one.row.title,
            " ".join(one.row.blocks),
        )
        for one in found
    )
    return "\n".join(format_columns(rows, "llll"))
