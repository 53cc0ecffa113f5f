"""The STATUS atlas of a dialect as one Markdown page: a table of contents, then a card for each code.

It reads well on GitHub and as plain text: short lines, no HTML, a blank line around everything.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from trcvtui.dialects.status_report import Explained, reach_text


def as_page(title: str, found: Sequence[Explained], up: str, follows: Sequence[tuple[str, str]] = ()) -> str:
    """Return the page of these rows; `up` leads from the page to where file names start, such as `../`.

    `follows`: dialects, and the document that the course of each stands in.
    """
    rows = sorted(
        found, key=lambda one: one.row.code
    )  # a code may have a row for some blocks, one for others
    documents = "\n".join(f"- `{name}` follows {document}." for name, document in follows)
    head = [f"# STATUS atlas: {title}", _INTRODUCTION, *([documents] if documents else [])]
    parts = [*head, _contents(rows), *(_card(one, up) for one in rows)]
    return "\n\n".join(parts) + "\n"


_INTRODUCTION = """\
Every STATUS word with its likely causes and what to look at next, as `trcvtui status CODE` tells it.
This page is made by `make atlas` out of the tables in `trcvtui/dialects`: change it there.

`!` stands for ERROR=1. The commands named under "look at" run on the machine that runs the bench."""


def _contents(found: Iterable[Explained]) -> str:
    lines = ["| code | | meaning | blocks |", "| --- | --- | --- | --- |"]
    headings: Counter[str] = Counter()
    for one in found:
        row = one.row
        link = f"[{row.word}](#{_anchor(row.word, headings[row.word])})"
        headings[row.word] += 1
        mark = "!" if row.error else " "
        lines.append(f"| {link} | {mark} | {_plain(row.title)} | {', '.join(row.blocks)} |")
    return "\n".join(lines)


def _card(one: Explained, up: str) -> str:
    row = one.row
    error = "ERROR=1" if row.error else "no error"
    return "\n".join(
        [
            f"## {row.word}",
            "",
            f"**{_plain(row.title)}** · {error} · {', '.join(row.blocks)}",
            "",
            "Likely causes",
            "",
            *(f"- {_plain(cause)}" for cause in row.causes),
            "",
            "Look at",
            "",
            *(f"- {_plain(check)}" for check in row.checks),
            "",
            *(["Not certain", "", f"- {_plain(row.unsure)}", ""] if row.unsure else []),
            "How to see it",
            "",
            f"- {_plain(reach_text(row))} ({row.reach})",
            *(f"- [{_name(file)}]({up}{file})" for file in one.telling()),
            f"- manual {row.manual}",
        ]
    )


def _name(file: str) -> str:
    return file.rpartition("/")[2].removesuffix(".toml")


def _anchor(heading: str, before: int) -> str:
    """Return the anchor that GitHub gives a heading of one word; `before`: how many like it came before."""
    anchor = "".join(c for c in heading.lower() if c.isalnum())
    return f"{anchor}-{before}" if before else anchor


def _plain(text: str) -> str:
    """Return text that Markdown shows as it stands; what is between backquotes is literal already."""
    return "`".join(
        part if within_code else "".join(_escaped(part)) for within_code, part in _parts(text.split("`"))
    )


def _parts(parts: Sequence[str]) -> Iterator[tuple[bool, str]]:
    return ((bool(place % 2), part) for place, part in enumerate(parts))


def _escaped(text: str) -> Iterator[str]:
    return (f"\\{c}" if c in "<>|*[]\\" else c for c in text)
