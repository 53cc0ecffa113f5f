"""The pattern of `expect X trace`: the whole trace, scan by scan."""

from __future__ import annotations

import re
import time
from itertools import groupby

from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from trcvtui.commands.patterns import (
    ANY_SCANS,
    Atom,
    Scan,
    ScanRun,
    TracePattern,
    format_trace,
    matches,
    parse_pattern,
)


def trace(text: str) -> list[ScanRun]:
    """Return runs from words such as `7002` and `80A1!`, each one scan or `{n}` scans."""
    runs: list[ScanRun] = []
    for word in text.split():
        found = re.fullmatch(r"(\w{4})(!?)(?:\{(\d+)\})?", word)
        assert found
        runs.append(((int(found[1], 16), bool(found[2])), int(found[3] or 1)))
    return runs


def runs_of(scans: list[Scan]) -> list[ScanRun]:
    return [(scan, len(list(same))) for scan, same in groupby(scans)]


def test_a_pattern_describes_traces_and_refuses_others() -> None:
    def told(case: str) -> list[str]:
        pattern, _, scans = case.partition(" |")
        return ["it fits" if matches(parse_pattern(pattern), trace(scans)) else "it does not fit"]

    golden.answers("trace patterns", told, "commands")


def test_a_trace_is_told_in_the_notation_of_patterns() -> None:
    assert format_trace(trace("0001 7001 7002{25} 80A1! 7002{3} 80C3!{2}")) == (
        "0001 7001 7002{25} 80A1! 7002{3} 80C3!{2}"
    )
    assert format_trace([]) == "no scan"


SCANS = st.lists(st.sampled_from([(0x7002, False), (0x7006, False), (0x80A1, True)]), max_size=12)
ATOMS = st.one_of(
    st.just(ANY_SCANS),
    st.builds(
        lambda scan, shape: Atom(scan, *shape),
        st.sampled_from([(0x7002, False), (0x7006, False), (0x80A1, True)]),
        st.sampled_from([(1, False), (1, True), (0, True), (2, False), (3, False)]),
    ),
)
PATTERNS = st.lists(ATOMS, min_size=1, max_size=6).map(lambda atoms: TracePattern(tuple(atoms)))


def as_regex(pattern: TracePattern) -> str:
    parts = []
    for atom in pattern.atoms:
        one = "." if atom.scan is None else chr(atom.scan[0])
        parts.append(one + f"{{{atom.least},}}" if atom.more else one + f"{{{atom.least}}}")
    return "".join(parts)


@given(PATTERNS, SCANS)
def test_it_agrees_with_an_anchored_regular_expression(pattern: TracePattern, scans: list[Scan]) -> None:
    text = "".join(chr(status) for status, _ in scans)
    assert matches(pattern, runs_of(scans)) == bool(re.fullmatch(as_regex(pattern), text, re.DOTALL))


@given(PATTERNS)
def test_a_pattern_is_read_back_from_its_text(pattern: TracePattern) -> None:
    assert parse_pattern(str(pattern)) == pattern


@given(SCANS.filter(bool))
def test_a_collapsed_trace_is_a_pattern_of_itself(scans: list[Scan]) -> None:
    assert matches(parse_pattern(format_trace(runs_of(scans))), runs_of(scans))


def test_no_pattern_makes_a_long_trace_slow() -> None:
    scans = trace("7002{100000}")
    pattern = parse_pattern("... 7002* ... 7002+ " * 10 + "7006")
    began = time.perf_counter()
    assert not matches(pattern, scans)
    # A backtracking matcher would need longer than the universe; this one needs some 0.02 s.
    assert time.perf_counter() - began < 5


def test_what_is_no_pattern_is_refused() -> None:
    golden.mistakes("trace patterns", lambda text: parse_pattern(text, "t"))
