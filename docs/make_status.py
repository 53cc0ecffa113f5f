"""Write the STATUS atlas of each table, `docs/status-NAME.md`: `make atlas`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.blocks.status import StatusRow
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.dialects.status_report import REACH_TEXT, Explanation, add_scenarios, find_explanations
from trcvtui.scenario.scenario_index import find_scenarios

HERE: Final = Path(__file__).parent
BASES: Final = {"siemens-legacy": "siemens", "twincat": "baosky"}  # a page, and the one that it refers to

SCOPE: Final = "Each STATUS word with its likely causes and what to check."
INTRODUCTION: Final = """\
`trcvtui status CODE --dialect {name}` prints the same for one code, and its source.

`!` is ERROR=1. Commands under "Check" run on the machine of the bench. The links at the end of a card
are scenarios that show its code: `trcvtui scenario FILE`.

The last word of a card's first line says how the bench can show the code:

{reach}

`make atlas` writes this page from the tables in `trcvtui/dialects`: change it there."""


class Card(NamedTuple):
    """A row as its page prints it; `like`: the row that has what this card does not repeat, and its link."""

    one: Explanation
    like: StatusRow | None = None
    link: str = ""

    @property
    def rest(self) -> str:
        """Return what the other row has for this one: on its own page it gives causes and checks alone."""
        return "Causes and checks" if self.link.startswith("#") else "Everything else"

    def differs(self, name: str) -> bool:
        """Return whether the card has to print this part of its row."""
        value = getattr(self.one.row, name)
        if self.like is None or (self.link.startswith("#") and name not in ("causes", "checks")):
            return bool(value)
        return value != getattr(self.like, name)


def pages() -> dict[str, tuple[Dialect, ...]]:
    """Return which dialects have a page together, by its name: one table, one folder of scenarios."""
    found: dict[str, tuple[Dialect, ...]] = {}
    for dialect in DIALECTS.values():
        found[dialect.scenario_folder] = (*found.get(dialect.scenario_folder, ()), dialect)
    return found


def page(dialects: tuple[Dialect, ...]) -> str:
    """Return the atlas of dialects that have one table."""
    first, name = dialects[0], dialects[0].scenario_folder
    found = add_scenarios(find_explanations([first], None, None), {first.name: find_scenarios(name)})
    reach = "\n".join(f"- {reach}: {text}" for reach, text in REACH_TEXT.items())
    parts = ["# STATUS atlas: " + "; ".join(dialect.title for dialect in dialects)]
    base = BASES.get(name)
    rows = pages()[base][0].status if base else ()
    parts += [f"{_differences(base, first.status, rows)}" if base else SCOPE]
    parts += [INTRODUCTION.format(name=first.name, reach=reach)]
    follows = [f"- `{each.name}` follows {each.follows}." for each in dialects if each.follows]
    parts += ["\n".join(follows)] if follows else []
    return "\n\n".join([*parts, *body(found, "../", rows, f"status-{base}.md")]) + "\n"


def body(
    found: Iterable[Explanation], up: str, base: Sequence[StatusRow] = (), base_page: str = ""
) -> list[str]:
    """Return the contents and the cards of these rows without what rows of `base` say as well.

    `up` leads from the page to where file names start.
    """
    rows = sorted(found, key=lambda one: one.row.code)  # a code may have several, each for other blocks
    cards = list(_cards(rows, base, base_page))
    return [_contents(cards), *(_page_card(card, up) for card in cards)]


def _differences(base: str, rows: Sequence[StatusRow], base_rows: Sequence[StatusRow]) -> str:
    """Return what the head of a page says that prints only its differences."""
    blocks = {block for row in rows for block in row.blocks}
    mine = {(row.code, block) for row in rows for block in row.blocks}
    lacking = {
        row.word: [block for block in row.blocks if block in blocks and (row.code, block) not in mine]
        for row in _by_code(base_rows)
    }
    codes = ", ".join(f"{word} ({', '.join(of)})" for word, of in lacking.items() if of)
    others = ", ".join(dict.fromkeys(b for row in base_rows for b in row.blocks if b not in blocks))
    lines = [f"This page has only what differs from [status-{base}.md](status-{base}.md)."]
    lines += ["A code of a block that is not on this page means the same as there.", ""]
    lines += [f"- Codes that only that page has: {codes or 'none'}."]
    lines += [f"- Blocks that only that page has: {others or 'none'}."]
    return "\n".join(lines)


def _cards(found: Sequence[Explanation], base: Sequence[StatusRow], page: str) -> Iterator[Card]:
    """Yield what the page prints: not the blocks of a row for which `base` says the same."""
    links = dict(zip(map(id, rows := _by_code(base)), _anchors(rows), strict=True))
    kept = [one for one in (_differing(each, base) for each in found) if one.row.blocks]
    anchors = _anchors([one.row for one in kept])
    for at, one in enumerate(kept):
        like = next(
            (row for row in base if row.code == one.row.code and {*row.blocks} & {*one.row.blocks}), None
        )
        if like is not None:
            yield Card(one, like, f"{page}#{links[id(like)]}")
            continue
        before = [place for place in range(at) if _advice(kept[place]) == _advice(one)]
        if before:
            yield Card(one, kept[before[0]].row, f"#{anchors[before[0]]}")
        else:
            yield Card(one)


def _differing(one: Explanation, base: Sequence[StatusRow]) -> Explanation:
    known = {(row.code, block): content(row, block) for row in base for block in row.blocks}
    row = one.row
    blocks = [block for block in row.blocks if known.get((row.code, block)) != content(row, block)]
    return replace(one, row=replace(row, blocks=tuple(blocks)))


def content(row: StatusRow, block: str) -> tuple[object, ...]:
    """Return what a row says of one of its blocks."""
    told = row.title, row.error, row.reach, row.unreached, row.unsure, row.manual
    return (*told, row.causes_of(block), row.checks_of(block))


def _advice(one: Explanation) -> tuple[object, ...]:
    return one.row.causes, one.row.checks


def _by_code(rows: Iterable[StatusRow]) -> list[StatusRow]:
    return sorted(rows, key=lambda row: row.code)


def _anchors(rows: Iterable[StatusRow]) -> list[str]:
    """Return the anchors that GitHub gives the headings of these rows."""
    headings: Counter[str] = Counter()
    found = []
    for row in rows:
        anchor = row.word.replace("#", "").lower()
        found.append(f"{anchor}-{headings[anchor]}" if headings[anchor] else anchor)
        headings[anchor] += 1
    return found


def _contents(cards: Sequence[Card]) -> str:
    lines = ["| code | | meaning | blocks |", "| --- | --- | --- | --- |"]
    for card, anchor in zip(cards, _anchors([card.one.row for card in cards]), strict=True):
        row = card.one.row
        mark = "!" if row.error else " "
        lines.append(f"| [{row.word}](#{anchor}) | {mark} | {_plain(row.title)} | {', '.join(row.blocks)} |")
    return "\n".join(lines)


def _page_card(card: Card, up: str) -> str:
    row = card.one.row
    error = "ERROR=1" if row.error else "no error"
    scenarios = [f"[{_name(file)}]({up}{file})" for file in card.one.select_scenarios()]
    parts = [
        f"## {row.word}",
        f"**{_plain(row.title)}** · {error} · {', '.join(row.blocks)} · {row.reach}",
        *(_list("Causes", row.causes) if card.differs("causes") else ()),
        *(_list("Check", row.checks) if card.differs("checks") else ()),
        *(_sentence("Not certain", row.unsure) if card.differs("unsure") else ()),
        *(_sentence("Not on this bench", row.unreached) if card.differs("unreached") else ()),
        *([f"{card.rest}: as [{card.like.word}]({card.link})."] if card.like else []),
        " · ".join(scenarios),
    ]
    return "\n\n".join(filter(None, parts))


def _list(title: str, texts: Sequence[str]) -> list[str]:
    return ["\n".join([f"{title}:", "", *(f"- {_plain(text)}" for text in texts)])]


def _sentence(title: str, text: str) -> list[str]:
    return [f"{title}: {_plain(text or 'nothing')}."]


def _name(file: str) -> str:
    return file.rpartition("/")[2].removesuffix(".toml")


def _plain(text: str) -> str:
    return "`".join(
        part if place % 2 else "".join(_escaped(part))  # every other part is code
        for place, part in enumerate(text.split("`"))
    )


def _escaped(text: str) -> Iterator[str]:
    return (f"\\{c}" if c in "<>|*[]\\" else c for c in text)


def main() -> None:
    """Write them all."""
    for name, dialects in pages().items():
        (HERE / f"status-{name}.md").write_text(page(dialects), encoding="utf-8")


if __name__ == "__main__":
    main()
