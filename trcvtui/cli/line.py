"""Commands of a line: the traffic of real devices."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from trcvtui.cli.options import (
    GOOD,
    WRONG_INPUT,
    Args,
    CommandParser,
    add_format,
    add_kernel,
    add_plc,
    add_project,
    add_set,
    dialect_names,
    find_file,
    load_bench_project,
    print_lines,
    run_sink,
)
from trcvtui.cli.screen import run_screen
from trcvtui.cli.streams import has_terminal
from trcvtui.errors import UserError, mistake
from trcvtui.paths import resolve_path

if TYPE_CHECKING:
    from trcvtui.diagnosis.doctor import RecordedFacts
    from trcvtui.diagnosis.receiver import Receiver
    from trcvtui.net.tap import Route


def _add_shadows(parser: CommandParser, plc: str = "guessed") -> None:
    parser.make_epilog = dialect_names
    add_project(parser, "project whose instances receive the traffic as shadows")
    add_plc(parser, plc)
    about = "dialect of the shadows; default: the project's, else the first dialect"
    parser.add_argument("--dialect", metavar="NAME", help=about)


# -- watch ----------------------------------------------------------------------------------------------


def set_up_watch(parser: CommandParser) -> None:
    parser.description = "Shows a capture, or packets from stdin, as the blocks of a PLC receive them."
    about = "files of one capture (pcapng or pcap, also .gz), or - for stdin"
    parser.add_argument("files", metavar="FILE", nargs="+", type=find_file, help=about)
    _add_shadows(parser)
    parser.make_epilog = _capture_programs
    add_format(parser, "jsonl", is_text_default=True)


def _watch(args: Args) -> int:
    shadows = args.project, args.plc, args.dialect
    if "-" in args.files:
        return _watch_stdin(args, shadows)
    if args.format is None and has_terminal():
        from trcvtui.engine.driver import ProcessDriver
        from trcvtui.line.on_screen import watch_main

        sys.stderr.write(f"reading {', '.join(args.files)}\n")  # a large one takes its time
        return run_screen(lambda: ProcessDriver(watch_main, args.files, shadows), is_replay=True)
    from trcvtui.line.watch_command import watch_captures

    watch_captures(args.files, *shadows, args.format)
    return GOOD


def _watch_stdin(args: Args, shadows: tuple[Path | None, str | None, str | None]) -> int:
    if args.files != ["-"]:
        raise mistake("trcvtui watch", "- (stdin) together with files", "- alone, or only files")
    if sys.stdin is None or has_terminal(0):
        found = "a closed input" if sys.stdin is None else "a terminal"
        raise mistake("stdin", found, "packets: dumpcap -q -i eth0 -w - | trcvtui watch -")
    if args.format is None and has_terminal(1, 2):
        from trcvtui.line.live_screen import make_stdin_driver

        sys.stderr.write("waiting for packets on stdin\n")
        return run_screen(lambda: make_stdin_driver(shadows))
    from trcvtui.line.watch_command import watch_stdin

    watch_stdin(*shadows, args.format)
    return GOOD


def _capture_programs() -> str:
    from textwrap import fill

    return f"""live, from a program that may capture (trcvtui needs no rights):
  Linux    dumpcap -q -i eth0 -w - | trcvtui watch -
           tcpdump -U --immediate-mode -i eth0 -w - | trcvtui watch -
  macOS    sudo tcpdump -U --immediate-mode -i en0 -w - | trcvtui watch -
  Windows  (cmd.exe) "%ProgramFiles%\\Wireshark\\dumpcap" -q -i 1 -w - | trcvtui watch -
  ssh      ssh HOST tcpdump -U --immediate-mode -i eth0 -w - | trcvtui watch -
if you may not capture on Linux: sudo usermod -aG wireshark $USER, or sudo dumpcap
{fill(dialect_names(), 78)}"""


# -- tap ------------------------------------------------------------------------------------------------


def set_up_tap(parser: CommandParser) -> None:
    parser.description = "Forwards between two ends; its screen shows, holds and changes what passes."
    places = "own end: [ADDR:]PORT, udp:[ADDR:]PORT or serial:DEVICE[,9600,8N1]"
    parser.add_argument("listen", metavar="LISTEN", nargs="?", help=places)
    about = "the other end, in the same form; in both, ADDR defaults to 127.0.0.1"
    parser.add_argument("connect", metavar="CONNECT", nargs="?", help=about)
    parser.add_argument(
        "--record", metavar="FILE", help="record what passes as pcapng, which Wireshark reads"
    )
    about = "print as JSON what the shadows show; default: the screen, else text"
    parser.add_argument("--format", choices=("jsonl",), help=about)
    _add_shadows(parser, "CONNECT")
    parser.add_argument(
        "--hold", action="store_true", help="hold both directions until the screen releases them"
    )
    parser.add_argument("--armed", action="store_true", help="keys r (RST) and f (FIN) skip the prompt")
    about = "let other programs intervene over the socket of --project"
    parser.add_argument("--allow-orders", action="store_true", help=about)


def _tap(args: Args) -> int:
    from trcvtui.line.tap_command import ObserverSettings, forward
    from trcvtui.net.tap import make_route

    if args.listen is None:
        routes = _routes_of_taps(args.project)
    elif args.connect is None:
        raise mistake("CONNECT", "nothing", "the end to which the bytes of LISTEN go")
    else:
        routes = [make_route("T", args.listen, args.connect, ("LISTEN", "CONNECT"))]
    shadows = args.project, args.plc, args.dialect, args.format
    settings = ObserverSettings(
        *shadows,
        args.format is not None or has_terminal(1),
        args.format is None and has_terminal(),
        args.hold,
        args.armed,
        args.allow_orders,
    )
    return forward(routes, settings, args.record)


def show_tap(tap: str, asked: str, kernel: str) -> int:
    """Show a tap in a child of the forwarding process. `tap` is the number of the socket to the parent."""
    import json

    from trcvtui.line.live_screen import TapDriver

    try:
        return run_screen(lambda: TapDriver(int(tap), json.loads(asked), kernel))
    except UserError as wrong:
        sys.stderr.write("".join(f"{line}\n" for line in wrong.lines()))
        return WRONG_INPUT


def _routes_of_taps(project: Path | None) -> list[Route]:
    """Return the taps of a project; raise UserError if the project has no tap."""
    taps = () if project is None else load_bench_project(project).taps
    if not taps:
        raise mistake("trcvtui tap", "no ends", "LISTEN and CONNECT, or a --project with [[tap]]")
    from trcvtui.net.tap import make_route

    return [make_route(t.name, t.listen, t.to, (f"[[tap]] {t.name}: listen", "to")) for t in taps]


# -- conversations, doctor, report ----------------------------------------------------------------------


def set_up_conversations(parser: CommandParser) -> None:
    parser.description = "Lists the conversations of a capture, and what each end sent."
    about = "files of one capture: pcapng or pcap, also .gz"
    parser.add_argument("files", metavar="FILE", nargs="+", type=find_file, help=about)
    add_project(parser, "project of the PLC: its ports show which end is the PLC")
    add_plc(parser)
    add_format(parser, "text", "json")


def _conversations(args: Args) -> int:
    from trcvtui.capture.command import format_conversations

    known = None
    if args.project is not None:
        from trcvtui.line.shadows import list_known_ends

        known = list_known_ends(load_bench_project(args.project))
    return print_lines(format_conversations(args.files, args.plc, args.format, known))


def set_up_doctor(parser: CommandParser) -> None:
    parser.description = "Finds what is wrong in captures, recordings and projects. Exit 1: findings."
    about = "captures, recordings, projects (.toml)"
    parser.add_argument("files", metavar="FILE", nargs="+", type=find_file, help=about)
    add_plc(parser)
    add_project(parser, "project of the PLC, to judge by what its instances expect")
    parser.add_argument("--udt", metavar="FILE", type=find_file, help="file with the type sent to the PLC")
    add_set(parser, "test a changed key of the project, such as instance.TRCV_C_1.LEN=20")
    add_format(parser, "text", "json", "jsonl")
    about = "run the projects for this time and judge the traffic"
    parser.add_argument("--for", dest="time", metavar="T#..", help=about)
    add_kernel(parser, of=" for --for")
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="captures read at the same time; default: 1"
    )
    about = "read captures on a Dask cluster that you trust"
    parser.add_argument("--scheduler", metavar="tcp://HOST:8786", help=about)
    about = "write a project that can receive this traffic"
    parser.add_argument("--suggest", metavar="NEW.toml", type=resolve_path, help=about)


def _doctor(args: Args) -> int:
    from trcvtui.diagnosis.doctor import DoctorQuestion, judge_project, run_doctor

    sets = tuple(args.set) if args.project is None else ()  # else they change the project
    question = DoctorQuestion(args.plc, _receivers(args), partial(_read_recorded_facts, sets))
    projects = [Path(file) for file in args.files if file.endswith(".toml")]
    lints = [judge_project(load_bench_project(path, args.set)) for path in projects]
    files = [file for file in args.files if not file.endswith(".toml")]
    if args.suggest is not None:
        from trcvtui.diagnosis.readings.suggest import write_suggested_project

        for line in write_suggested_project(files, args.plc, args.suggest):
            sys.stderr.write(f"{line}\n")
    if args.time is None:
        return run_doctor(files, question, args.format, args.jobs, lints, scheduler=args.scheduler)
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        runs = {run: str(path) for path in projects for run in _record_run(path, args, folder)}
        return run_doctor([*files, *runs], question, args.format, args.jobs, lints, runs)


def _receivers(args: Args) -> tuple[Receiver, ...]:
    from trcvtui.diagnosis.doctor import make_type_receiver

    receivers: tuple[Receiver, ...] = ()
    if args.project is not None:
        from trcvtui.diagnosis.lint import list_receivers
        from trcvtui.replay.what_if import find_changed_pins

        receivers = list_receivers(load_bench_project(args.project, args.set), find_changed_pins(args.set))
    if args.udt is None:
        return receivers
    from trcvtui.udt.command import read_file_layout

    layout, sender = read_file_layout(args.udt)
    return (*receivers, make_type_receiver(layout, sender.layout))


def _read_recorded_facts(sets: tuple[str, ...], path: str) -> RecordedFacts | None:
    from trcvtui.recording.recording import Recording

    try:
        Recording(path)
    except UserError:  # no recording: then it is a capture, which has no project
        if sets:
            raise mistake(
                "--set", f"{path}, a capture", "a recording, or --project with the capture"
            ) from None
        return None
    from trcvtui.replay.job_facts import collect_recorded_facts

    return collect_recorded_facts(path, sets)


def _record_run(path: Path, args: Args, folder: str) -> list[str]:
    from trcvtui.scenario.record import read_limits, record

    out = Path(folder) / str(len(list(Path(folder).iterdir())))
    limits = read_limits(None, None, None, None, None)
    record(path, out, args.kernel, limits, None, args.time, True, run_sink(), is_kept=False)
    return [str(file) for file in sorted(out.iterdir())]


def set_up_report(parser: CommandParser) -> None:
    parser.description = (
        "Writes a recording or capture as an HTML page: verdict, time line, causes, STATUS, frames."
    )
    parser.add_argument("file", metavar="FILE", type=resolve_path, help="a recording or a capture, also .gz")
    about = "a new file, or an older report to replace"
    parser.add_argument("--out", metavar="REPORT.html", required=True, type=Path, help=about)
    parser.add_argument(
        "--no-payload", action="store_true", help="show sizes and times, but no bytes that were sent"
    )
    _add_shadows(parser)


def _report(args: Args) -> int:
    from trcvtui.report.command import write_report

    shadows = args.project, args.plc, args.dialect
    return write_report(args.file, args.out, not args.no_payload, shadows)


# -- messages -------------------------------------------------------------------------------------------


def set_up_messages(parser: CommandParser) -> None:
    parser.description = "Prints each message of a recording, a capture or a run as a row with its members."
    about = "recordings, files of one capture, or a project (.toml) with --for"
    parser.add_argument("files", metavar="FILE", nargs="+", type=find_file, help=about)
    add_project(parser, "project whose instances receive a capture as shadows")
    add_plc(parser)
    about = "without --project: file with the type of the messages to the PLC"
    parser.add_argument("--udt", metavar="FILE", type=find_file, help=about)
    parser.add_argument("--type", metavar="NAME", help="the type, if the file of --udt has several")
    parser.add_argument(
        "--layout", metavar="NAME", help="layout of the type; default: as in `trcvtui udt decode`"
    )
    parser.add_argument("--byte-order", metavar="little|big", help="byte order; default: that of the layout")
    parser.add_argument("--instance", metavar="NAME", help="only messages of this instance")
    parser.add_argument("--members", metavar="A,B.C", default="", help="only these members; default: all")
    about = "only rows that match, such as weight > 3, STATUS=80C5 or RCVD_LEN!=12"
    parser.add_argument("--where", metavar="CONDITION", help=about)
    parser.add_argument("--for", dest="time", metavar="T#..", help="run the project for this time")
    add_kernel(parser, "sim", of=" for --for")
    add_format(parser, "text", "csv", "jsonl")
    parser.add_argument("--out", metavar="FILE", type=Path, help="write to this new file, not to stdout")


def _messages(args: Args) -> int:
    from trcvtui.report.messages import MessagesOptions, write_messages
    from trcvtui.udt.literals import parse_time

    layout, time_ns = None, None if args.time is None else parse_time(args.time, "--for")
    if time_ns is not None and time_ns <= 0:
        raise mistake("--for", args.time, "more than T#0s")
    if args.udt is not None:
        from trcvtui.udt.command import read_layout

        layout = read_layout(Args(file=args.udt, others=(), constant=(), text=None, pointer_size=None,
                                string_even=None, type=args.type, layout=args.layout,
                                byte_order=args.byte_order))  # fmt: skip
    else:
        for option in ("type", "layout", "byte_order"):
            if getattr(args, option) is not None:
                raise mistake(f"--{option.replace('_', '-')}", "no --udt", "--udt FILE with the type")
    fields = args.files, args.project, args.plc, layout, args.instance, args.members, args.where
    return write_messages(MessagesOptions(*fields, args.format, args.out, args.kernel, time_ns))


COMMANDS = {
    "watch": ("a capture as the PLC saw it", "line.pcapng --project bench.toml", set_up_watch, _watch),
    "tap": ("between two ends: see and change bytes", "2001 192.168.0.10:2000", set_up_tap, _tap),
    "conversations": ("which ends talked, and when", "line.pcapng", set_up_conversations, _conversations),
    "messages": (
        "each message a row, with its members",
        "line.pcapng --format csv",
        set_up_messages,
        _messages,
    ),
    "doctor": ("find what is wrong", "line.pcapng", set_up_doctor, _doctor),
    "report": ("a report as one HTML page", "line.pcapng --out line.html", set_up_report, _report),
}
