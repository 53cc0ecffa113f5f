"""The program's first door, also `python -m trcvtui`: `status CODE` out of a table, all else is cli.py's.

Rule: nothing is imported here; what stands on the way of `status` is most of what it costs.
"""

import sys

HEX = "0123456789ABCDEF"


def main() -> int:
    """Run the command line of this process; return its exit code."""
    card = None if sys.stdout is None else status_card(sys.argv[1:])
    if card is None:
        from trcvtui.cli import main

        return main()
    try:
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]  # never a stand-in here
        sys.stdout.write(card)
        sys.stdout.flush()
        return 0
    except OSError as failed:
        from trcvtui.cli import output_failed

        return output_failed(failed)


def status_card(words: list[str]) -> str | None:
    """Return what `status CODE` and `status CODE --dialect NAME` print; None: cli.py has to say it."""
    if words[:1] != ["status"] or len(words) not in (2, 4) or (len(words) == 4 and words[2] != "--dialect"):
        return None
    text = words[1].upper()
    for before in ("W#16#", "WORD#16#", "16#", "0X"):
        if text.startswith(before):
            text = text[len(before) :]
            break
    if not 1 <= len(text) <= 4 or text.strip(HEX):
        return None
    from trcvtui.status_table import DIALECTS, LINES, ROWS

    code = int(text, 16)
    number = int(words[1]) if words[1].isdecimal() else code
    chosen = DIALECTS if len(words) == 2 else (words[3].casefold(),)
    cards = [
        "\n".join([LINES[at] for at in lines]).replace(" · {}, manual ", f" · {dialect}, manual ", 1)
        for dialect in chosen
        for names, shown, is_number, lines in ROWS
        if shown == (number if is_number else code) and dialect in names.split()
    ]
    return "\n\n".join(cards) + "\n" if cards else None


if __name__ == "__main__":
    raise SystemExit(main())
