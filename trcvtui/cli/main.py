"""The only door: one function a command. Arguments, exit codes; stdout is data, messages go to stderr.

Rule 1: a command imports what it needs inside its own function, so that headless commands start fast.
Rule 2: the screen library is imported by `run` alone, and only after the engine process has been started.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable, Iterable, Sequence
from types import SimpleNamespace
from typing import IO, TYPE_CHECKING, Final

from trcvtui import __version__
from trcvtui.cli.arguments import SUPPRESS, ArgumentRows, PlainParser
from trcvtui.errors import UserError, mistake

if TYPE_CHECKING:
    from pathlib import Path

    from trcvtui.diagnosis.doctor import RecordedFacts
    from trcvtui.diagnosis.receiver import Receiver
    from trcvtui.engine.driver import EngineDriver
    from trcvtui.net.tap import Route
    from trcvtui.project.project import Project
    from trcvtui.recording.files import FileSink, RecordTo, Sink

GOOD: Final = 0
FAILED: Final = 1
WRONG_INPUT: Final = 2
INTERRUPTED: Final = 130  # 128 + SIGINT, as a shell reports it
PIPE_CLOSED: Final = 141  # 128 + SIGPIPE, as a shell reports it
KERNELS: Final = ("sim", "live")
LOOKS: Final = (  # ours, then Textual's: to ask it for their names takes a tenth of a second
    "dark", "light", "ansi", "textual-dark", "textual-light", "nord", "gruvbox", "dracula", "monokai",
    "flexoki", "tokyo-night", "catppuccin-mocha", "catppuccin-latte", "catppuccin-frappe",
    "catppuccin-macchiato",
    "solarized-light", "solarized-dark", "rose-pine", "rose-pine-moon", "rose-pine-dawn", "atom-one-dark",
    "atom-one-light", "ansi-dark", "ansi-light",
)  # fmt: skip

Command = Callable[[SimpleNamespace], int]


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
    except OSError as failed:
        return _output_failed(failed)


def _output_failed(failed: OSError) -> int:
    """Return the exit code of an output that nobody reads or that has no room; raise what is neither."""
    if isinstance(failed, BrokenPipeError):
        _forget_stdout()
        return PIPE_CLOSED
    if failed.errno != errno.ENOSPC:
        raise failed
    _forget_stdout()
    sys.stderr.write(f"stdout: found '{failed.strerror}', expected room for the output\n")
    return WRONG_INPUT


def _run_command(argv: Sequence[str] | None) -> int:
    try:
        _never_fail_to_print()
        given = sys.argv[1:] if argv is None else argv
        args = _arguments(given)
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
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")


def _print(text: str) -> int:
    sys.stdout.write(text + "\n")
    return GOOD


def _print_lines(lines: Iterable[str]) -> int:
    from trcvtui.udt.layout.values import pages

    for page in pages(lines):
        _print("\n".join(page))
    return GOOD


def _forget_stdout() -> None:
    """Point stdout at nothing, so that the interpreter's own last flush is quiet."""
    import os

    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# -- run --------------------------------------------------------------------------------------------------


def _demo(args: SimpleNamespace) -> int:
    from trcvtui.paths import demo_path

    return _open_screen(demo_path(), "live", theme=args.theme)


def _run(args: SimpleNamespace) -> int:
    return _open_screen(
        _path(args.project), args.kernel, args.netns, args.theme, args.read_only, _record_to(args)
    )


def _serve(args: SimpleNamespace) -> int:
    path = _path(args.project)
    from trcvtui.tui.served import refuse_root, serve

    refuse_root(args.write, args.as_root)
    _load_bench(path)
    serve(path, args.kernel, args.port, args.write, args.theme)
    return GOOD


def _open_screen(
    path: Path,
    kernel: str,
    netns: bool = False,
    theme: str | None = None,
    read_only: bool = False,
    record: RecordTo | None = None,
) -> int:
    import os

    if netns:
        from trcvtui.bench.bench import enter_own_network

        enter_own_network(kernel)  # found out here, where there is no screen yet
    if not (os.isatty(0) and os.isatty(1)) and "WebDriver" not in os.environ.get("TEXTUAL_DRIVER", ""):
        _load_bench(path)
        raise mistake("trcvtui run", "no terminal", "a terminal; `trcvtui scenario` needs none")
    if not read_only and not _is_there(path):
        return WRONG_INPUT
    from trcvtui.engine.driver import start_engine

    return _show(lambda: start_engine(path, kernel, netns, read_only, record), theme, read_only)


def _show(
    start: Callable[[], EngineDriver], theme: str | None, read_only: bool = False, is_replay: bool = False
) -> int:
    import gc
    import os

    from trcvtui.engine.driver import EngineStopped

    gc.disable()  # until the first frame stands: what is imported on the way to it stays
    driver = start()  # at once: it reads the project while the screen is imported
    try:
        # Textual paints at the next tick of this clock, 60 by default: a key would wait 8 ms for it.
        os.environ.setdefault("TEXTUAL_FPS", "200")
        from trcvtui.tui.app import run_app

        return run_app(driver, driver.project(), theme, read_only, is_replay)
    except EngineStopped as stopped:  # before there was a screen that could show it
        sys.stderr.write(f"{str(stopped).rstrip()}\n")
        return FAILED
    finally:
        driver.close()


def _is_there(path: Path) -> bool:
    import os

    if "TEXTUAL_DRIVER" in os.environ:
        return True  # in a browser nobody can be asked
    try:
        if path.stat().st_size:
            return True
    except OSError:
        pass
    from trcvtui.engine.project_edits import is_wanting, offer_in_the_terminal

    return offer_in_the_terminal(path) if is_wanting(path) else True


def _load_bench(path: Path, sets: Sequence[str] = ()) -> Project:
    from trcvtui.scenario.scenario import load_bench

    return load_bench(path, sets)


# -- scenario, status ---------------------------------------------------------------------------------------


def _scenario(args: SimpleNamespace) -> int:
    import gc

    gc.disable()  # what is imported stays
    from trcvtui.scenario.command import run_files
    from trcvtui.scenario.report import FORMATS

    gc.enable()
    if args.format not in FORMATS:
        raise mistake("--format", f"'{args.format}'", "one of " + ", ".join(FORMATS))
    from pathlib import Path

    out = None if args.out is None else Path(args.out)
    files = [_path(file) for file in args.files]
    return run_files(files, args.kernel, args.format, out, args.set, args.netns, _record_to(args))


def _record_to(args: SimpleNamespace) -> RecordTo | None:
    """Return what `--record` asks for; None: nothing."""
    if args.record is None:
        return None
    from pathlib import Path

    from trcvtui.recording.files import RecordTo

    return RecordTo(Path(args.record), args.overwrite, not args.no_secrets, follow=_follow())


def _follow() -> Callable[[FileSink, str], Sink]:
    from trcvtui.replay.follower import Followed

    return Followed


def _record(args: SimpleNamespace) -> int:
    from pathlib import Path

    from trcvtui.scenario.record import limits_of, record

    limits = limits_of(args.ring, args.split, args.on, args.before, args.after)
    project, out = _path(args.project), Path(args.out)
    return record(project, out, args.kernel, limits, args.on, args.duration, not args.no_secrets, _follow())


def _agent(args: SimpleNamespace) -> int:
    import shlex
    from pathlib import Path

    from trcvtui.fleet.agent import AgentSettings, default_name, run_agent
    from trcvtui.fleet.broker import broker_of, need_paho
    from trcvtui.fleet.metrics import place_of_page
    from trcvtui.recording.files import RecordTo
    from trcvtui.scenario.record import limits_of

    path = _path(args.project)
    if args.mqtt is None and args.metrics is None:
        raise mistake("trcvtui agent", "neither", "--mqtt mqtts://HOST or --metrics ADDR:PORT, or both")
    page = None if args.metrics is None else place_of_page(args.metrics)
    broker = None
    if args.mqtt is not None:
        broker = broker_of(args.mqtt, args.mqtt_ca, args.mqtt_cert, args.mqtt_key)
        need_paho()
    record = None
    if args.record is not None:
        from trcvtui.files import make_folder

        for folder in (Path(args.record), Path(args.record) / path.stem):
            make_folder(folder, "--record")
        limits = limits_of(args.ring, None, None, None, None)
        record = RecordTo(Path(args.record) / path.stem, False, not args.no_secrets, limits, _follow())
    name = args.name or default_name(path)
    try:
        packets = tuple(shlex.split(args.packets or ""))
    except ValueError as wrong:
        raise mistake("--packets", str(wrong), "a program and its arguments") from None
    settings = AgentSettings(
        path, args.kernel, args.site, name, broker, page, record, args.with_payload, args.allow_fetch, packets
    )
    return run_agent(settings, _load_bench(path))


def _fleet(args: SimpleNamespace) -> int:
    import gc
    import os

    from trcvtui.clock import wall_ns
    from trcvtui.fleet.broker import OPEN_TO_ALL, broker_of, need_paho

    broker = broker_of(args.url, args.mqtt_ca, args.mqtt_cert, args.mqtt_key, where="trcvtui fleet")
    need_paho()
    if not (os.isatty(0) and os.isatty(1)):
        raise mistake("trcvtui fleet", "no terminal", "a terminal; scripts read the broker: docs/fleet.md")
    if not broker.has_tls:
        sys.stderr.write(f"{OPEN_TO_ALL}\n")
    gc.disable()  # until the list stands: what is imported on the way to it stays
    os.environ.setdefault("TEXTUAL_FPS", "200")
    from trcvtui.tui.fleet.app import run_fleet

    return run_fleet(broker, args.site, f"fleet-{wall_ns():x}-{os.getpid()}", args.theme)


def _replay(args: SimpleNamespace) -> int:
    if args.at is not None and (args.check or args.format or args.set or args.dialect is not None):
        raise mistake(
            "trcvtui replay", "--at with --check, --format, --set or --dialect", "--at for the screen alone"
        )
    if args.set or args.dialect is not None:
        from trcvtui.replay.command import what_if_file

        return what_if_file(_path(args.file), args.check, args.format, args.set, args.dialect)
    import os

    if not args.check and args.format is None and os.isatty(0) and os.isatty(1):
        return _show(lambda: _replay_driver(args), None, is_replay=True)
    from trcvtui.replay.command import replay_file

    return replay_file(_path(args.file), args.check, args.format)


def _replay_driver(args: SimpleNamespace) -> EngineDriver:
    from trcvtui.replay.driver import ReplayDriver

    return ReplayDriver(_path(args.file), args.at)


def _recording_strip(args: SimpleNamespace) -> int:
    from trcvtui.recording.strip import LeaveOut, strip

    out = LeaveOut(args.no_payload, args.no_secrets, args.anonymise)
    for line in strip(_given(args.source), _given(args.target), out):
        sys.stderr.write(f"{line}\n")
    return 0


def _recording_dissector(args: SimpleNamespace) -> int:
    from trcvtui.recording.strip import dissector

    sys.stdout.write(dissector())
    return 0


def _report(args: SimpleNamespace) -> int:
    from pathlib import Path

    from trcvtui.report.command import report_file

    project = None if args.project is None else _path(args.project)
    shadows = project, args.plc, args.dialect
    return report_file(_path(args.file), Path(args.out), not args.no_payload, shadows)


def _race(args: SimpleNamespace) -> int:
    from trcvtui.scenario.race import run_race

    return _print(run_race(_path(args.file), args.dialect, args.format))


def _conversations(args: SimpleNamespace) -> int:
    from trcvtui.capture.command import conversations_of

    known = None
    if args.project is not None:
        from trcvtui.line.shadows import known_ends
        from trcvtui.scenario.scenario import load_bench

        known = known_ends(load_bench(_path(args.project)))
    return _print_lines(conversations_of([_given(file) for file in args.files], args.plc, args.format, known))


def _doctor(args: SimpleNamespace) -> int:
    from functools import partial

    from trcvtui.diagnosis.doctor import DoctorQuestion, doctor, receiver_of_type, verdict_on_project

    receivers: tuple[Receiver, ...] = ()
    if args.project is not None:
        from trcvtui.diagnosis.lint import receivers_of
        from trcvtui.replay.what_if import pins_of

        receivers = receivers_of(_load_bench(_path(args.project), args.set), pins_of(args.set))
    if args.udt is not None:
        from trcvtui.udt.command import only_layout

        receivers = (*receivers, receiver_of_type(only_layout(_given(args.udt))))
    sets = tuple(args.set) if args.project is None else ()
    asked = DoctorQuestion(args.plc, receivers, partial(_recorded, sets))
    projects = [_path(file) for file in args.files if file.endswith(".toml")]
    lints = [verdict_on_project(_load_bench(path, args.set)) for path in projects]
    files = [_given(file) for file in args.files if not file.endswith(".toml")]
    if args.suggest is not None:
        from trcvtui.diagnosis.readings.suggest import suggest

        for line in suggest(files, args.plc, _path(args.suggest)):
            sys.stderr.write(f"{line}\n")
    if args.time is None:
        return doctor(files, asked, args.format, args.jobs, lints, scheduler=args.scheduler)
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        runs = {run: str(path) for path in projects for run in _run_for(path, args, folder)}
        return doctor([*files, *runs], asked, args.format, args.jobs, lints, runs)


def _recorded(sets: tuple[str, ...], path: str) -> RecordedFacts | None:
    from trcvtui.recording.recording import Recording

    try:
        Recording(path)
    except UserError:
        if sets:
            raise mistake("--set", f"{path}, a capture", "--project beside it, or a recording") from None
        return None
    from trcvtui.replay.job_facts import recorded_facts

    return recorded_facts(path, sets)


def _run_for(path: Path, args: SimpleNamespace, folder: str) -> list[str]:
    """Run a project for the time of `--for`, recorded; return its recording."""
    from pathlib import Path

    from trcvtui.scenario.record import limits_of, record

    out = Path(folder) / str(len(list(Path(folder).iterdir())))
    limits = limits_of(None, None, None, None, None)
    record(path, out, args.kernel, limits, None, args.time, False, _follow(), is_kept=False)
    return [str(file) for file in sorted(out.iterdir())]


def _watch(args: SimpleNamespace) -> int:
    import os

    project = None if args.project is None else _path(args.project)
    if "-" in args.files:
        return _watch_stdin(args, project)
    files = [_given(file) for file in args.files]
    if args.format is None and os.isatty(0) and os.isatty(1):
        from trcvtui.line.on_screen import WatchDriver

        sys.stderr.write(f"reading {', '.join(files)}\n")  # a large one takes its time
        return _show(lambda: WatchDriver(files, (project, args.plc, args.dialect)), None, is_replay=True)
    from trcvtui.line.watch_command import watch

    watch(files, project, args.plc, args.dialect, args.format)
    return GOOD


def _watch_stdin(args: SimpleNamespace, project: Path | None) -> int:
    import os

    if args.files != ["-"]:
        raise mistake("trcvtui watch", "- beside files", "- alone, or files")
    if os.isatty(0):
        raise mistake("stdin", "a terminal", "packets: dumpcap -q -i eth0 -w - | trcvtui watch -")
    asked = project, args.plc, args.dialect
    if args.format is None and os.isatty(1):
        from trcvtui.line.live_screen import LiveDriver

        sys.stderr.write("waiting for packets on stdin\n")
        return _show(lambda: LiveDriver(asked), None)
    from trcvtui.line.watch_command import watch_stdin

    watch_stdin(*asked, args.format)
    return GOOD


def _capture_programs() -> str:
    from textwrap import fill

    return f"""live, from a program that may capture (trcvtui needs no rights):
  Linux    dumpcap -q -i eth0 -w - | trcvtui watch -
           tcpdump -U --immediate-mode -i eth0 -w - | trcvtui watch -
  macOS    sudo tcpdump -U --immediate-mode -i en0 -w - | trcvtui watch -
  Windows  (cmd.exe) "%ProgramFiles%\\Wireshark\\dumpcap" -q -i 1 -w - | trcvtui watch -
  ssh      ssh HOST tcpdump -U --immediate-mode -i eth0 -w - | trcvtui watch -
who may not capture on Linux: sudo usermod -aG wireshark $USER, or sudo dumpcap
{fill(_dialect_names(), 78)}"""


def _tap(args: SimpleNamespace) -> int:
    from trcvtui.line.tap_command import Looks, forward
    from trcvtui.net.tap import route_of

    project = None if args.project is None else _path(args.project)
    if args.listen is None:
        routes = _taps_of(project)
    elif args.connect is None:
        raise mistake("CONNECT", "nothing", "where the bytes of LISTEN go")
    else:
        routes = [route_of("T", args.listen, args.connect, ("LISTEN", "CONNECT"))]
    has_screen = args.format is None and sys.stdin.isatty() and sys.stdout.isatty()
    is_shown = args.format is not None or sys.stdout.isatty()
    looks = Looks(project, args.plc, args.dialect, args.format, is_shown, has_screen, args.hold, args.armed)
    return forward(routes, looks, _tap_record(args.record))


def tap_screen(tap: str, asked: str, kernel: str) -> int:
    """Show a tap that hands us ways for its events over a socket; a child of the process that forwards."""
    import json

    from trcvtui.line.tap_screen import TapDriver

    try:
        return _show(lambda: TapDriver(int(tap), json.loads(asked), kernel), None)
    except UserError as wrong:
        sys.stderr.write("".join(f"{line}\n" for line in wrong.lines()))
        return WRONG_INPUT


def _taps_of(project: Path | None) -> list[Route]:
    """Return the taps of a project; raise UserError where there is none."""
    taps = () if project is None else _load_bench(project).taps
    if not taps:
        raise mistake("trcvtui tap", "neither", "LISTEN and CONNECT, or a --project with [[tap]]")
    from trcvtui.line.tap_observer import routes_of

    return routes_of(taps)


def _tap_record(path: str | None) -> IO[bytes] | None:
    """Return the file of a recording; raise UserError for one that is refused."""
    if path is None:
        return None
    from trcvtui.files import create

    return create(path, "--record")


def _format_names() -> str:
    from trcvtui.scenario.report import FORMATS

    return "formats: " + ", ".join(FORMATS)


def _status(args: SimpleNamespace) -> int:
    from trcvtui.dialects import DIALECTS
    from trcvtui.dialects import status_report as report

    if args.all and args.dialect is not None:
        raise mistake("trcvtui status", "--all with --dialect", "one of the two")
    dialects = tuple(DIALECTS.values())
    chosen = report.chosen_dialects(dialects, args.dialect)
    code = None if args.code is None else report.parse_code(args.code)
    is_json = args.format == "json"
    wanted = code, args.block, report.parse_number(args.code or "")
    found, others = report.explain(chosen if is_json else dialects, *wanted), list[str]()
    if not is_json and not args.all:
        found, others = report.of_one_dialect(found, args.dialect)
    if code is None and not is_json:
        return _print(report.as_table(found))
    from trcvtui.scenario.scenario_index import scenarios_of

    codes = None if code is None else {one.row.code for one in found}  # two: `10` may be a WORD, or a number
    if is_json:
        by_dialect = {dialect.name: scenarios_of(dialect.scenario_folder, codes) for dialect in chosen}
        return _print(report.as_json(report.with_scenarios(found, by_dialect)))
    telling = report.with_telling(
        found, lambda name, may_tell: scenarios_of(DIALECTS[name].scenario_folder, codes, may_tell)
    )
    asked = None if args.all or args.dialect is not None else dialects[0].name
    return _print(report.as_text(telling, others, asked))


def _dialect_names() -> str:
    from trcvtui.dialects import DIALECTS

    return "dialects: " + ", ".join(f"{dialect.name} ({dialect.title})" for dialect in DIALECTS.values())


# -- st -----------------------------------------------------------------------------------------------------


def _st(args: SimpleNamespace) -> int:
    from trcvtui.project.st_call import st_text

    project = _load_bench(_path(args.project))
    names = [args.instance] if args.instance else [decl.name for decl in project.instances]
    return _print(st_text(project, names))


# -- udt ----------------------------------------------------------------------------------------------------


def _udt_show(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    return _print_lines(command.show(_with_examples(args)))


def _udt_decode(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    return _print_lines(command.decode(_with_examples(args)))


def _udt_encode(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    return _print(command.encode(_with_examples(args)))


def _udt_export(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    text = command.export(_with_examples(args))
    return _print(text) if text else GOOD


def _udt_compare(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    lines, is_equal = command.compare(_with_examples(args))
    _print_lines(lines)
    return GOOD if is_equal() else FAILED


def _udt_fit(args: SimpleNamespace) -> int:
    from trcvtui.udt import command

    text, is_sure = command.fit(_with_examples(args))
    _print(text)
    return GOOD if is_sure else FAILED


def _udt_cure(args: SimpleNamespace) -> int:
    from trcvtui.tui.lab.lab_fix import cure_source
    from trcvtui.udt import command

    ours, theirs = command.two_sides_of_a_cure(_with_examples(args))
    return _print(cure_source(ours, theirs, args.form).rstrip("\n"))


def _examples(args: SimpleNamespace) -> int:
    from trcvtui.paths import example_lines

    lines = list(example_lines(args.word))
    if not lines:
        raise mistake("trcvtui examples", f"no project, story or scenario with '{args.word}'", "another word")
    return _print("\n".join(lines))


def _with_examples(args: SimpleNamespace) -> SimpleNamespace:
    args.file = _given(args.file)
    args.others = [_given(name) for name in args.others]
    if hasattr(args, "values"):
        args.values = _given(args.values)
    return args


def _given(text: str) -> str:
    import os

    if os.path.lexists(text):  # the usual case, without an import
        return text
    from trcvtui.paths import given_path

    return str(given_path(text))


def _path(text: str) -> Path:
    from trcvtui.paths import given_path

    return given_path(text)


# -- the arguments -----------------------------------------------------------------------------------------


def _arguments(given: Sequence[str]) -> SimpleNamespace:
    plain = PlainParser()
    _fill(plain, given)
    found = plain.read(given)
    if found is not None:
        return found
    from trcvtui.cli.full_parser import FullParser

    full = FullParser(
        prog="trcvtui",
        description=_overview(),
    )
    full.add_argument("--version", action="version", version=f"trcvtui {__version__}")
    _fill(full, given)
    full.usage = "trcvtui [-h] [--version] [--theme NAME] [COMMAND ...]"
    return full.parse_args(given, SimpleNamespace())


def _fill(parser: ArgumentRows, given: Sequence[str]) -> None:
    parser.set_defaults(command=_demo)
    _add_theme(parser, None)
    commands = parser.add_subparsers(metavar="COMMAND", help=SUPPRESS)
    for name in [word for word in given[:1] if word in COMMANDS] or COMMANDS:
        made = commands.add_parser(name)
        made.given = given[1:]
        COMMANDS[name][-1](made)


def _add_run(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_run)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--netns", action="store_true", help="live, in a network of its own (Linux)")
    parser.add_argument("--read-only", action="store_true", help="show only, give no commands")
    _add_record(parser, "FILE")
    _add_theme(parser, SUPPRESS)


def _add_serve(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_serve)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--port", type=int, default=0, help="on 127.0.0.1; default 0: any that is free")
    parser.add_argument("--write", action="store_true", help="let the browser command the bench")
    parser.add_argument("--as-root", action="store_true", help="allow --write when run as root")
    _add_theme(parser, SUPPRESS)


def _add_theme(parser: ArgumentRows, default: str | None) -> None:
    parser.add_argument(
        "--theme",
        choices=LOOKS,
        metavar="NAME",
        default=default,
        help="dark, light, ansi or a theme of Textual such as nord; default: dark; "
        "ansi where the terminal has 16 colours or fewer",
    )


def _add_scenario(parser: ArgumentRows) -> None:
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
    _add_record(parser, "FILE|DIR")


def _add_record(parser: ArgumentRows, places: str) -> None:
    parser.add_argument("--record", metavar=places, help="keep the run: pcapng, also for Wireshark")
    parser.add_argument("--overwrite", action="store_true", help="where a recording stands already")
    parser.add_argument("--no-secrets", action="store_true", help="record no bytes of TLS connections")


def _add_record_command(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_record)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--out", metavar="DIR", required=True, help="of the numbered files")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--ring", metavar="SIZE", help="such as 256MiB: the oldest files go")
    parser.add_argument("--split", metavar="SIZE", help="of one file; default: an eighth of the ring")
    parser.add_argument("--on", metavar="CONDITION", help='keep what surrounds it: "TRCV_C_1 STATUS=80C5"')
    parser.add_argument("--before", metavar="T#..", help="default: T#30s")
    parser.add_argument("--after", metavar="T#..", help="default: T#10s")
    parser.add_argument("--duration", metavar="T#..", help="default: until Ctrl+C or SIGTERM")
    parser.add_argument("--no-secrets", action="store_true", help="record no bytes of TLS connections")


def _add_agent(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_agent)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="default: live")
    parser.add_argument("--site", default="default", help="of the topics; default: default")
    parser.add_argument("--name", help="of the topics; default: HOST-PROJECT")
    _add_broker(parser)
    parser.add_argument("--metrics", metavar="ADDR:PORT", help="a page for Prometheus")
    parser.add_argument("--record", metavar="DIR", help="keep each run: numbered files")
    parser.add_argument("--ring", metavar="SIZE", default="256MiB", help="of the files; default: 256MiB")
    parser.add_argument("--no-secrets", action="store_true", help="record no bytes of TLS connections")
    parser.add_argument("--allow-fetch", action="store_true", help="readers may ask for what --record keeps")
    parser.add_argument(
        "--packets", metavar="COMMAND", help='of [[watch]]: what captures, "dumpcap -q -i eth0 -w -"'
    )
    parser.add_argument(
        "--with-payload", action="store_true", help="publish the evidence of findings, which may have bytes"
    )


def _add_fleet(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_fleet)
    about = "the broker; user and password: TRCVTUI_MQTT_.."
    parser.add_argument("url", metavar="mqtts://HOST", help=about)
    parser.add_argument("--site", metavar="PATTERN", default="*", help='such as "plant*"; default: all')
    _add_certificates(parser)
    _add_theme(parser, SUPPRESS)


def _add_broker(parser: ArgumentRows) -> None:
    parser.add_argument(
        "--mqtt", metavar="mqtts://HOST", help="the broker; user and password: TRCVTUI_MQTT_.."
    )
    _add_certificates(parser)


def _add_certificates(parser: ArgumentRows) -> None:
    parser.add_argument("--mqtt-ca", metavar="FILE", help="who may have signed its certificate (PEM)")
    parser.add_argument("--mqtt-cert", metavar="FILE", help="ours")
    parser.add_argument("--mqtt-key", metavar="FILE", help="of --mqtt-cert")


def _add_replay(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_replay)
    parser.add_argument("file", metavar="FILE", help="a recording, also .gz")
    parser.add_argument("--check", action="store_true", help="run it again and compare; 1: it differs")
    parser.add_argument("--format", choices=("jsonl",), help="print what the run has printed")
    parser.add_argument(
        "--set", metavar="PATH=VALUE", action="append", default=[], help="what if it had been this"
    )
    parser.add_argument("--dialect", metavar="NAME", help="what if it had been this one")
    parser.add_argument(
        "--at", metavar="SCAN|T#..", help="where the screen opens; default: the first ERROR, finding or DONE"
    )


def _add_recording(parser: ArgumentRows) -> None:
    commands = parser.add_subparsers(metavar="WHAT", required=True)
    made = commands.add_parser("strip", help="a copy to hand on")
    made.set_defaults(command=_recording_strip)
    made.add_argument("source", metavar="IN")
    made.add_argument("target", metavar="OUT")
    made.add_argument("--no-payload", action="store_true", help="zeros in place of all that was sent")
    made.add_argument("--no-secrets", action="store_true", help="TLS stays closed")
    made.add_argument(
        "--anonymise", action="store_true", help="other addresses, no names, no TLS secrets; payload stays"
    )
    made = commands.add_parser("dissector", help="print what shows the journal in Wireshark (Lua)")
    made.set_defaults(command=_recording_dissector)


def _add_report(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_report)
    parser.add_argument("file", metavar="FILE", help="a recording or a capture, also .gz")
    parser.add_argument("--out", metavar="REPORT.html", required=True, help="a new file, or an older report")
    parser.add_argument("--no-payload", action="store_true", help="sizes and times, no bytes that were sent")
    _add_shadows(parser)


def _add_race(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_race)
    parser.last_words = _dialect_names
    parser.add_argument("file", metavar="FILE.toml")
    parser.add_argument(
        "--dialect", metavar="NAME", action="append", default=[], help="each one that takes part"
    )
    parser.add_argument("--format", choices=("text", "jsonl"), default="text", help="default: text")


def _add_conversations(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_conversations)
    parser.add_argument("files", metavar="FILE", nargs="+", help="pcapng or pcap, also .gz; one capture")
    parser.add_argument("--project", metavar="PROJECT.toml", help="on whose ports a PLC listens")
    parser.add_argument("--plc", metavar="ADDR[:PORT]", help="the PLC end; default: guessed")
    parser.add_argument("--format", choices=("text", "json"), default="text", help="default: text")


def _add_doctor(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_doctor)
    parser.add_argument("files", metavar="FILE", nargs="+", help="captures, recordings, projects (.toml)")
    parser.add_argument("--plc", metavar="ADDR[:PORT]", help="the PLC end; default: guessed")
    parser.add_argument("--project", metavar="PROJECT.toml", help="what its instances expect")
    parser.add_argument("--udt", metavar="FILE", help="the type of the messages to the PLC")
    parser.add_argument(
        "--set", metavar="PATH=VALUE", action="append", default=[], help="judge it as if this had been so"
    )
    parser.add_argument("--format", choices=("text", "json", "jsonl"), default="text", help="default: text")
    parser.add_argument(
        "--for", dest="time", metavar="T#..", help="run the projects so long, judge the traffic"
    )
    parser.add_argument("--kernel", choices=KERNELS, default="live", help="of --for; default: live")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="captures at once; default: 1")
    parser.add_argument("--scheduler", metavar="tcp://HOST:8786", help="a Dask cluster, in place of --jobs")
    parser.add_argument("--suggest", metavar="NEW.toml", help="write a project that takes what comes")


def _add_watch(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_watch)
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="pcapng or pcap, also .gz; one capture; - is stdin, as it grows",
    )
    _add_shadows(parser)
    parser.last_words = _capture_programs
    parser.add_argument("--format", choices=("jsonl",), help="default: text")


def _add_tap(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_tap)
    parser.add_argument(
        "listen", metavar="LISTEN", nargs="?", help="[ADDR:]PORT, udp:.. or serial:DEVICE[,9600,8N1]"
    )
    parser.add_argument(
        "connect", metavar="CONNECT", nargs="?", help="the other end; ADDR is 127.0.0.1 where it lacks"
    )
    parser.add_argument("--record", metavar="FILE", help="keep what passes: pcapng, also for Wireshark")
    parser.add_argument(
        "--format", choices=("jsonl",), help="print what shadows show; default: text on a terminal"
    )
    _add_shadows(parser, "CONNECT")
    parser.add_argument("--hold", action="store_true", help="hold both directions until the screen lets go")
    parser.add_argument("--armed", action="store_true", help="keys r (RST), f (FIN) act at once")


def _add_shadows(parser: ArgumentRows, plc: str = "guessed") -> None:
    parser.last_words = _dialect_names
    parser.add_argument("--project", metavar="PROJECT.toml", help="whose instances look on")
    parser.add_argument("--plc", metavar="ADDR[:PORT]", help=f"the PLC end; default: {plc}")
    parser.add_argument("--dialect", metavar="NAME", help="default: the project's, or the first of all")


def _add_status(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_status)
    parser.last_words = _dialect_names
    parser.add_argument(
        "code", metavar="CODE", nargs="?", help="80C5, 16#80C5, W#16#80C5 or 0x80c5; 23 as Error shows it"
    )
    parser.add_argument("--dialect", metavar="NAME", help="default: the first below; json: all")
    parser.add_argument("--all", action="store_true", help="of all dialects")
    parser.add_argument("--block", metavar="BLOCK", help="such as TRCV_C; default: all")
    parser.add_argument("--format", choices=("text", "json"), default="text", help="default: text")


def _add_examples(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_examples)
    parser.add_argument("word", metavar="WORD", nargs="?", help="such as 80C5: scenarios that have it, too")


def _add_st(parser: ArgumentRows) -> None:
    parser.set_defaults(command=_st)
    parser.add_argument("project", metavar="PROJECT.toml")
    parser.add_argument("instance", metavar="INSTANCE", nargs="?", help="default: all of them")


def _add_udt(parser: ArgumentRows) -> None:
    from trcvtui.udt.cli_input import add_udt, last_words

    parser.set_defaults(command=None)
    commands = {
        "show": _udt_show,
        "decode": _udt_decode,
        "encode": _udt_encode,
        "export": _udt_export,
        "compare": _udt_compare,
        "fit": _udt_fit,
        "cure": _udt_cure,
    }
    for name, made in add_udt(parser, parser.given).items():
        made.set_defaults(command=commands[name])
        made.last_words = last_words


Row = tuple[str, str, Callable[[ArgumentRows], None]]  # what it does; an example; its arguments

GROUPS: Final[dict[str, dict[str, Row]]] = {
    "Bench: a PLC with its partners, on this machine": {
        "run": ("the screen; makes a new file, too", "new.toml", _add_run),
        "examples": ("projects and stories to try", "", _add_examples),
        "serve": ("the screen in a browser", "bench.toml --port 8000", _add_serve),
        "scenario": ("a test without a screen", "test.toml --format junit", _add_scenario),
        "race": ("a test through several dialects", "test.toml", _add_race),
        "record": ("keep what a bench does", "bench.toml --out runs", _add_record_command),
        "replay": ("a recording again, step by step", "run.pcapng", _add_replay),
        "recording": ("a copy to hand on", "strip run.pcapng out.pcapng", _add_recording),
    },
    "Line: the traffic of real devices": {
        "watch": ("a capture as the PLC saw it", "line.pcapng --project bench.toml", _add_watch),
        "tap": ("between two ends: look on, intervene", "2001 192.168.0.10:2000", _add_tap),
        "conversations": ("who talked to whom, and when", "line.pcapng", _add_conversations),
        "doctor": ("name what is wrong", "line.pcapng", _add_doctor),
        "report": ("one page to send on", "line.pcapng --out line.html", _add_report),
    },
    "Look up": {
        "status": ("explain a STATUS code", "80C5", _add_status),
        "st": ("instances as calls in Structured Text", "bench.toml", _add_st),
        "udt": ("a type: layout, bytes, exports, repair", "show telegram.st", _add_udt),
    },
    "Many lines": {
        "agent": ("a bench as a service", "line.toml --mqtt mqtts://HOST", _add_agent),
        "fleet": ("all agents on one screen", "mqtts://HOST", _add_fleet),
    },
}
COMMANDS: Final = {name: row for group in GROUPS.values() for name, row in group.items()}


def _overview() -> str:
    """Return the commands of `trcvtui --help`, in groups, each as a line to copy."""
    lines = ["A soft PLC on a test bench: TRCV_C on real sockets, scan by scan."]
    lines += ["Without a command: the built-in demo."]
    for title, group in GROUPS.items():
        lines += ["", title]
        lines += [f"  {f'{name} {example}':38}  {about}" for name, (about, example, _) in group.items()]
    lines += ["", "Each line is an example: type `trcvtui` before it."]
    lines += ["`trcvtui COMMAND --help` tells the rest."]
    return "\n".join(lines)
