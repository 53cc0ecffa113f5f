"""Noise between frames: the prefix that tells behind it where a frame begins, and which frames contain it.

Rule: a frame that begins with noise counts against the suffix alone. A mark that stands once in nearly every
frame is the prefix when what precedes it is no data: it comes and goes, or there is a control byte in a text.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from trcvtui.rig.framing_advice.marks import places_of
from trcvtui.rig.framing_advice.trial import Placed
from trcvtui.rig.framing_advice.weight import KNOWN_STARTS, TEXT

NEARLY_ALL: Final = 0.9
FEW: Final = 5  # frames: so few have a byte in common by chance
LEAST_STRAIGHT: Final = 0.25  # of the frames begin with a prefix that is not known as one
LEAST_TEXT: Final = 0.9  # of the bytes behind a control byte that always has noise before it
LEAST_JOINED: Final = 3
LONGEST_PREFIX: Final = 8
MOST_LOOKED_AT: Final = 40  # frames


def start_behind_noise(
    good: Sequence[Placed], suffix: bytes, marks: Sequence[bytes], *, is_text: bool
) -> bytes:
    """Return the prefix of frames that were cut by their suffix alone, b"" where no noise is before any."""
    bodies = [frame.content[: len(frame.content) - len(suffix)] for frame in good[:MOST_LOOKED_AT]]
    bodies = [body for body in bodies if body]
    found = []
    for mark in _candidates(bodies, marks):
        places = [body.find(mark) for body in bodies if body.count(mark) == 1]
        if len(bodies) - len(places) <= max(1, len(bodies) // 10) and any(places):
            found.append((sum(places), -len(mark), mark))
    for _, _, mark in sorted(found):
        if _is_start(mark, bodies, is_text):
            return mark
    return b""


def _candidates(bodies: Sequence[bytes], marks: Sequence[bytes]) -> Iterator[bytes]:
    """Yield what may stand once in each: marks, and bytes with what is beside them each time."""
    yield from dict.fromkeys((*KNOWN_STARTS, *[mark for mark in marks if len(mark) > 1]))
    if len(bodies) < FEW:
        return
    once = Counter(byte for body in bodies for byte, number in Counter(body).items() if number == 1)
    for byte in [byte for byte, number in once.items() if number >= NEARLY_ALL * len(bodies) - 1]:
        yield _grown(bytes([byte]), bodies)


def _grown(mark: bytes, bodies: Sequence[bytes]) -> bytes:
    """Return a mark with all that stands beside it in each; a known one as it is."""
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
    """Return whether what precedes a mark is noise, not data."""
    parts = [body.partition(mark) for body in bodies if body.count(mark) == 1]
    before = [noise for noise, _, _ in parts]
    first, last = _commonest([noise[:1] for noise in before]), _commonest([noise[-1:] for noise in before])
    if max(first, last) > max(2, NEARLY_ALL * (len(bodies) - 1) - 1):
        return False  # that is where the frames begin, or where they really end
    straight = before.count(b"") / len(before)
    is_control = mark in KNOWN_STARTS and not set(mark) & TEXT
    if is_control and straight < LEAST_STRAIGHT:
        behind = b"".join([rest for _, _, rest in parts])
        return sum([byte in TEXT for byte in behind]) >= LEAST_TEXT * max(1, len(behind))
    if is_control:
        return True
    if is_text and set(mark) & TEXT and mark not in KNOWN_STARTS:
        return False  # words stand in lines
    is_data = last > 2 and last >= NEARLY_ALL * (len(before) - before.count(b""))
    return straight >= LEAST_STRAIGHT and not is_data


def _commonest(values: Sequence[bytes]) -> int:
    """Return how often the most frequent one is there; empty ones do not count."""
    return max(Counter(filter(None, values)).values(), default=0)


def stands_twice(mark: bytes, stream: bytes) -> bool:
    """Return whether a mark may both begin and end frames: some follow another at once, where no noise is.

    That all these then are at the borders of frames, and none is an empty frame, is what the trial tells.
    """
    places = places_of(mark, stream)
    joined = sum([b - a == len(mark) for a, b in pairwise(places)])
    return joined >= max(LEAST_JOINED, len(places) / 12) and joined <= len(places) / 2


def always_between(clean: Sequence[Placed]) -> int:
    """Return how many bytes stand between nearly all frames; 0: none, or now these, now those."""
    sizes = Counter(b.start - a.end for a, b in pairwise(clean))
    size, number = sizes.most_common(1)[0] if sizes else (0, 0)
    return size if number >= NEARLY_ALL * sizes.total() else 0


def with_noise(frames: Sequence[Placed], clean: Sequence[Placed]) -> int:
    """Return how many frames have bytes in them that lie between two clean ones, or before the first."""
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
