"""A pattern over a stream: the meaning that `re` gives it, however the stream is cut, at a bounded cost."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.commands.patterns import MOST_KNOWN, StreamPattern

ATOMS = st.sampled_from(
    [*"abc", ".", "[ab]", "[^a]", r"\x61", r"\d", r"\.", "[]a]", r"[\w]", "{", "a{", r"\060"]
)
PATTERNS = st.recursive(
    ATOMS,
    lambda part: st.one_of(
        st.builds(
            lambda one, times: f"(?:{one}){times}", part, st.sampled_from(["*", "+", "?", "*?", "{2}"])
        ),
        st.builds(
            lambda one, times: f"({one}){times}", part, st.sampled_from(["{1,3}", "{,2}", "{2,}", "{,}"])
        ),
        st.lists(part, min_size=2, max_size=3).map("".join),
        st.lists(part, min_size=2, max_size=3).map(lambda parts: f"(?P<name>{'|'.join(parts)})"),
    ),
    max_leaves=6,
)


def first_end(pattern: re.Pattern[bytes], stream: bytes) -> int | None:
    """Return the end of the match that is complete first, as `re` finds it."""
    ends = (
        end
        for end in range(1, len(stream) + 1)
        for start in range(end)
        if pattern.fullmatch(stream, start, end)
    )
    return next(ends, None)


@given(PATTERNS, st.text("abc0{.\n]", max_size=12))
def test_a_match_is_found_where_it_is_complete_first(pattern: str, text: str) -> None:
    content = pattern.replace("(?P<name>", "(").encode()
    known, stream = re.compile(content), text.encode()
    machine = StreamPattern(content)
    hits = [machine.take(bytes([byte])) for byte in stream]
    assert (hits.index(1) + 1 if 1 in hits else None) == first_end(known, stream)
    machine.begin()
    assert machine.take(stream) == sum(hits)


@pytest.mark.parametrize("pattern", [b"(a+)+b", b"(a|a)*b", b"a*a*a*a*a*b", b"(a|aa)+b", b"(.*)*x"])
def test_what_makes_re_run_for_hours_takes_a_flood_in_one_go(pattern: bytes) -> None:
    machine = StreamPattern(pattern)
    assert machine.take(b"a" * 100_000) == 0
    assert machine.take(b"bx") in (1, 2)


def test_a_pattern_remembers_a_bounded_number_of_steps() -> None:
    machine = StreamPattern(b"a[ab]{100}b")
    noise = b"".join(b"ab"[n * n % 7 % 2 : n * n % 7 % 2 + 1] + b"a" * (n % 5) for n in range(20_000))
    machine.take(noise)
    assert 0 < machine.known <= MOST_KNOWN


@pytest.mark.parametrize(
    ("pattern", "named"),
    [
        (b"^id", "its ^ asks for the beginning of a text, which a stream has not"),
        (b"(a+)+$", "its $ asks for the end of a text, which a stream has not"),
        (rb"id\b", "a place in the stream, or what a group has found"),
        (rb"(a)\1", "a place in the stream, or what a group has found"),
        (b"(?=a)b", "a group that looks around or sets a flag"),
        (b"(?i)a", "a group that looks around or sets a flag"),
        (b"a++", "a repetition that keeps what it has"),
        (b"(((a{9}){9}){9}){9}", "more than 128 bytes, repetitions counted"),
        (b"a{4000000}", "more than 128 bytes, repetitions counted"),
        (b"(" * 40 + b"a" + b")" * 40, "groups in groups, 32 deep"),
    ],
)
def test_what_a_stream_cannot_be_asked_for_is_named(pattern: bytes, named: str) -> None:
    re.compile(pattern)
    with pytest.raises(ValueError, match=re.escape(named)):
        StreamPattern(pattern)


def test_nothing_many_times_is_still_nothing() -> None:
    assert StreamPattern(b"((?:){99999999}){99999999}a").take(b"xa") == 1
