"""The entry point: runs the command that the arguments name. Data go to stdout, messages to stderr.

Rule: a command imports what it needs inside its own function, so that headless commands start fast.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Final

from trcvtui import __version__
from trcvtui.cli import bench, fleet, line, look_up
from trcvtui.cli.options import GOOD, WRONG_INPUT, Add, Args, CommandParser, Run, add_commands, add_theme
from trcvtui.cli.screen import open_screen
from trcvtui.cli.streams import prepare_streams
from trcvtui.errors import UserError
from trcvtui.paths import demo_path

INTERRUPTED: Final = 130  # 128 + SIGINT, as a shell reports it
PIPE_CLOSED: Final = 141  # 128 + SIGPIPE, as a shell reports it
COMMAND_GROUPS: Final[Mapping[str, Mapping[str, tuple[str, str, Add, Run]]]] = {
    "Bench: a PLC with its partners, on this machine": bench.COMMANDS,
    "Line: the traffic of real devices": line.COMMANDS,
    "Look up": look_up.COMMANDS,
    "Many lines": fleet.COMMANDS,
}
COMMANDS: Final = {name: row for group in COMMAND_GROUPS.values() for name, row in group.items()}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line. Return 0 if good, 1 if an expectation failed, 2 for wrong input, 130 or 141."""
    prepare_streams()
    if sys.stdout is None:  # the shell's >&-
        sys.stderr.write("stdout: found it closed, expected a terminal, a file or a pipe\n")
        return WRONG_INPUT
    try:
        code = _run_command(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
        return code
    except OSError as failed:
        return _exit_code_of(failed)


def _exit_code_of(failed: OSError) -> int:
    """Return the exit code of a closed pipe, a full disk or too few descriptors; raise other errors."""
    is_closed = isinstance(failed, BrokenPipeError)
    if failed.errno in (errno.EMFILE, errno.ENFILE):
        sys.stderr.write(f"trcvtui: found '{failed.strerror}', expected more descriptors: `ulimit -n`\n")
        return WRONG_INPUT
    if not is_closed and failed.errno != errno.ENOSPC:
        raise failed
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else the last flush fails, too
    if is_closed:
        return PIPE_CLOSED
    sys.stderr.write(f"stdout: found '{failed.strerror}', expected room for the output\n")
    return WRONG_INPUT


def _run_command(given: Sequence[str]) -> int:
    try:
        if (reconfigure := getattr(sys.stdout, "reconfigure", None)) is not None:
            reconfigure(errors="backslashreplace")  # a narrow encoding gets escapes, no error
        args = parser_of(given).parse_args(given, Args(whole=lambda: parser_of(())))
        code: int = args.command(args)
        return code
    except SystemExit as ended:  # argparse: 0 after --help, 2 after a mistake
        return ended.code if isinstance(ended.code, int) else GOOD
    except UserError as error:
        sys.stderr.write("".join(f"{line}\n" for line in error.lines()))
        return WRONG_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED


def parser_of(given: Sequence[str]) -> CommandParser:
    parser = CommandParser(prog="trcvtui", usage="trcvtui [-h] [--version] [--theme NAME] [COMMAND ...]")
    parser.description = _overview()
    parser.add_argument("--version", action="version", version=f"trcvtui {__version__}")
    parser.given = given
    parser.set_defaults(command=lambda args: open_screen(demo_path(), "live", theme=args.theme))
    add_theme(parser, None)
    rows = {name: (about, add, run) for name, (about, _, add, run) in COMMANDS.items()}
    add_commands(parser, rows, "COMMAND", help=argparse.SUPPRESS, prog="trcvtui")
    return parser


def _overview() -> str:
    lines = ["A soft PLC on a test bench: TRCV_C on real sockets, scan by scan."]
    lines += ["Without a command: the built-in demo."]
    for title, group in COMMAND_GROUPS.items():
        lines += ["", title]
        lines += [f"  {f'{name} {example}':38}  {about}" for name, (about, example, *_) in group.items()]
    lines += ["", "Each line is an example: type `trcvtui` before it."]
    lines += ["`trcvtui COMMAND --help` lists its options."]
    return "\n".join(lines)
