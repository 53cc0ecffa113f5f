"""Every command can be written as the line that means it: the screen's toggles and saved sessions "
"live on that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.bench.bench_project import bench_project
from trcvtui.commands import words
from trcvtui.commands.counters_and_checksums import Fill
from trcvtui.commands.patterns import ANY_SCANS, Atom, TracePattern
from trcvtui.commands.table import COMMANDS, format_command, parse_line
from trcvtui.commands.words import Contains, StartsWith
from trcvtui.net.faults import KNOWN_ERRORS
from trcvtui.net.kernel import KERNEL_CALLS
from trcvtui.project.project import InstanceDecl, Project

TRUTH = st.booleans()
UDINT = st.integers(0, 4294967295)
NS = st.integers(0, 10**15)
BYTES = st.binary(min_size=1, max_size=8)
INPUTS = {"CONT": TRUTH | st.just("blink"), "EN_R": TRUTH | st.just("blink"), "LEN": UDINT, "ADHOC": TRUTH}
PINS = {"STATUS": st.integers(0, 65535), "DONE": TRUTH, "RCVD_LEN": UDINT, "LEN": UDINT, "COM_RST": TRUTH}


def some_of(
    pins: Mapping[str, st.SearchStrategy[int | str]],
) -> st.SearchStrategy[tuple[tuple[str, int | str], ...]]:
    pairs = [st.tuples(st.just(name), values) for name, values in pins.items()]
    return st.lists(st.one_of(pairs), min_size=1, max_size=4).map(tuple)


MEMBERS = st.one_of(
    st.builds(words.MemberIs, st.just("n"), st.just(""), st.integers(-32768, 32767)),
    st.builds(words.MemberIs, st.just("raw"), st.just("[3]"), st.integers(0, 255)),
    st.builds(words.MemberIs, st.just("rx"), st.just("flag"), TRUTH),
    st.builds(words.MemberIs, st.just("rx"), st.just("speed"), st.floats(width=32, allow_nan=False)),
    st.builds(words.MemberIs, st.just("rx"), st.just("pts[1].y"), st.integers(-32768, 32767)),
    st.builds(words.MemberIs, st.just("rx"), st.just("t"), st.sampled_from(["T#0ms", "T#1s500ms", "T#-3ms"])),
    st.builds(
        words.MemberIs,
        st.just("rx"),
        st.just("name"),
        st.text(st.characters(max_codepoint=255), max_size=8),
    ),
)
CONDITIONS = st.one_of(
    st.builds(words.PinsAre, st.just("X"), some_of(PINS)),
    st.builds(words.PeerIs, st.just("P1"), st.sampled_from(words.PEER_STATES)),
    st.builds(words.PeerHasReceived, st.just("P1"), BYTES),
    st.builds(words.DataIs, st.just("rx"), st.integers(0, 44), BYTES),
    MEMBERS,
)
ATOMS = st.just(ANY_SCANS) | st.builds(
    lambda status, error, shape: Atom((status, error), *shape),
    st.integers(0, 65535),
    TRUTH,
    st.sampled_from([(1, False), (1, True), (0, True), (2, False), (999, False)]),
)
PATTERNS = st.lists(ATOMS, min_size=1, max_size=5).map(lambda atoms: TracePattern(tuple(atoms)))
SENDS = st.builds(
    words.PeerSend,
    st.just("P1"),
    BYTES,
    st.lists(st.integers(1, 9), max_size=3).map(tuple),
    NS,
    st.integers(1, 1_000_000),
    NS,
)
FILLS = st.one_of(
    st.builds(Fill, st.just("n"), st.integers(0, 1), st.just(1)),
    st.builds(Fill, st.just("n"), st.integers(0, 1), st.integers(2, 8), st.sampled_from(["little", "big"])),
    st.builds(Fill, st.just("digits"), st.integers(0, 1), st.integers(1, 19)),
    st.builds(Fill, st.just("sum8"), st.just(1), st.just(1)),
    st.builds(Fill, st.just("crc32"), st.just(1), st.just(4), st.sampled_from(["little", "big"])),
)
FILLED = st.builds(
    lambda fill, gaps: words.PeerSend(
        "P1", bytes(fill.offset + fill.width), gap_ns=gaps[-1], gaps_ns=gaps, fills=(fill,)
    ),
    FILLS,
    st.lists(NS, min_size=2, max_size=4, unique=True).map(tuple),
)
MATCHES = st.one_of(
    st.builds(Contains, BYTES),
    st.builds(StartsWith, BYTES),
)
TRIALS = st.builds(
    words.TrySplits,
    st.just("P1"),
    st.binary(min_size=2, max_size=8),
    st.sampled_from(["X", "Y"]),
    NS,
    st.none() | st.integers(0, 1023),
)
FAULTS = st.builds(
    words.FaultOn,
    st.sampled_from(KERNEL_CALLS),
    st.none() | st.sampled_from(sorted(KNOWN_ERRORS)),
    st.sampled_from([None, "C1"]),
    st.integers(1, 10**9),
    st.integers(1, 10**9) | st.just(words.TIMES_FOREVER),
)
CREATES = st.builds(
    words.CreateBlock,
    st.builds(
        InstanceDecl,
        st.just("NEW_1"),
        st.sampled_from(["TRCV_C", "TRCV"]),
        st.just("C1"),
        st.sampled_from([None, "rx", "raw"]),
        st.just("MAIN"),
        st.dictionaries(st.sampled_from(["EN_R", "ADHOC"]), TRUTH).map(lambda pins: tuple(pins.items())),
    ),
)
OF_A_PEER = ("close", "rst", "shutdown", "stall", "resume")
BENCH_COMMANDS = st.one_of(
    st.builds(words.SetInputs, st.just("X"), some_of(INPUTS)),
    st.builds(words.PulsePin, st.just("X"), st.sampled_from(["EN_R", "COM_RST"])),
    st.builds(words.WriteBytes, st.just("rx"), st.integers(0, 44), BYTES),
    st.builds(words.DeleteBlock, st.just("X")),
    st.builds(words.DownloadBlock, st.just("Y")),
    CREATES,
    st.just(words.PlcStop()),
    st.just(words.PlcRun()),
    st.just(words.PeerAction("P1", "connect")),
    st.just(words.PeerAction("P2", "listen")),
    st.builds(words.PeerAction, st.sampled_from(["P1", "P2"]), st.sampled_from(OF_A_PEER)),
    SENDS,
    FILLED,
    st.builds(words.AddReply, st.just("P1"), MATCHES, SENDS | FILLED),
    st.builds(words.RemoveReplies, st.just("P1"), st.integers(0, 64)),
    TRIALS,
    st.builds(words.NumberedFramesOn, st.just("P1"), st.integers(10, 65507), NS, st.sampled_from(["", "X"])),
    st.just(words.NumberedFramesOff("P1")),
    st.just(words.PeerPlaySequence("P1", "start_up")),
    st.just(words.StopTrySplits("P1")),
    st.builds(words.SetLink, st.just("C1"), TRUTH),
    FAULTS,
    st.just(words.FaultClear()),
    st.builds(words.RunScans, st.integers(1, 10**9)),
    st.builds(words.RunFor, NS),
    st.builds(words.Wait, CONDITIONS, NS),
    st.builds(words.Expect, CONDITIONS, st.none() | NS),
    st.builds(words.ExpectTrace, st.just("X"), PATTERNS),
)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=400)
@given(command=BENCH_COMMANDS)
def test_the_line_of_a_command_means_that_command(project: Project, command: words.BenchCommand) -> None:
    line = format_command(command)
    assert line.isprintable()
    assert parse_line(line, project, "w") == command


def test_every_command_has_a_line() -> None:
    rows = [known.record for row in COMMANDS.values() for known in row.records]
    assert len(rows) == len(set(rows))
    assert set(rows) == set(words.BenchCommand.__args__)


def test_nan_has_a_line(project: Project) -> None:
    line = format_command(words.Expect(words.MemberIs("rx", "speed", math.nan)))
    command = parse_line(line, project, "w")
    assert line == "expect rx.speed NaN"
    assert isinstance(command, words.Expect) and isinstance(command.condition, words.MemberIs)
    assert math.isnan(float(command.condition.value))


def test_a_member_is_named_by_the_path_with_its_declared_bounds(tmp_path: Path) -> None:
    command = parse_line("expect rx.m[2,0] 5", bench_project(tmp_path), "w")
    assert command == words.Expect(words.MemberIs("rx", "m[2,0]", 5))
