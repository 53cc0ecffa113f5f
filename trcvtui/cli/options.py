"""What the groups of commands share: the parser, options of several commands, what is printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final, NoReturn

from trcvtui.errors import one_line
from trcvtui.paths import resolve_path

if TYPE_CHECKING:
    from trcvtui.project.project import Project
    from trcvtui.recording.files import EntrySink, FileSink, RecordTarget

GOOD: Final = 0
FAILED: Final = 1
WRONG_INPUT: Final = 2
KERNELS: Final = ("sim", "live")
THEME_NAMES: Final = (  # ours, then Textual's: to import it for their names takes 0.1 s
    "dark", "light", "ansi", "textual-dark", "textual-light", "nord", "gruvbox", "dracula", "monokai",
    "flexoki", "tokyo-night", "catppuccin-mocha", "catppuccin-latte", "catppuccin-frappe",
    "catppuccin-macchiato",
    "solarized-light", "solarized-dark", "rose-pine", "rose-pine-moon", "rose-pine-dawn", "atom-one-dark",
    "atom-one-light", "ansi-dark", "ansi-light",
)  # fmt: skip

Args = SimpleNamespace


class _WideHelpFormatter(argparse.HelpFormatter):
    """Help for 80 columns; text with line breaks keeps them."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=78)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


class CommandParser(argparse.ArgumentParser):
    """Prints a mistake as one line. When the help is shown, `make_epilog` makes its last lines."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=_WideHelpFormatter, allow_abbrev=False, **settings)
        self.make_epilog: Callable[[], str] | None = None
        self.given: Sequence[str] = ()  # the arguments after the command's name

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_INPUT, one_line(f"{self.prog}: {message}") + "\n")

    def format_help(self) -> str:
        if self.make_epilog is not None:  # names of dialects and formats need slow imports: only for help
            self.epilog = self.make_epilog()
        return super().format_help()


Add = Callable[[CommandParser], None]  # its arguments
Run = Callable[[Args], int] | None  # None: it has commands of its own
CommandRow = tuple[str, Add, Run]  # what a command does, in a few words
CommandRows = Mapping[str, CommandRow]


def add_commands(parser: CommandParser, rows: CommandRows, metavar: str = "WHAT", **settings: Any) -> None:
    """Add the command that the first argument names, else all commands. Each command costs 1 ms."""
    commands = parser.add_subparsers(metavar=metavar, **settings)
    for name in [word for word in parser.given[:1] if word in rows] or rows:
        about, add, run = rows[name]
        command = commands.add_parser(name, help=about, description=f"{about[0].upper()}{about[1:]}.")
        command.given = parser.given[1:]
        command.set_defaults(command=run)
        add(command)


# -- options --------------------------------------------------------------------------------------------


def add_format(parser: CommandParser, *names: str, is_text_default: bool = False) -> None:
    default = None if is_text_default else names[0]
    parser.add_argument(
        "--format", choices=names, default=default, help=f"output format; default: {default or 'text'}"
    )


def add_kernel(parser: CommandParser, default: str = "live", of: str = "") -> None:
    about = f"network{of} (sim: simulated, live: that of this machine); default: {default}"
    parser.add_argument("--kernel", choices=KERNELS, default=default, help=about)


def add_project(parser: CommandParser, help: str | None = None) -> None:
    """Add the project as the first argument, or as the option --project if `help` is given."""
    name, about = ("--project", help) if help else ("project", "the project file")
    parser.add_argument(name, metavar="PROJECT.toml", type=resolve_path, help=about)


def add_plc(parser: CommandParser, default: str = "guessed") -> None:
    parser.add_argument("--plc", metavar="ADDR[:PORT]", help=f"address of the PLC end; default: {default}")


def add_set(parser: CommandParser, help: str) -> None:
    parser.add_argument("--set", metavar="PATH=VALUE", action="append", default=[], help=help)


def add_theme(parser: CommandParser, default: str | None = argparse.SUPPRESS) -> None:
    about = "colours: dark, light, ansi or a theme of Textual such as nord; default: dark, or "
    about += "ansi on a terminal of 16 colours or fewer"
    parser.add_argument("--theme", choices=THEME_NAMES, metavar="NAME", default=default, help=about)


def add_netns(parser: CommandParser) -> None:
    parser.add_argument(
        "--netns", action="store_true", help="with --kernel live: run in a new network namespace (Linux)"
    )


def add_no_secrets(parser: CommandParser) -> None:
    parser.add_argument(
        "--no-secrets",
        action="store_true",
        help="no TLS keys, zeros for TLS data; a TLS run cannot be replayed",
    )


def add_record(parser: CommandParser, places: str) -> None:
    parser.add_argument("--record", metavar=places, help="record the run as pcapng, which Wireshark reads")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    add_no_secrets(parser)


def record_target(args: Args) -> RecordTarget | None:
    if args.record is None:
        return None
    from trcvtui.recording.files import RecordTarget

    return RecordTarget(Path(args.record), args.overwrite, not args.no_secrets, follow=run_sink())


def run_sink() -> Callable[[FileSink, str], EntrySink]:
    from trcvtui.replay.follower import KeyframingSink

    return KeyframingSink


def load_bench_project(path: Path, sets: Sequence[str] = ()) -> Project:
    from trcvtui.scenario.scenario import load_bench_project

    return load_bench_project(path, sets)


def find_file(text: str) -> str:
    """Return a file's name as given, or the path of the example with this name."""
    return str(resolve_path(text)) if text != "-" else text


def dialect_names() -> str:
    from trcvtui.dialects import DIALECTS

    return "dialects: " + ", ".join(f"{dialect.name} ({dialect.title})" for dialect in DIALECTS.values())


# -- stdout ---------------------------------------------------------------------------------------------


def print_text(text: str) -> int:
    sys.stdout.write(text + "\n")
    return GOOD


def print_lines(lines: Iterable[str]) -> int:
    return print_text("\n".join(lines))
