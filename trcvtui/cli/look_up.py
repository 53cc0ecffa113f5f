"""Shell completion, and the commands that look up a code, a call or a type."""

from __future__ import annotations

from trcvtui.cli.options import (
    Args,
    CommandParser,
    add_format,
    add_project,
    dialect_names,
    load_bench_project,
    print_text,
)
from trcvtui.cli.udt import set_up_udt
from trcvtui.errors import mistake


def set_up_status(parser: CommandParser) -> None:
    parser.description = "Explains a STATUS code; without CODE it lists all codes of a dialect."
    parser.make_epilog = dialect_names
    parser.add_argument(
        "code",
        metavar="CODE",
        nargs="?",
        help="80C5, 16#80C5, W#16#80C5 or 0x80c5; for TwinCAT also a number such as 23",
    )
    parser.add_argument("--dialect", metavar="NAME", help="default: the first with the code; in JSON: all")
    parser.add_argument("--all", action="store_true", help="explain or list codes in all dialects")
    parser.add_argument("--block", metavar="BLOCK", help="only codes of this block, such as TRCV_C")
    add_format(parser, "text", "json")


def _status(args: Args) -> int:
    from trcvtui.dialects import DIALECTS
    from trcvtui.dialects import status_report as report

    if args.all and args.dialect is not None:
        raise mistake("trcvtui status", "--all with --dialect", "one of the two")
    dialects = tuple(DIALECTS.values())
    chosen = report.select_dialects(dialects, args.dialect)
    code = None if args.code is None else report.parse_code(args.code)
    is_json = args.format == "json"
    wanted = code, args.block, report.parse_number(args.code or "")
    found, others = report.find_explanations(chosen if is_json else dialects, *wanted), list[str]()
    if not is_json and not args.all:
        found, others = report.select_one_dialect(found, args.dialect)
    if code is None and not is_json:
        return print_text(report.as_table(found))
    from trcvtui.scenario.scenario_index import find_scenarios

    codes = None if code is None else {one.row.code for one in found}  # two: `10` may be a WORD, or a number
    if is_json:
        by_dialect = {dialect.name: find_scenarios(dialect.scenario_folder, codes) for dialect in chosen}
        return print_text(report.as_json(report.add_scenarios(found, by_dialect)))
    cards = report.add_card_scenarios(
        found, lambda name, may_tell: find_scenarios(DIALECTS[name].scenario_folder, codes, may_tell)
    )
    default = None if args.all or args.dialect is not None else dialects[0].name
    return print_text(report.as_text(cards, others, default))


def set_up_st(parser: CommandParser) -> None:
    parser.description = "Prints instances as calls in Structured Text or SCL, ready to paste."
    add_project(parser)
    parser.add_argument("instance", metavar="INSTANCE", nargs="?", help="one instance; default: all")
    parser.add_argument("--short", action="store_true", help="leave out pins with their default values")
    parser.add_argument("--multi", action="store_true", help="SCL: call instances as multi-instances, #NAME")


def _print_calls(args: Args) -> int:
    from trcvtui.commands.table import collect_written_data, parse_script
    from trcvtui.project.st_call import CallForm, st_text

    project = load_bench_project(args.project)
    names = [args.instance] if args.instance else [decl.name for decl in project.instances]
    steps = parse_script(project.start, project, f"{project.path}: start")
    form = CallForm(args.short, args.multi, collect_written_data(steps, project))
    return print_text(st_text(project, names, form=form))


def set_up_completion(parser: CommandParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="the shell")
    parser.description = 'Prints the completion for a shell. In bash: eval "$(trcvtui completion bash)"'


def _completion(args: Args) -> int:
    import shtab

    parser = args.whole()
    _make_completable(parser)
    return print_text(shtab.complete(parser, args.shell))


def _make_completable(parser: CommandParser) -> None:
    """Let shell completion offer file names for file arguments, and commands that the help leaves out."""
    from argparse import _SubParsersAction

    import shtab

    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            action.help = None
            for each in action.choices.values():
                _make_completable(each)
        elif {*str(action.metavar).replace(".", "|").split("|")} & {"FILE", "DIR", "toml", "IN", "OUT"}:
            action.complete = shtab.FILE  # type: ignore[attr-defined]


COMMANDS = {
    "status": ("explain a STATUS code", "80C5", set_up_status, _status),
    "st": ("instances as calls in Structured Text", "bench.toml", set_up_st, _print_calls),
    "udt": ("a type: layout, bytes, exports, repair", "show telegram.st", set_up_udt, None),
    "completion": ("commands and options for a shell", "bash", set_up_completion, _completion),
}
