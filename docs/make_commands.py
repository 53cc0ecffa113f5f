"""Write `docs/commands.md`: each command with its options, from `trcvtui/cli`: `make atlas`."""

from __future__ import annotations

from argparse import SUPPRESS, Action, _SubParsersAction
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from trcvtui.cli.main import COMMAND_GROUPS, COMMANDS, parser_of
from trcvtui.cli.options import CommandParser

PAGE: Final = Path(__file__).parent / "commands.md"
HEAD: Final = """\
# Commands

`trcvtui` alone opens the built-in demo. `trcvtui COMMAND --help` prints what this page says about a command.
Commands to a running bench: [bench commands](bench-commands.md). The screen: [keys](keys.md).

`make atlas` writes this page from `trcvtui/cli`.

## Exit codes

| code | means |
| --- | --- |
| 0 | all is well |
| 1 | `scenario`: an expectation failed. `replay --check`: the run differs. `doctor`: findings |
| 1 | `messages`: no row. `udt compare`: the layouts differ. `udt fit`: no single best fit |
| 2 | a file or an argument is wrong, or stdout is closed or full. A line on stderr says which |
| 130 | Ctrl+C |
| 141 | the program that reads stdout has ended |

stdout is data, messages go to stderr. A stderr that is closed or full changes no exit code.
"""
# What only a page has room for.
NOTES: Final = {
    "serve": "What tabs share and who may open them: [serve.md](serve.md).",
    "scenario": """\
`--format junit` prints one XML document for Jenkins and GitLab. The records of `--format jsonl` and the
lines of an ERROR: [scenario-output.md](scenario-output.md). Recordings: [recording.md](recording.md).""",
    "record": "Rings, triggers and what a recording holds: [recording.md](recording.md).",
    "replay": "The time line and what-if runs: [recording.md](recording.md).",
    "recording": "What each option leaves out: [recording.md](recording.md#share-a-recording).",
    "watch": """\
On a terminal it opens the screen, in which `?? ??` marks bytes that the capture lacks. Else it prints lines.
Without --project it makes a project for each direction of each PLC end. Datagrams go through URECV_C,
serial lines through the project's ReceiveData. See [a mirror port](line.md#a-mirror-port).""",
    "tap": """\
Without a terminal it reads [bench commands](bench-commands.md#a-tap) from stdin. What happens when it ends,
and when the far end refuses: [a tap](line.md#a-tap).""",
    "conversations": "It reads captures of Wireshark, dumpcap and tcpdump.",
    "messages": "What a message is, the columns and the conditions: [messages.md](messages.md).",
    "doctor": """\
It exits with 2 if no file could be read. `--scheduler` needs `pip install "trcvtui[cluster]"`. Without TLS
a scheduler trusts everybody who can connect to it. The findings: [doctor.md](doctor.md).""",
    "status": """\
All codes: [Baosky](status-baosky.md), [Siemens](status-siemens.md), [legacy](status-siemens-legacy.md),
[TwinCAT](status-twincat.md).""",
    "st": """\
SCL calls the single-instance DB, `"TRCV_C_1"(...)`, or with `--multi` a multi-instance, `#TRCV_C_1(...)`.
The bytes that the project's `start` writes into DATA become its initial value.""",
    "udt": "Formats, layouts and cures: [udt.md](udt.md).",
    "completion": """\
For bash and zsh: `eval "$(trcvtui completion bash)"`. For fish: `trcvtui completion fish | source`.""",
    "agent": "Alerts and a service for systemd: [fleet.md](fleet.md); topics: [formats](fleet-formats.md).",
    "fleet": "The columns and keys of its screen: [fleet.md](fleet.md).",
}


def page() -> str:
    """Return the page."""
    whole = commands_of(parser_of(()))
    assert set(NOTES) <= set(whole), set(NOTES) - set(whole)
    return HEAD + "".join(line + "\n" for line in _lines(whole))


def commands_of(parser: CommandParser) -> dict[str, CommandParser]:
    """Return the parsers of the commands below a parser, by name."""
    found: dict[str, CommandParser] = {}
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            found |= action.choices
    return found


def _lines(whole: dict[str, CommandParser]) -> Iterator[str]:
    for title, group in COMMAND_GROUPS.items():
        yield from ("", f"## {title}", "", "| command | does | example |", "| --- | --- | --- |")
        for name, (about, example, *_) in group.items():
            yield f"| [`{name}`](#{name}) | {about} | `{f'trcvtui {name} {example}'.strip()}` |"
        for name in group:
            yield from _command(name, whole[name])
    assert sorted(name for group in COMMAND_GROUPS.values() for name in group) == sorted(COMMANDS)


def _command(name: str, parser: CommandParser) -> Iterator[str]:
    below = commands_of(parser)
    yield from ("", f"### {name}", "", f"{parser.description}")
    yield from ("", "```text", *map(usage, below.values() or [parser]), "```")
    if name in NOTES:
        yield from ("", NOTES[name])
    if below:
        yield from ("", "| command | does |", "| --- | --- |")
        abouts = _abouts(parser)
        yield from (f"| `{name} {word}` | {_cell(abouts[word])} |" for word in below)
        longer = {
            w: p.description for w, p in below.items() if f"{p.description}".lower()[:-1] != abouts[w].lower()
        }
        yield from [""] * bool(longer)
        yield from (f"- `{word}`: {text}" for word, text in longer.items())
    options = _options(below) if below else [(_called(a), _cell(_help(a)), "") for a in _shown(parser)]
    if any(of for *_, of in options):
        yield from ("", "| argument or option | does | of |", "| --- | --- | --- |")
        yield from (f"| {called} | {about} | {of or 'all'} |" for called, about, of in options)
    elif options:
        yield from ("", "| argument or option | does |", "| --- | --- |")
        yield from (f"| {called} | {about} |" for called, about, _ in options)


def _abouts(parser: CommandParser) -> dict[str, str]:
    """Return what the help of a command says of those below it."""
    subs = next(action for action in parser._actions if isinstance(action, _SubParsersAction))
    return {each.dest: each.help or "" for each in subs._choices_actions}


def usage(parser: CommandParser) -> str:
    """Return a line with what has to be given; everything else is an option."""
    parts = []
    for action in parser._actions:
        word = _word(action)
        if action.option_strings and action.required:
            parts.append(f"{action.option_strings[0]} {word}")
        elif not action.option_strings and action.nargs == "?":
            parts.append(f"[{word}]")
        elif not action.option_strings:
            parts.append(f"{word}{'...' if action.nargs == '+' else ''}")
    has_more = any(action.option_strings and not action.required for action in _shown(parser))
    return " ".join([parser.prog, *["[options]"] * has_more, *parts])


def _shown(parser: CommandParser) -> Iterator[Action]:
    for action in parser._actions:
        if action.help != SUPPRESS and action.dest != "help" and not isinstance(action, _SubParsersAction):
            yield action


def _options(parsers: dict[str, CommandParser]) -> list[tuple[str, str, str]]:
    """Return the options of several commands, each once, with the commands that alone have it."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, parser in parsers.items():
        for action in _shown(parser):
            found.setdefault((_called(action), _cell(_help(action))), []).append(name)
    return [(*row, ", ".join(names) if len(names) < len(parsers) else "") for row, names in found.items()]


def _called(action: Action) -> str:
    if not action.option_strings:
        return f"`{_cell(_word(action))}`"
    return "`" + _cell(" ".join([action.option_strings[0], *[_word(action)] * (action.nargs != 0)])) + "`"


def _word(action: Action) -> str:
    """Return what stands for the value of an argument."""
    return str(action.metavar or "|".join(map(str, action.choices or [action.dest.upper()])))


def _help(action: Action) -> str:
    return action.help or ""


def _cell(text: str | None) -> str:
    return (text or "").replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
