"""Possible marks, sizes and length fields of a recording: guesses, each of which is then tried."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isqrt, log2
from typing import Final

from trcvtui.blocks.serial.com_buffer import LineRecording
from trcvtui.diagnosis.readings.trial import KNOWN_STARTS, TEXT, LengthField, LocatedFrame

LONGEST_MARK: Final = 12
MOST_SEEDS: Final = 10
MOST_MARKS: Final = 7
MOST_PLACES: Final = 100  # of a mark that are examined
LONGEST_LAG: Final = 300
LEAST_TIMES: Final = 3
ALIKE_SHARE: Final = 0.9
LENGTH_WIDTHS: Final = ((1, "big"), (2, "big"), (2, "little"), (4, "big"), (4, "little"))
USUAL_WIDTHS: Final = (2, 1, 4)
MOST_FIELDS: Final = 8
LAST_POSITION: Final = 8
LEAST_MEAN: Final = 4  # bytes of a frame with a length field
FIRST_STEPS: Final = 8
MOST_ALIKE: Final = 64  # so many frames of one size have no length field
LONGEST_FRAME: Final = 8192
PAUSE_RATIO: Final = 3  # times the longest pause in a burst


@dataclass(frozen=True, slots=True)
class Bursts:
    """A recording split at its pauses. `pauses` has positions where a pause ends or a connection begins.

    `within` is the longest pause inside a burst, `between` the shortest pause between two bursts, in ns.
    If `is_clear` is True, the two kinds of pauses differ clearly.
    """

    pauses: tuple[int, ...]
    starts: tuple[int, ...]  # of connections
    within: int
    between: int
    lengths: tuple[int, ...]
    is_clear: bool


def find_bursts(recording: LineRecording) -> Bursts:
    """Split a recording at the pauses that are much longer than the others."""
    chunks = recording.chunks
    times = sorted({b.t_ns - a.t_ns for a, b in pairwise(chunks) if not b.begins})
    longest = max(recording.tick_ns, 1)
    pairs = [(b / max(a, longest), a, b) for a, b in zip([0, *times], times, strict=False)]
    _, within, between = max(pairs, default=(0.0, 0, 0))
    is_clear = between >= PAUSE_RATIO * max(longest, within)
    pauses, starts, at, before = [], [], 0, 0
    for chunk in chunks:
        if chunk.begins or at == 0:
            starts.append(at)
        if at and (chunk.begins or (is_clear and chunk.t_ns - before >= between)):
            pauses.append(at)
        at, before = at + len(chunk.payload), chunk.t_ns
    edges = [0, *pauses, at]
    lengths = tuple([b - a for a, b in pairwise(edges)])
    return Bursts(
        tuple(pauses), tuple(starts), within, between, lengths, is_clear and len(lengths) > LEAST_TIMES
    )


# -- marks ---------------------------------------------------------------------------------------------------


def find_marks(stream: bytes) -> list[bytes]:
    """Return the byte strings that recur most, the most telling first."""
    counts = Counter(stream)
    total = len(stream)
    worth: dict[bytes, float] = {}
    for byte, number in counts.items():
        if number >= LEAST_TIMES:
            worth[bytes([byte])] = number * log2(max(1.01, number * len(counts) / total))
    for (a, b), number in Counter(pairwise(stream)).items():
        if number >= LEAST_TIMES and a != b:
            expected = counts[a] * counts[b] / total
            worth[bytes([a, b])] = number * log2(max(1.01, number / expected))
    seeds = sorted(worth, key=lambda mark: -worth[mark])[:MOST_SEEDS]
    found = dict.fromkeys(grow_mark(seed, stream) for seed in seeds)
    return list(found)[:MOST_MARKS]


def grow_mark(mark: bytes, stream: bytes) -> bytes:
    """Return a mark extended by the bytes that are next to it nearly every time."""
    places = find_places(mark, stream)[:MOST_PLACES]
    before = after = 0
    while len(mark) + before + after < LONGEST_MARK:
        following = Counter(stream[p + len(mark) + after : p + len(mark) + after + 1] for p in places)
        byte = _constant_neighbour(following)
        if byte:
            after += 1
            continue
        byte = _constant_neighbour(Counter(stream[p - before - 1 : p - before] for p in places if p > before))
        if not byte:
            break
        before += 1
    for p in places:
        whole = stream[p - before : p + len(mark) + after] if p >= before else b""
        if len(whole) == before + len(mark) + after and stream.count(whole) >= ALIKE_SHARE * (
            len(places) - 1
        ):
            return whole
    return mark


def _constant_neighbour(beside: Counter[bytes]) -> bytes:
    """Return the byte that is beside a mark nearly each time, or b"" if there is none."""
    beside.pop(b"", None)
    (byte, number) = beside.most_common(1)[0] if beside else (b"", 0)
    return byte if number >= LEAST_TIMES - 1 and number >= ALIKE_SHARE * beside.total() else b""


def find_places(mark: bytes, stream: bytes) -> list[int]:
    """Return the places of a mark; overlapping ones count once."""
    places, at = [], stream.find(mark)
    while at >= 0:
        places.append(at)
        at = stream.find(mark, at + len(mark))
    return places


def is_alternating(starts: Sequence[int], ends: Sequence[int]) -> bool:
    """Return whether the places of starts and ends alternate, with few exceptions."""
    if abs(len(starts) - len(ends)) > 1 + len(starts) // 10:
        return False
    turns = sorted([(place, 0) for place in starts] + [(place, 1) for place in ends])
    changes = sum([a[1] != b[1] for a, b in pairwise(turns)])
    return changes >= ALIKE_SHARE * (len(turns) - 1)


def rank_mark_splits(mark: bytes, stream: bytes, pauses: Sequence[int]) -> list[int]:
    """Return likely lengths of the suffix in a mark that may be suffix plus prefix, the likeliest first."""
    starts = sorted({0, *pauses})
    ends = [*[place for place in starts if place], len(stream)]
    votes = []
    for place in range(len(mark) + 1):
        begun = sum([stream.startswith(mark[place:], start) for start in starts])
        ended = sum([stream.endswith(mark[:place], 0, end) for end in ends])
        votes.append((begun + ended, place == len(mark), place))
    return [place for _, _, place in sorted(votes, reverse=True)]


def common_prefix(contents: Sequence[bytes]) -> bytes:
    if not contents:
        return b""
    first, last = min(contents), max(contents)
    size = next((n for n, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), None)
    return first[: min(len(first), len(last)) if size is None else size]


# -- sizes ---------------------------------------------------------------------------------------------------


def find_frame_sizes(stream: bytes, bursts: Bursts, marks: Sequence[bytes]) -> list[int]:
    """Return the likely sizes of all frames, the likeliest first."""
    found: Counter[int] = Counter()
    if bursts.is_clear:
        size, number = Counter(bursts.lengths).most_common(1)[0]
        found[size] += 4 * number
    for mark in marks:
        places = find_places(mark, stream)
        steps = Counter(b - a for a, b in pairwise(places))
        for size, number in steps.most_common(1):
            if number >= LEAST_TIMES and number * 2 >= steps.total():
                found[size] += number
    for lag in _find_periods(stream):
        found[lag] += 1
    return [size for size, _ in found.most_common(4) if 1 < size <= LONGEST_FRAME]


def _find_periods(stream: bytes) -> Iterator[int]:
    whole = int.from_bytes(stream, "little")
    size = len(stream)
    alike = {}
    for lag in range(2, min(LONGEST_LAG, size // LEAST_TIMES)):
        rest = size - lag
        same = (whole >> (8 * lag) ^ (whole & ((1 << (8 * rest)) - 1))).to_bytes(rest, "little").count(0)
        alike[lag] = same / rest
    if not alike:
        return
    usual = sorted(alike.values())[len(alike) // 2]
    best = sorted(alike, key=lambda lag: (-alike[lag], lag))[:6]
    for lag in sorted(best):
        if alike[lag] > usual + 3 * isqrt(size) / size:
            yield lag


# -- length fields -------------------------------------------------------------------------------------------


def find_length_fields(stream: bytes, bursts: Bursts) -> list[LengthField]:
    """Return the length fields that lead from frame to frame through the recording, the best first."""
    starts = frozenset((*bursts.pauses, *bursts.starts))
    ends = sorted({*bursts.starts, len(stream)} - {0})
    found: list[tuple[float, LengthField]] = []
    for width, order in LENGTH_WIDTHS:
        for position in range(LAST_POSITION):
            head = position + width
            first = stream[: bursts.lengths[0]] if bursts.is_clear else b""
            plain = LengthField(position, width, order, 0)
            seen = len(first) - plain.frame_size(first) if len(first) >= head else 0
            for more in dict.fromkeys((head, 0, position, head + 1, head + 2, width, max(0, seen))):
                field = LengthField(position, width, order, more)
                score = _score_field(stream, field, ends, starts)
                if score > 0:
                    found.append((score, field))
    found.sort(key=lambda each: (-each[0], USUAL_WIDTHS.index(each[1].width)))
    return [field for _, field in found[:MOST_FIELDS]]


def _score_field(stream: bytes, field: LengthField, ends: Sequence[int], pauses: frozenset[int]) -> float:
    """Return how well a length field leads from frame to frame; 0 means that it does not fit."""
    at, met, sizes, begun = 0, 0, set(), []
    head = field.head_size
    for end in ends:
        while at + head <= end:
            size = field.frame_size(stream[at : at + head])
            if size < max(2, head) or size > LONGEST_FRAME:
                return 0.0
            sizes.add(size)
            met += at in pauses
            begun.append(at)
            at += size
            if len(begun) > FIRST_STEPS and at < LEAST_MEAN * len(begun):
                return 0.0
            if len(begun) == MOST_ALIKE and len(sizes) == 1:
                return 0.0
        if at > end and end != len(stream):
            at = end  # the connection ended in the middle of a frame
    frames = len(begun)
    if frames < LEAST_TIMES or len(sizes) == 1:  # a length that never changes is a mark
        return 0.0
    missed = max(0, len([place for place in pauses if place]) - met)
    alike = [_commonest_share(stream, begun[:64], place) for place in range(LAST_POSITION)]
    return 4.0 * (met - missed) / frames + sum([share > ALIKE_SHARE for share in alike]) + (at == len(stream))


def _commonest_share(stream: bytes, begun: Sequence[int], place: int) -> float:
    column = Counter(stream[at + place : at + place + 1] for at in begun)
    return column.most_common(1)[0][1] / len(begun)


# -- noise between frames ---------------------------------------------------------------------------------

# Rule: a frame that begins with noise speaks against a suffix alone. A mark that occurs once in nearly
# every frame is the prefix when no data precedes it: noise comes and goes, or is a control byte in a text.

NEARLY_ALL: Final = 0.9
FEW_FRAMES: Final = 5  # fewer have a byte in common by chance
LEAST_CLEAN_SHARE: Final = 0.25  # of the frames begin with a prefix, if it is no known one
LEAST_TEXT: Final = 0.9  # of the bytes after a control byte that nearly always has noise before it
LEAST_ADJACENT_MARKS: Final = 3
LONGEST_PREFIX: Final = 8
MOST_NOISE_FRAMES: Final = 40


def prefix_after_noise(
    good: Sequence[LocatedFrame], suffix: bytes, marks: Sequence[bytes], *, is_text: bool
) -> bytes:
    """Return the prefix of frames cut by a suffix alone, or b"" if no frame has noise before a prefix."""
    bodies = [frame.content[: len(frame.content) - len(suffix)] for frame in good[:MOST_NOISE_FRAMES]]
    bodies = [body for body in bodies if body]
    found = []
    for mark in _prefix_candidates(bodies, marks):
        places = [body.find(mark) for body in bodies if body.count(mark) == 1]
        if len(bodies) - len(places) <= max(1, len(bodies) // 10) and any(places):
            found.append((sum(places), -len(mark), mark))
    for _, _, mark in sorted(found):
        if _is_start(mark, bodies, is_text):
            return mark
    return b""


def _prefix_candidates(bodies: Sequence[bytes], marks: Sequence[bytes]) -> Iterator[bytes]:
    """Yield known marks, multi-byte `marks`, and marks around a byte that nearly all bodies have once."""
    yield from dict.fromkeys((*KNOWN_STARTS, *[mark for mark in marks if len(mark) > 1]))
    if len(bodies) < FEW_FRAMES:
        return
    once = Counter(byte for body in bodies for byte, number in Counter(body).items() if number == 1)
    for byte in [byte for byte, number in once.items() if number >= NEARLY_ALL * len(bodies) - 1]:
        yield _grow_start(bytes([byte]), bodies)


def _grow_start(mark: bytes, bodies: Sequence[bytes]) -> bytes:
    having = [(body, body.find(mark)) for body in bodies if body.count(mark) == 1]
    before, after = 0, len(mark)
    while after + before < LONGEST_PREFIX:
        beside = {body[at - before - 1 : at - before] if at > before else b"" for body, at in having}
        if len(beside) != 1 or b"" in beside:
            break
        before += 1
    while after + before < LONGEST_PREFIX:
        beside = {body[at + after : at + after + 1] for body, at in having}
        if len(beside) != 1 or b"" in beside:
            break
        after += 1
    body, at = having[0]
    whole = body[at - before : at + after]
    return next((known for known in KNOWN_STARTS if whole.startswith(known)), whole)


def _is_start(mark: bytes, bodies: Sequence[bytes], is_text: bool) -> bool:
    parts = [body.partition(mark) for body in bodies if body.count(mark) == 1]
    before = [noise for noise, _, _ in parts]
    first, last = _top_count([noise[:1] for noise in before]), _top_count([noise[-1:] for noise in before])
    if max(first, last) > max(2, NEARLY_ALL * (len(bodies) - 1) - 1):
        return False  # the noise is alike: it is the true begin of frames, or their true end
    straight = before.count(b"") / len(before)
    is_control = mark in KNOWN_STARTS and not set(mark) & TEXT
    if is_control and straight < LEAST_CLEAN_SHARE:
        after = b"".join([rest for _, _, rest in parts])
        return sum([byte in TEXT for byte in after]) >= LEAST_TEXT * max(1, len(after))
    if is_control:
        return True
    if is_text and set(mark) & TEXT and mark not in KNOWN_STARTS:
        return False  # a word in a line of text
    is_data = last > 2 and last >= NEARLY_ALL * (len(before) - before.count(b""))
    return straight >= LEAST_CLEAN_SHARE and not is_data


def _top_count(values: Sequence[bytes]) -> int:
    return max(Counter(filter(None, values)).values(), default=0)


def is_begin_and_end_mark(mark: bytes, stream: bytes) -> bool:
    """Return whether a mark may both begin and end frames: it sometimes occurs twice without bytes between.

    A trial then shows whether all its places are borders of frames that are not empty.
    """
    places = find_places(mark, stream)
    joined = sum([b - a == len(mark) for a, b in pairwise(places)])
    return joined >= max(LEAST_ADJACENT_MARKS, len(places) / 12) and joined <= len(places) / 2


def constant_bytes_between(clean: Sequence[LocatedFrame]) -> int:
    """If nearly all gaps between frames have the same number of bytes, return the number, else 0."""
    sizes = Counter(b.start - a.end for a, b in pairwise(clean))
    size, number = sizes.most_common(1)[0] if sizes else (0, 0)
    return size if number >= NEARLY_ALL * sizes.total() else 0


def count_noisy_frames(frames: Sequence[LocatedFrame], clean: Sequence[LocatedFrame]) -> int:
    """Return how many frames contain bytes from before the first clean frame or between clean frames."""
    starts, ends = [frame.start for frame in clean], [frame.end for frame in clean]
    if not starts:
        return 0
    noise = [(a, b) for a, b in zip([0, *ends], starts, strict=False) if a < b]
    begun = [a for a, _ in noise]
    found = 0
    for frame in frames:
        last = bisect_right(begun, frame.end - 1) - 1
        found += last >= 0 and noise[last][1] > frame.start
    return found
