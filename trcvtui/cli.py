"""The only door: run, serve, scenario, status, st, udt. Arguments, exit codes; stdout is data.

Rule 1: a command imports what it needs inside its own function, so that headless commands start fast.
Rule 2: the screen library is imported by `run` alone, and only after the engine process has been started.
"""

from __future__ import annotations

import argparse
import errno
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, NoReturn

from trcvtui import __version__
from trcvtui.errors import UserError, mistake, one_line

if TYPE_CHECKING:
    from pathlib import Path

    from trcvtui.plc.project import Project

GOOD: Final = 0
DIFFERENT: Final = 1
WRONG_INPUT: Final = 2
INTERRUPTED: Final = 130  # 128 + SIGINT, as a shell reports it
PIPE_CLOSED: Final = 141  # 128 + SIGPIPE, as a shell reports it
KERNELS: Final = ("sim", "live")
BYTES: Final = "HEX|@FILE|-"
LOOKS: Final = ("dark", "light", "ansi")

Command = Callable[[argparse.Namespace], int]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line; return 0 good, 1 an expectation failed, 2 the user's mistake, 130, 141."""
    if sys.stdout is None:  # the shell's >&-
        if sys.stderr is not None:
            sys.stderr.write("stdout: found it closed, expected a terminal, a file or a pipe\n")
        return WRONG_INPUT
    try:
        code = _run_command(argv)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        _forget_stdout()
        return PIPE_CLOSED
    except OSError as failed:
        if failed.errno != errno.ENOSPC:
            raise
        _forget_stdout()
        sys.stderr.write(f"stdout: found '{failed.strerror}', expected room for the output\n")
        return WRONG_INPUT


def _run_command(argv: Sequence[str] | None) -> int:
    try:
        _never_fail_to_print()
        args = _parser().parse_args(argv)
        command: Command = args.command
        return command(args)
    except SystemExit as ended:  # argparse: 0 after --help, 2 after a mistake
        return ended.code if isinstance(ended.code, int) else GOOD
    except UserError as error:
        sys.stderr.write("".join(line + "\n" for line in error.lines()))
        return WRONG_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED


# -- stdout ---------------------------------------------------------------------------------------------


def _never_fail_to_print() -> None:
    """Let text that the terminal's encoding lacks be escaped, not refused."""
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")


def _print(text: str) -> int:
    sys.stdout.write(text + "\n")
    return GOOD


def _forget_stdout() -> None:
    """Point stdout at nothing, so that the interpreter's own last flush is quiet."""
    import os

    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# -- run --------------------------------------------------------------------------------------------------


def _demo(args: argparse.Namespace) -> int:
    from trcvtui.rig import demo_path

    return _open_screen(demo_path(), "live", theme=args.theme)


def _run(args: argparse.Namespace) -> int:
    return _open_screen(_path(args.project), args.kernel, args.netns, args.theme, args.read_only)


def _serve(args: argparse.Namespace) -> int:
    path = _path(args.project)
    _load_bench(path)
    from trcvtui.tui.served import serve

    serve(path, args.kernel, args.port, args.write, args.theme)
    return GOOD


def _open_screen(
    path: Path, kernel: str, netns: bool = False, theme: str | None = None, read_only: bool = False
) -> int:
    import os

    if netns:
        from trcvtui.rig.wire import enter_own_network

        enter_own_network(kernel)  # found out here, where there is no screen yet
    if not (os.isatty(0) and os.isatty(1)) and "WebDriver" not in os.environ.get("TEXTUAL_DRIVER", ""):
        _load_bench(path)
        raise mistake("trcvtui run", "no terminal", "a terminal; `trcvtui scenario` needs none")
    from trcvtui.rig.driver import start_engine

    driver = start_engine(path, kernel, netns)  # at once: it loads the project while this process does
    try:
        project = _load_bench(path)
        from trcvtui.tui.app import run_app

        return run_app(driver, project, theme, read_only)
    finally:
        driver.close()


def _load_bench(path: Path) -> Project:
    from trcvtui.rig.scenario import load_bench

    return load_bench(path)


# -- scenario, status ---------------------------------------------------------------------------------------


def _scenario(args: argparse.Namespace) -> int:
    from trcvtui.rig.report import FORMATS
    from trcvtui.rig.scenario_command import run_files

    if args.format not in FORMATS:
        raise mistake("--format", f"'{args.format}'", "one of " + ", ".join(FORMATS))
    out = None if args.out is None else _path(args.out)
    files = [_path(file) for file in args.files]
    return run_files(files, args.kernel, args.format, out, args.set, args.netns)


def _format_names() -> str:
    from trcvtui.rig.report import FORMATS

    return "formats: " + ", ".join(FORMATS)


def _status(args: argparse.Namespace) -> int:
    from trcvtui.dialects import DIALECTS
    from trcvtui.dialects.status_report import (
        as_json,
        as_table,
        as_text,
        chosen_dialects,
        explain,
        parse_code,
        with_scenarios,
    )

    code = None if args.code is None else parse_code(args.code)
    dialects = chosen_dialects(tuple(DIALECTS.values()), args.dialect)
    found = explain(dialects, code, args.block)
    if code is None and args.format == "text":
        return _print(as_table(found))
    from trcvtui.rig.scenario_shelf import scenarios_of

    shown = with_scenarios(found, {dialect.name: scenarios_of(dialect.name) for dialect in dialects})
    return _print(as_json(shown) if args.format == "json" else as_text(shown))


def _dialect_names() -> str:
    from trcvtui.dialects import DIALECTS

    return "dialects: " + ", ".join(f"{dialect.name} ({dialect.title})" for dialect in DIALECTS.values())


# -- st -----------------------------------------------------------------------------------------------------


def _st(args: argparse.Namespace) -> int:
    from trcvtui.rig.st_call import st_text

    project = _load_bench(_path(args.project))
    names = [args.instance] if args.instance else [decl.name for decl in project.instances]
    return _print(st_text(project, names))


# -- udt ----------------------------------------------------------------------------------------------------


def _udt_show(args: argparse.Namespace) -> int:
    from trcvtui.udt import command

    return _print(command.show(args))


def _udt_decode(args: argparse.Namespace) -> int:
    from trcvtui.udt import command

    return _print(command.decode(args))


def _udt_encode(args: argparse.Namespace) -> int:
    from trcvtui.udt import command

    return _print(command.encode(args))


def _udt_export(args: argparse.Namespace) -> int:
    from trcvtui.udt import command

    text = command.export(args)
    return _print(text) if text else GOOD


def _udt_compare(args: argparse.Namespace) -> int:
    from trcvtui.udt import command

    text, is_equal = command.compare(args)
    _print(text)
    return GOOD if is_equal else DIFFERENT


def _layout_names() -> str:
    from trcvtui.udt.layout import LAYOUT_ALIASES, LAYOUTS

    return "layouts: " + ", ".join([*LAYOUTS, *LAYOUT_ALIASES])


def _path(text: str) -> Path:
    from pathlib import Path

    return Path(text)


# -- the arguments -----------------------------------------------------------------------------------------


class _Help(argparse.HelpFormatter):
    """Help for 80 columns; asking the terminal for its width would cost an import at every start."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=78)


class _Parser(argparse.ArgumentParser):
    """One line for a mistake; the last lines of the help are made when somebody asks for them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **settings)
        self.last_words: Callable[[], str] | None = None

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and leave with 2."""
        self.exit(WRONG_INPUT, one_line(f"{self.prog}: {message}") + "\n")

    def format_help(self) -> str:
        """Return the help, with the names that only an import can tell."""
        if self.last_words is not None:
            self.epilog = self.last_words()
        return super().format_help()


def _parser() -> _Parser:
    parser = _Parser(
        prog="trcvtui",
        description="A soft PLC on a test bench: TRCV_C on real sockets, scan by scan. "
        "Without a command: the built-in demo.",
    )
    parser.set_defaults(command=_demo)
    parser.add_argument("--version", action="version", version=f"trcvtui {__version__}")
    _add_theme(parser, None)
    commands = parser.add_subparsers(metavar="COMMAND")
    _add_run(commands.add_parser("run", help="open the screen on a project"))
    _add_serve(commands.add_parser("serve", help="the screen in a browser on this machine"))
    _add_scenario(commands.add_parser("scenario", help="run without a screen"))
    _add_status(commands.add_parser("status", help="explain a STATUS code"))
    _add_st(commands.add_parser("st", help="print instances as their calls in Structured Text"))
    _add_udt(commands.add_parser("udt", help="show, decode, encode, export, compare a UDT"))
    return parser


def _add_run(parser: _Parser) -> None:
    parser.set_defaults(command=_run)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--netns", action="store_true", help="live, in a network of its own (Linux)")
    parser.add_argument("--read-only", action="store_true", help="look, command nothing")
    _add_theme(parser, argparse.SUPPRESS)


def _add_serve(parser: _Parser) -> None:
    parser.set_defaults(command=_serve)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--port", type=int, default=0, help="on 127.0.0.1; default 0: any that is free")
    parser.add_argument("--write", action="store_true", help="let the browser command the bench")
    _add_theme(parser, argparse.SUPPRESS)


def _add_theme(parser: _Parser, default: str | None) -> None:
    parser.add_argument("--theme", choices=LOOKS, default=default, help="default: dark; ansi: 16 colours")


def _add_scenario(parser: _Parser) -> None:
    parser.set_defaults(command=_scenario)
    parser.last_words = _format_names
    parser.add_argument("files", metavar="FILE.toml", nargs="+")
    parser.add_argument("--kernel", choices=KERNELS, default="sim", help="default: sim")
    parser.add_argument("--format", metavar="NAME", default="text", help="default: text")
    parser.add_argument("--netns", action="store_true", help="live, in a network of its own (Linux)")
    parser.add_argument("--out", metavar="FILE", help="write here instead of stdout")
    parser.add_argument(
        "--set", metavar="PATH=VALUE", action="append", default=[], help="such as options.retry=T#100ms"
    )


def _add_status(parser: _Parser) -> None:
    parser.set_defaults(command=_status)
    parser.last_words = _dialect_names
    parser.add_argument("code", metavar="CODE", nargs="?", help="80C5, 16#80C5, W#16#80C5 or 0x80c5")
    parser.add_argument("--dialect", metavar="NAME", help="default: all")
    parser.add_argument("--block", metavar="BLOCK", help="such as TRCV_C; default: all")
    parser.add_argument("--format", choices=("text", "json"), default="text", help="default: text")


def _add_st(parser: _Parser) -> None:
    parser.set_defaults(command=_st)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("instance", metavar="INSTANCE", nargs="?", help="default: all of them")


def _add_udt(parser: _Parser) -> None:
    parser.set_defaults(command=None)
    commands = parser.add_subparsers(metavar="WHAT", required=True)
    show = commands.add_parser("show", help="members with offset, size, type; padding")
    _add_type(show, _udt_show, ("text", "json"))
    decode = commands.add_parser("decode", help="bytes to values, as far as they go")
    _add_type(decode, _udt_decode, ("text", "json", "md", "csv"))
    decode.add_argument("hex", metavar=BYTES, nargs="+", help="hex, a file of hex, or stdin")
    encode = commands.add_parser("encode", help="values to bytes, as hex on stdout")
    _add_type(encode, _udt_encode, ("hex", "iec", "st", "c", "python", "base64"))
    encode.add_argument("values", metavar="VALUES.json|-", help="an object of path: value")
    export = commands.add_parser("export", help="the type for Wireshark, Kaitai or ImHex")
    _add_type(export, _udt_export)
    export.add_argument("--to", metavar="lua|ksy|imhex", required=True)
    export.add_argument("--port", type=int, help="lua: the TCP port; default: by Decode As")
    export.add_argument("--out", metavar="FILE", help="write here instead of stdout")
    compare = commands.add_parser("compare", help="two layouts side by side; exit 1 where they differ")
    _add_type(compare, _udt_compare, ("text", "json"), twice=True)
    more = compare.add_argument("hex", metavar=BYTES, nargs="+", default=[], help="compare values, too")
    more.required = False  # with "*" argparse takes none, as soon as an option stands before them


def _add_type(parser: _Parser, command: Command, formats: Sequence[str] = (), twice: bool = False) -> None:
    parser.set_defaults(command=command)
    parser.last_words = _layout_names
    parser.add_argument("file", metavar="FILE", help="the file that declares the type")
    one: dict[str, Any] = {"action": "append", "default": []} if twice else {}
    layout = {"default": "baosky", "help": "default: baosky", **one}
    if twice:
        layout["help"] = "and another --layout; --type, --byte-order, --text may be given twice, too"
    parser.add_argument("--type", metavar="NAME", help="may be left out when the file holds one type", **one)
    parser.add_argument("--layout", metavar="NAME", **layout)
    parser.add_argument("--byte-order", metavar="little|big", help="default: that of the layout", **one)
    parser.add_argument("--text", metavar="FORM", help="of STRING: s7, cstr or nul; default as above", **one)
    parser.add_argument(
        "--constant", metavar="NAME=VALUE", action="append", default=[], help="such as GVL.MAX=10"
    )
    parser.add_argument(
        "--with",
        metavar="FILE",
        dest="others",
        action="append",
        default=[],
        help="types and constants FILE uses; repeatable",
    )
    if formats:
        parser.add_argument("--format", choices=formats, default=formats[0], help=f"default: {formats[0]}")
