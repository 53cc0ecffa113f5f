"""What is yanked from the lab: the comparison, the bytes, the ranking, the cure, as text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trcvtui.tui.copying.copy_formats import Format, Subject
from trcvtui.tui.lab_model.lab import Lab
from trcvtui.udt.byte_forms import hex_lines
from trcvtui.udt.compare.fit_report import reason_lines

if TYPE_CHECKING:
    from trcvtui.tui.lab.panes import CureText

MOST_ROWS: Final = 70_000


def _nothing(of: Subject) -> str:
    return ""


def text_of(pane: str, lab: Lab, cure: CureText) -> tuple[Format, str] | None:
    """Return what a pane is about, with its name; None where there is nothing."""
    match pane:
        case "tree":
            text, name, suffix = _compared(lab), "both sides", ".txt"
        case "hex":
            text, name, suffix = hex_lines(lab.bytes.content, ""), "bytes as hex", ".txt"
        case "fit":
            text, name, suffix = _ranking(lab), "the ranking", ".txt"
        case _:
            found = cure.write()
            text = found.source if found.text else ""
            name, suffix = f"the cure in {cure.language.upper()}", f".{cure.language}"
    return (Format(pane[0], name, _nothing, suffix), text) if text else None


def _compared(lab: Lab) -> str:
    from trcvtui.udt.compare.compare import Count
    from trcvtui.udt.compare.compare_report import compare_text  # read when first asked for

    comparison = lab.comparison()
    if comparison is None or comparison.row_count > MOST_ROWS:
        return ""
    return "".join(f"{line}\n" for line in compare_text(comparison, lab.bytes.content, Count()))


def _ranking(lab: Lab) -> str:
    lines = [lab.judgement] if lab.fits else []
    for found in lab.fits:
        lines.append(str(found))
        lines += [f"    {line}" for line in reason_lines(found)]
    return "\n".join(lines) + "\n" if lines else ""
