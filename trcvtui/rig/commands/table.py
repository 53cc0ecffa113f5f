"""One row a bench command (contract 4.3): how its line is read, written and completed, and what it does.

Whoever reads, writes, completes or carries out a line asks these rows; nothing else lists commands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

from trcvtui.errors import Problem, UserError
from trcvtui.plc import commands
from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands import completion, lines, reader
from trcvtui.rig.commands import words as words
from trcvtui.rig.commands.data import read_write
from trcvtui.rig.commands.edit import add_line, read_add, read_remove, read_undo
from trcvtui.rig.commands.instances import after, read_create, read_delete, read_download, read_resize
from trcvtui.rig.commands.marks import read_prefix, read_suffix
from trcvtui.rig.commands.peer import read_peer_command
from trcvtui.rig.commands.read_conditions import read_expect, read_wait
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.words import BenchCommand, Mend, Step
from trcvtui.udt.literals import format_time

LONGEST_LINE: Final = 1_000_000
LONGEST_SHOWN: Final = 60


class ActsOnPeer(Protocol):
    """What the rows ask of a peer; each answers what is wrong, or ""."""

    @property
    def replies(self) -> ActsOnReplies:
        """Return what the peer answers by itself."""

    def connect(self, now: int) -> str:
        """Try once."""

    def listen(self) -> str:
        """Open the listener."""

    def close(self) -> str:
        """Send FIN."""

    def rst(self) -> str:
        """Send RST."""

    def shutdown(self) -> str:
        """Send FIN, and go on reading."""

    def stall(self) -> str:
        """Stop reading."""

    def resume(self) -> str:
        """Read again."""

    def send(self, command: words.PeerSend, now: int) -> str:
        """Send a message."""

    def play(self, command: words.PeerPlay, now: int) -> str:
        """Play a sequence."""


class ActsOnReplies(Protocol):
    """What the rows ask of the rules by which a peer answers."""

    def add(self, rule: words.ReplyOn) -> str:
        """Take one more rule."""

    def remove(self, number: int, peer: str) -> str:
        """Forget a rule, or all of them (0)."""


class ActsOnBench(Protocol):
    """What the rows ask of the bench; each answers what is wrong, or ""."""

    now: int

    @property
    def peers(self) -> Mapping[str, ActsOnPeer]:
        """Return the peers by name."""

    def submit(self, *orders: commands.Command) -> str:
        """Tell the PLC what to do in its next scan."""

    def change(self, command: BenchCommand, order: commands.Command) -> str:
        """Change the project, and tell the PLC."""

    def mend(self, command: Mend) -> str:
        """Let the project be another one, and what runs with it."""

    def check_on(self, command: words.CheckOn) -> str:
        """Let a peer send self-checking traffic."""

    def check_off(self, command: words.CheckOff) -> str:
        """End the self-checking traffic of a peer."""

    def set_link(self, command: words.Link) -> str:
        """Let the wire go silent, or speak again."""

    def arm_fault(self, command: words.FaultOn) -> str:
        """Let a kernel call fail."""

    def clear_faults(self) -> str:
        """Forget all faults."""


@dataclass(frozen=True, slots=True)
class RecordRow:
    """One frozen command: the line of it, and what it does; `act` None: scans pass, and a runner takes it."""

    record: type
    write: Callable[[Any], str]
    act: Callable[[ActsOnBench, Any], str] | None = None


@dataclass(frozen=True, slots=True)
class CommandRow:
    """What begins with one verb. `next_words` are those that may stand after the words of a line."""

    verb: str
    read: Callable[[Words, Project], BenchCommand]
    next_words: completion.NextWords
    records: tuple[RecordRow, ...]
    at_prompt: bool = True


def _set(bench: ActsOnBench, c: words.Set) -> str:
    orders = [
        commands.BlinkInput(c.instance, pin)
        if isinstance(value, str)
        else commands.SetInput(c.instance, pin, value)
        for pin, value in c.pins
    ]
    return bench.submit(*orders)


_MENDED: Final = tuple(
    RecordRow(record, write, lambda bench, c: bench.mend(c))
    for record, write in (
        (words.Change, lambda c: f"set {c.kind} {c.name} {c.written}"),
        (words.Add, add_line),
        (words.AddData, add_line),
        (words.Remove, lambda c: f"remove {c.kind} {c.name}"),
        (words.Undo, lambda c: "undo"),
    )
)
_PEER: Final = (
    RecordRow(words.PeerSend, lines.send, lambda bench, c: bench.peers[c.peer].send(c, bench.now)),
    RecordRow(
        words.PeerPlay,
        lambda c: f"peer {c.peer} play {c.name}",
        lambda bench, c: bench.peers[c.peer].play(c, bench.now),
    ),
    RecordRow(
        words.PeerConnect,
        lambda c: f"peer {c.peer} connect",
        lambda bench, c: bench.peers[c.peer].connect(bench.now),
    ),
    RecordRow(
        words.PeerListen, lambda c: f"peer {c.peer} listen", lambda bench, c: bench.peers[c.peer].listen()
    ),
    RecordRow(
        words.PeerClose, lambda c: f"peer {c.peer} close", lambda bench, c: bench.peers[c.peer].close()
    ),
    RecordRow(words.PeerRst, lambda c: f"peer {c.peer} rst", lambda bench, c: bench.peers[c.peer].rst()),
    RecordRow(
        words.PeerShutdown,
        lambda c: f"peer {c.peer} shutdown",
        lambda bench, c: bench.peers[c.peer].shutdown(),
    ),
    RecordRow(
        words.PeerStall, lambda c: f"peer {c.peer} stall", lambda bench, c: bench.peers[c.peer].stall()
    ),
    RecordRow(
        words.PeerResume, lambda c: f"peer {c.peer} resume", lambda bench, c: bench.peers[c.peer].resume()
    ),
    RecordRow(
        words.ReplyOn,
        lambda c: f"peer {c.peer} reply on {lines.rule_text(c)}",
        lambda bench, c: bench.peers[c.peer].replies.add(c),
    ),
    RecordRow(
        words.ReplyOff,
        lambda c: f"peer {c.peer} reply off{f' {c.number}' if c.number else ''}",
        lambda bench, c: bench.peers[c.peer].replies.remove(c.number, c.peer),
    ),
    RecordRow(words.CheckOn, lines.check, lambda bench, c: bench.check_on(c)),
    RecordRow(words.CheckOff, lambda c: f"peer {c.peer} check off", lambda bench, c: bench.check_off(c)),
    RecordRow(words.TrySplits, lines.try_splits),
    # a test of splits in a scenario has ended with its step
    RecordRow(words.TryStop, lambda c: f"peer {c.peer} try-splits stop", lambda bench, c: ""),
)
_MARK: Final = RecordRow(words.SetMark, lambda c: c.line(), lambda bench, c: bench.submit(*c.orders()))

# In the order in which completion offers them.
ROWS: Final = (
    CommandRow(
        "set",
        reader.read_set,
        completion.after_set,
        (RecordRow(words.Set, lines.set_line, _set), _MENDED[0]),
    ),
    CommandRow(
        "pulse",
        reader.read_pulse,
        completion.after_pulse,
        (
            RecordRow(
                words.Pulse,
                lambda c: f"pulse {c.instance} {c.pin}",
                lambda bench, c: bench.submit(commands.PulseInput(c.instance, c.pin)),
            ),
        ),
    ),
    CommandRow("peer", read_peer_command, completion.after_peer, _PEER),
    CommandRow(
        "write",
        read_write,
        completion.after_write,
        (
            RecordRow(
                words.Write,
                lines.write,
                lambda bench, c: bench.submit(commands.WriteData(c.data, c.offset, c.payload)),
            ),
        ),
    ),
    CommandRow(
        "fault",
        reader.read_fault,
        completion.after_fault,
        (
            RecordRow(words.FaultOn, lines.fault, lambda bench, c: bench.arm_fault(c)),
            RecordRow(words.FaultClear, lambda c: "fault clear", lambda bench, c: bench.clear_faults()),
        ),
    ),
    CommandRow(
        "link",
        reader.read_link,
        completion.after_link,
        (
            RecordRow(
                words.Link,
                lambda c: f"link {c.connect} {'up' if c.up else 'down'}",
                lambda bench, c: bench.set_link(c),
            ),
        ),
    ),
    CommandRow(
        "plc",
        reader.read_plc,
        completion.only("stop", "run"),
        (
            RecordRow(words.PlcStop, lambda c: "plc stop", lambda bench, c: bench.submit(commands.PlcStop())),
            RecordRow(words.PlcRun, lambda c: "plc run", lambda bench, c: bench.submit(commands.PlcRun())),
        ),
    ),
    CommandRow(
        "run",
        reader.read_run,
        completion.nothing,
        (
            RecordRow(words.RunScans, lambda c: f"run {c.scans}"),
            RecordRow(words.RunFor, lambda c: f"run {format_time(c.ns)}"),
        ),
    ),
    CommandRow(
        "expect",
        read_expect,
        completion.after_expect,
        (
            RecordRow(words.Expect, lines.expect),
            RecordRow(words.ExpectTrace, lambda c: f"expect {c.instance} trace {c.pattern}"),
        ),
    ),
    CommandRow(
        "create",
        read_create,
        completion.after_create,
        (
            RecordRow(
                words.Create, lines.create, lambda bench, c: bench.change(c, commands.CreateInstance(c.decl))
            ),
        ),
    ),
    CommandRow(
        "delete",
        read_delete,
        completion.an_instance,
        (
            RecordRow(
                words.Delete,
                lambda c: f"delete {c.instance}",
                lambda bench, c: bench.change(c, commands.DeleteInstance(c.instance)),
            ),
        ),
    ),
    CommandRow(
        "download",
        read_download,
        completion.an_instance,
        (
            RecordRow(
                words.Download,
                lambda c: f"download {c.instance}",
                lambda bench, c: bench.change(c, commands.DownloadInstance(c.instance)),
            ),
        ),
    ),
    CommandRow(
        "resize",
        read_resize,
        completion.after_resize,
        (
            RecordRow(
                words.Resize,
                lambda c: f"resize {c.data} {c.type_name}",
                lambda bench, c: bench.change(c, commands.ResizeData(c.decl)),
            ),
        ),
    ),
    CommandRow("add", read_add, completion.after_add, _MENDED[1:3]),
    CommandRow("remove", read_remove, completion.after_remove, _MENDED[3:4]),
    CommandRow("undo", read_undo, completion.nothing, _MENDED[4:]),
    CommandRow(
        "feed",
        reader.read_feed,
        completion.after_feed,
        (
            RecordRow(
                words.FeedLine,
                lines.feed,
                lambda bench, c: bench.submit(commands.FeedBuffer(c.buffer, c.payload)),
            ),
        ),
    ),
    CommandRow("prefix", read_prefix, completion.after_mark, (_MARK,)),
    CommandRow("suffix", read_suffix, completion.after_mark, ()),
    CommandRow("wait", read_wait, completion.nothing, (RecordRow(words.Wait, lines.wait),), at_prompt=False),
)
COMMANDS: Final = {row.verb: row for row in ROWS}


def to_line(command: BenchCommand) -> str:
    """Return the line that `parse_line` reads as this command."""
    return record_row(type(command)).write(command)


def record_row(record: type) -> RecordRow:
    """Return the row of a frozen command."""
    return next(known for row in COMMANDS.values() for known in row.records if known.record is record)


def parse_line(text: str, project: Project, where: str) -> BenchCommand | None:
    """Return the command of one line, None for a blank line or a comment; raise UserError.

    `where` stands at the beginning of each message.
    """
    if len(text) > LONGEST_LINE:
        raise UserError(Problem(where, f"{len(text)} characters", f"at most {LONGEST_LINE} in a line"))
    tokens = Words(text, where)
    if not tokens:
        return None
    verb = tokens.next("a command")
    if verb not in COMMANDS:
        raise tokens.wrong(shown(verb), expected_name(verb, COMMANDS, "command"))
    command = COMMANDS[verb].read(tokens, project)
    tokens.finish()
    return command


def parse_script(text: str, project: Project, where: str) -> list[Step]:
    """Return the commands of a script, numbered from 1; raise UserError with the mistakes of all lines."""
    steps: list[Step] = []
    problems: list[Problem] = []
    number = 0
    for line in map(str.strip, text.split("\n")):  # \r\n too; U+2028 and the like stand inside a command
        if not line or line.startswith("#"):
            continue
        number += 1
        try:
            command = parse_line(line, project, f"{where}: step {number} ({_short(line)})")
        except UserError as wrong:
            problems += wrong.problems
            continue
        if command is not None:
            steps.append(Step(number, line, command))
            project = after(command, project)
    if problems:
        raise UserError(problems)
    return steps


def _short(line: str) -> str:
    return line if len(line) <= LONGEST_SHOWN else line[: LONGEST_SHOWN - 3] + "..."
