"""Commands of a bench: a PLC with its partners, on this machine."""

from __future__ import annotations

import gc
import sys
from argparse import SUPPRESS
from pathlib import Path

from trcvtui.cli.options import (
    GOOD,
    Args,
    CommandParser,
    add_commands,
    add_kernel,
    add_netns,
    add_no_secrets,
    add_project,
    add_record,
    add_set,
    add_theme,
    dialect_names,
    find_file,
    load_bench_project,
    print_lines,
    record_target,
    run_sink,
)
from trcvtui.cli.screen import open_screen, run_screen
from trcvtui.cli.streams import has_terminal
from trcvtui.errors import mistake
from trcvtui.paths import resolve_path

SCENARIO_FORMATS = ("text", "jsonl", "junit")


def set_up_run(parser: CommandParser) -> None:
    parser.description = "Opens a project on the screen; if the file does not exist, offers to create it."
    add_project(parser)
    add_kernel(parser)
    add_netns(parser)
    parser.add_argument("--read-only", action="store_true", help="only a view: it sends no commands")
    parser.add_argument("--attach", type=Path, help=SUPPRESS)  # a tab of `serve` reaches its engine by this
    add_record(parser, "FILE")
    add_theme(parser)


def _run(args: Args) -> int:
    if args.attach is not None:
        from trcvtui.engine.driver import AttachedDriver

        return run_screen(lambda: AttachedDriver(args.attach), args.theme, args.read_only, is_run=True)
    return open_screen(args.project, args.kernel, args.netns, args.theme, args.read_only, record_target(args))


def set_up_serve(parser: CommandParser) -> None:
    parser.description = "Shows the bench of a project in a browser on this machine, in up to 8 tabs."
    add_project(parser)
    add_kernel(parser)
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1; default: any free port")
    parser.add_argument("--write", action="store_true", help="let browser tabs send commands")
    parser.add_argument("--as-root", action="store_true", help="allow --write as root")
    add_theme(parser)


def _serve(args: Args) -> int:
    from trcvtui.tui.served import refuse_root, serve

    if sys.platform == "win32":
        raise mistake("trcvtui serve", "Windows", "Linux or macOS: its tabs need a Unix socket")
    refuse_root(args.write, args.as_root)
    load_bench_project(args.project)
    serve(args.project, args.kernel, args.port, args.write, args.theme)
    return GOOD


def set_up_examples(parser: CommandParser) -> None:
    parser.description = "Lists the projects and stories that come with the program."
    parser.add_argument("word", metavar="WORD", nargs="?", help="only lines with WORD; scenarios, too")


def _examples(args: Args) -> int:
    from trcvtui.paths import list_examples

    lines = list(list_examples(args.word))
    if not lines:
        raise mistake("trcvtui examples", f"no project, story or scenario with '{args.word}'", "another word")
    return print_lines(lines)


def set_up_scenario(parser: CommandParser) -> None:
    parser.description = "Runs scenarios without a screen; exit 1: an expectation failed."
    parser.make_epilog = lambda: f"formats: {', '.join(SCENARIO_FORMATS)}; {dialect_names()}"
    parser.add_argument("files", metavar="FILE.toml", nargs="+", type=resolve_path, help="scenario files")
    add_kernel(parser, "sim")
    parser.add_argument("--format", metavar="NAME", default="text", help="output format; default: text")
    add_netns(parser)
    parser.add_argument("--out", metavar="FILE", type=Path, help="write to this file, not to stdout")
    add_set(parser, "change a key of the project, such as options.retry=T#100ms")
    about = "run in this dialect; give two or more, to compare them"
    parser.add_argument("--dialect", metavar="NAME", action="append", default=[], help=about)
    add_record(parser, "FILE|DIR")


def _scenario(args: Args) -> int:
    if args.format not in SCENARIO_FORMATS:
        raise mistake("--format", f"'{args.format}'", "one of " + ", ".join(SCENARIO_FORMATS))
    gc.disable()  # imported modules stay: to collect them would only cost time
    from trcvtui.scenario.command import run_files

    gc.enable()
    out, record = args.out, record_target(args)
    return run_files(args.files, args.kernel, args.format, out, args.set, args.netns, record, args.dialect)


def set_up_record(parser: CommandParser) -> None:
    parser.description = "Runs a project without a screen; records the run, its newest part, or triggers."
    add_project(parser)
    parser.add_argument("--out", metavar="DIR", required=True, type=Path, help="folder of the numbered files")
    add_kernel(parser)
    parser.add_argument(
        "--ring", metavar="SIZE", help="total size of the files, such as 256MiB; the oldest is deleted first"
    )
    parser.add_argument("--split", metavar="SIZE", help="size of one file; default: an eighth of --ring")
    about = 'keep only the time around a trigger, such as "TRCV_C_1 STATUS=80C5"'
    parser.add_argument("--on", metavar="CONDITION", help=about)
    parser.add_argument("--before", metavar="T#..", help="time kept before a trigger; default: T#30s")
    parser.add_argument("--after", metavar="T#..", help="time kept after a trigger; default: T#10s")
    parser.add_argument("--duration", metavar="T#..", help="run this long; default: until Ctrl+C or SIGTERM")
    add_no_secrets(parser)


def _record(args: Args) -> int:
    from trcvtui.scenario.record import read_limits, record

    limits = read_limits(args.ring, args.split, args.on, args.before, args.after)
    secrets = not args.no_secrets
    return record(args.project, args.out, args.kernel, limits, args.on, args.duration, secrets, run_sink())


def set_up_replay(parser: CommandParser) -> None:
    parser.description = "Shows a recording with a time line, or runs it again, unchanged or with changes."
    parser.add_argument("file", metavar="FILE", type=resolve_path, help="a recording, also .gz")
    parser.add_argument("--check", action="store_true", help="run it again and compare; exit 1: it differs")
    parser.add_argument("--format", choices=("jsonl",), help="print the run as JSON, one object a line")
    add_set(parser, "what if: run it again with this key changed")
    parser.add_argument("--dialect", metavar="NAME", help="what if: run it again in this dialect")
    about = "scan or time to show first; default: the first ERROR, else finding, else DONE"
    parser.add_argument("--at", metavar="SCAN|T#..", help=about)


def _replay(args: Args) -> int:
    is_what_if = args.set or args.dialect is not None
    if args.at is not None and (args.check or args.format or is_what_if):
        found = "--at with --check, --format, --set or --dialect"
        raise mistake("trcvtui replay", found, "--at only for the screen")
    if is_what_if:
        from trcvtui.replay.command import run_what_if

        return run_what_if(args.file, args.check, args.format, args.set, args.dialect)
    if not args.check and args.format is None and has_terminal():
        from trcvtui.replay.driver import make_replay_driver

        return run_screen(lambda: make_replay_driver(args.file, args.at), is_replay=True)
    from trcvtui.replay.command import replay_file

    return replay_file(args.file, args.check, args.format)


def set_up_recording(parser: CommandParser) -> None:
    parser.description = "Makes a copy of a recording to hand on, or prints a Wireshark dissector."
    rows = {
        "strip": ("write a copy without payload, names or TLS keys", _add_strip, _strip),
        "dissector": ("print the Lua dissector for Wireshark", lambda parser: None, _dissector),
    }
    add_commands(parser, rows, required=True)


def _add_strip(parser: CommandParser) -> None:
    parser.add_argument("source", metavar="IN", type=find_file, help="a recording")
    parser.add_argument("target", metavar="OUT", type=find_file, help="a new file")
    parser.add_argument("--no-payload", action="store_true", help="write payload as zeros and no TLS keys")
    parser.add_argument("--no-secrets", action="store_true", help="no TLS keys, so TLS data stays encrypted")
    about = "change addresses, leave out names and TLS keys; payload stays"
    parser.add_argument("--anonymise", action="store_true", help=about)


def _strip(args: Args) -> int:
    from trcvtui.recording.strip import StripOptions, strip_recording

    out = StripOptions(args.no_payload, args.no_secrets, args.anonymise)
    for line in strip_recording(args.source, args.target, out):
        sys.stderr.write(f"{line}\n")
    return GOOD


def _dissector(args: Args) -> int:
    from trcvtui.recording.strip import read_dissector

    sys.stdout.write(read_dissector())
    return GOOD


COMMANDS = {
    "run": ("a project on the screen, or a new one", "new.toml", set_up_run, _run),
    "examples": ("projects and stories to try", "", set_up_examples, _examples),
    "serve": ("the screen in a browser", "bench.toml --port 8000", set_up_serve, _serve),
    "scenario": ("a test without a screen", "test.toml --format junit", set_up_scenario, _scenario),
    "record": ("record what a bench does", "bench.toml --out runs", set_up_record, _record),
    "replay": ("a recording, step by step", "run.pcapng", set_up_replay, _replay),
    "recording": ("a copy to hand on", "strip run.pcapng out.pcapng", set_up_recording, None),
}
