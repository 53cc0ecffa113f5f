"""Proposals for cutting recorded bytes into frames. The real framer tries each proposal. Work is bounded.

`advise_framings` takes about 10 ms, or 50 ms and more for long recordings.
Screens let a separate process make the proposals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

from msgspec import structs

from trcvtui.blocks.framing import Framing
from trcvtui.blocks.serial.com_buffer import LineRecording
from trcvtui.diagnosis.readings.marks import (
    FEW_FRAMES,
    LONGEST_FRAME,
    USUAL_WIDTHS,
    Bursts,
    common_prefix,
    count_noisy_frames,
    find_bursts,
    find_frame_sizes,
    find_length_fields,
    find_marks,
    find_places,
    is_alternating,
    is_begin_and_end_mark,
    prefix_after_noise,
    rank_mark_splits,
)
from trcvtui.diagnosis.readings.proposal import (
    CutKind,
    FramingAdvice,
    Proposal,
    describe_workaround,
    list_doubts,
    list_evidence,
    make_preview,
    make_title,
)
from trcvtui.diagnosis.readings.trial import (
    KNOWN_ENDS,
    KNOWN_STARTS,
    TEXT,
    Cut,
    LengthField,
    LocatedFrame,
    Scale,
    cut,
    cut_by_length,
    is_word_in_lines,
    join_chunks,
    make_bit_scale,
    saved_bits,
)
from trcvtui.wording import count

MILLISECOND: Final = 1_000_000
TRIAL_WINDOWS: Final = (4096, 16_384)  # bytes that are tried: the second if the first has too few frames
ENOUGH_FRAMES: Final = 12
LEAST_BYTES: Final = 8
LEAST_FRAMES: Final = 3
LEAST_BITS: Final = 16.0  # saved by a proposal: less may be chance
LEAST_SHARE: Final = 0.2  # of the weight of the best proposal
LEAST_SHARE_OF_FRAMES: Final = 0.8
LEAST_EXPLAINED: Final = 0.5
MOST_GUESSES: Final = 48
MOST_PROPOSALS: Final = 6
MOST_FRAMES: Final = 200  # in the evidence
MOST_TRIED: Final = 100  # of one trial
MOST_SUFFIXES: Final = 8  # that are examined for a prefix after noise
MOST_HEADS: Final = 6  # of long suffixes, likewise
GAP_BITS: Final = 3.0  # of a clear pause on a serial line; on TCP half of it
MARK_KINDS: Final = (CutKind.PREFIX_SUFFIX, CutKind.SUFFIX, CutKind.PREFIX)


@dataclass(frozen=True, slots=True)
class Guess:
    kind: CutKind
    framing: Framing
    field: LengthField | None = None


@dataclass(frozen=True, slots=True)
class FramingTrial:
    guess: Guess
    cut: Cut
    bits: float


def advise_framings(recording: LineRecording) -> FramingAdvice:
    """Return the proposals for cutting a recording into frames, the best first."""
    total = recording.size
    if total < LEAST_BYTES:
        return FramingAdvice((), f"{count(total, 'byte')} recorded: too few to judge")
    recording = _skip_to_pause(recording)
    best: list[FramingTrial] = []
    for most in TRIAL_WINDOWS:
        window = recording.first_part(most)
        best = _try_guesses(window)
        if (best and len(best[0].cut.good) >= ENOUGH_FRAMES) or window.size == recording.size:
            break
    if not best:
        said = f"nothing fits: in {count(total, 'byte')} no mark, length, size or pause separates frames"
        return FramingAdvice((), said)
    proposals, ranks, clean = [], _ranks(best), None
    plain = join_chunks(recording)
    for rank, each in zip(ranks, best, strict=True):
        whole = _cut_recording(recording, plain, each.guess, MOST_FRAMES)
        clean = clean or (each.guess, whole)
        proposals.append(_proposal(rank, each, whole, recording, clean))
    return FramingAdvice(tuple(proposals), _describe_recording(recording, total))


def _describe_recording(recording: LineRecording, total: int) -> str:
    names = {"tcp": "a TCP stream", "serial": "a serial line", "sim": "a simulated line", "cable": "a cable"}
    where = names.get(recording.source, recording.source)
    return f"{count(total, 'byte')} in {count(len(recording.chunks), 'chunk')} of {where}"


def _skip_to_pause(recording: LineRecording) -> LineRecording:
    if not recording.chunks or recording.chunks[0].begins:
        return recording
    bursts = find_bursts(recording)
    if not bursts.is_clear or not bursts.pauses:
        return recording
    at = 0
    for number, chunk in enumerate(recording.chunks):
        if at == bursts.pauses[0]:
            return replace(recording, chunks=recording.chunks[number:])
        at += len(chunk.payload)
    return recording


# -- the guesses --------------------------------------------------------------------------------------------


def _try_guesses(recording: LineRecording) -> list[FramingTrial]:
    stream = b"".join([chunk.payload for chunk in recording.chunks])
    bursts = find_bursts(recording)
    scale = make_bit_scale(stream, bursts.pauses, bursts.starts)
    found: dict[tuple[object, ...], FramingTrial] = {}
    starts: list[FramingTrial] = []
    plain, marks = join_chunks(recording), find_marks(stream[: TRIAL_WINDOWS[0]])
    for guess in islice(dict.fromkeys(_guesses(recording, stream, bursts, marks)), MOST_GUESSES):
        tried = _try_guess(recording, plain, guess, scale)
        if tried is not None:
            starts.append(tried)
    after = _try_after_noise(recording, plain, starts, marks, scale)
    starts = [each for each in starts if each.bits >= LEAST_BITS]
    for guess in dict.fromkeys(_guess_prefixes(starts)):
        tried = _try_guess(recording, plain, guess, scale)
        if tried is not None and tried.bits >= LEAST_BITS:
            starts.append(tried)
    starts = [*after, *[each for each in starts if each.guess not in {one.guess for one in after}]]
    starts.sort(key=_preference)
    for tried in starts:
        found.setdefault((tried.guess.kind, tried.cut.places), tried)
    return _rank_trials(list(found.values()))


def _guesses(
    recording: LineRecording, stream: bytes, bursts: Bursts, marks: Sequence[bytes]
) -> Iterator[Guess]:
    size = LONGEST_FRAME
    for mark in (*[known for known in KNOWN_ENDS if stream.count(known) >= LEAST_FRAMES - 1], *marks):
        for place in rank_mark_splits(mark, stream, bursts.pauses)[:3] if len(mark) > 1 else (1,):
            prefix, suffix = mark[place:], mark[:place]
            if suffix:
                kind = CutKind.PREFIX_SUFFIX if prefix else CutKind.SUFFIX
                yield Guess(kind, Framing(size, prefix, suffix))
    for fixed in find_frame_sizes(stream, bursts, marks):
        yield Guess(CutKind.SIZE, Framing(fixed))
        for mark in marks:
            prefix = mark[rank_mark_splits(mark, stream, bursts.pauses)[0] :] or mark
            yield Guess(CutKind.PREFIX, Framing(fixed, prefix[:fixed]))
    for field in find_length_fields(stream, bursts):
        yield Guess(CutKind.LENGTH, Framing(field.head_size), field)
    if bursts.is_clear:
        middle = min((bursts.within + bursts.between) // 2, bursts.between - recording.tick_ns)
        timeout = max(1, middle // MILLISECOND) * MILLISECOND
        yield Guess(CutKind.GAP, Framing(size, timeout_ns=timeout))
    places = {mark: find_places(mark, stream[: TRIAL_WINDOWS[0]]) for mark in marks}
    for start in marks:
        for end in marks:
            if start != end and is_alternating(places[start], places[end]):
                yield Guess(CutKind.PREFIX_SUFFIX, Framing(size, start, end))


def _guess_prefixes(tried: Sequence[FramingTrial]) -> Iterator[Guess]:
    for each in _rank_trials(list(tried)):
        guess = each.guess
        if guess.kind not in (CutKind.SUFFIX, CutKind.SIZE, CutKind.GAP):
            continue
        room = guess.framing.size - 1 if guess.kind is CutKind.SIZE else LONGEST_FRAME
        contents = [
            frame.content[: len(frame.content) - len(guess.framing.suffix)] for frame in each.cut.good
        ]
        start = common_prefix(contents[1:])[: min(room, 8)]
        kind = CutKind.PREFIX_SUFFIX if guess.kind is CutKind.SUFFIX else CutKind.PREFIX
        for prefix in dict.fromkeys((_known_start(start), start)):
            if prefix:
                yield replace(guess, kind=kind, framing=structs.replace(guess.framing, prefix=prefix))


def _try_after_noise(
    recording: LineRecording,
    plain: LineRecording,
    tried: Sequence[FramingTrial],
    marks: Sequence[bytes],
    scale: Scale,
) -> list[FramingTrial]:
    found: list[FramingTrial] = []
    stream = b"".join([chunk.payload for chunk in plain.chunks])
    ends = sorted([each for each in tried if each.guess.kind is CutKind.SUFFIX], key=lambda each: -each.bits)
    known = {each.guess for each in ends}
    shorter = [guess for guess in dict.fromkeys(_shorten_suffixes(ends)) if guess not in known][:MOST_HEADS]
    more = [_try_guess(recording, plain, guess, scale) for guess in shorter]
    for each in (*ends[:MOST_SUFFIXES], *filter(None, more)):
        suffix = each.guess.framing.suffix
        is_both = is_begin_and_end_mark(suffix, stream)
        prefix = (
            suffix if is_both else prefix_after_noise(each.cut.good, suffix, marks, is_text=scale.is_text)
        )
        guess = Guess(CutKind.PREFIX_SUFFIX, Framing(LONGEST_FRAME, prefix, suffix))
        made = _try_guess(recording, plain, guess, scale, is_noise=True) if prefix else None
        if made is None or (is_both and not _is_flag_framing(made.cut, suffix)):
            continue
        bits = max(made.bits, each.bits) + 1
        if bits >= LEAST_BITS:
            found.append(replace(made, bits=bits))
    return found


def _shorten_suffixes(ends: Sequence[FramingTrial]) -> Iterator[Guess]:
    for each in ends[:3]:
        suffix = each.guess.framing.suffix
        for size in range(1, min(len(suffix), 5)):
            yield Guess(CutKind.SUFFIX, Framing(LONGEST_FRAME, b"", suffix[:size]))


def _is_flag_framing(made: Cut, flag: bytes) -> bool:
    return 3 * made.noise <= made.total and all(len(frame.content) > 2 * len(flag) for frame in made.good)


def _known_start(start: bytes) -> bytes:
    """Return the known mark that the bytes begin with, or b"" if there is none."""
    return next((known for known in KNOWN_STARTS if start.startswith(known)), b"")


def _cut_recording(recording: LineRecording, plain: LineRecording, guess: Guess, most: int = 0) -> Cut:
    """Cut a recording. A framing without a timeout cuts `plain`, the same recording without times."""
    if guess.field is not None:
        return cut_by_length(plain, guess.field, LONGEST_FRAME, most)
    return cut(recording if guess.framing.timeout_ns else plain, guess.framing, most)


def _try_guess(
    recording: LineRecording, plain: LineRecording, guess: Guess, scale: Scale, *, is_noise: bool = False
) -> FramingTrial | None:
    """Try a guess. With `is_noise`, other evidence shows the noise before a prefix, so it costs no bits."""
    made = _cut_recording(recording, plain, guess, MOST_TRIED)
    good = made.good
    explained = sum([len(frame.content) for frame in good])
    if len(good) < LEAST_FRAMES or explained < LEAST_EXPLAINED * made.total:
        return None
    framing = guess.framing
    if is_word_in_lines(good, scale, framing.suffix):
        return None
    if framing.timeout_ns:
        scale = replace(scale, pauses=frozenset())  # it cuts by the pauses: they are no evidence for it
    weighed = replace(made, noise_runs=0, total=made.total - made.noise) if is_noise else made
    bits = saved_bits(weighed, scale, framing.prefix, framing.suffix, told_lengths=guess.field is not None)
    if framing.timeout_ns:
        each = GAP_BITS / 2 if recording.source == "tcp" else GAP_BITS
        are_alike = len({len(frame.content) for frame in good}) == 1
        bits = max(bits, 0.0) + each * min(len(good), 15) / (1.5 if are_alike else 1)
    return FramingTrial(guess, made, bits)


# -- ranks ---------------------------------------------------------------------------------------------------


def _group_key(tried: FramingTrial) -> tuple[object, ...]:
    is_marked = tried.guess.kind in MARK_KINDS and not tried.guess.framing.timeout_ns
    return (is_marked or tried.guess, tried.cut.places)


def _rank_trials(tried: list[FramingTrial]) -> list[FramingTrial]:
    tried = [each for each in tried if not _is_chance(each, tried)]
    weights: dict[tuple[object, ...], float] = {}
    for each in tried:
        weights[_group_key(each)] = max(weights.get(_group_key(each), 0.0), each.bits)
    best = max(weights.values(), default=0.0)
    kept = [each for each in tried if weights[_group_key(each)] >= LEAST_SHARE * best]
    kept.sort(key=lambda each: (-weights[_group_key(each)], str(_group_key(each)[0]), _preference(each)))
    proposals: list[FramingTrial] = []
    for each in kept:
        if not any(_is_variant_of(each, other) for other in proposals):
            proposals.append(each)
    return proposals[:MOST_PROPOSALS]


def _is_variant_of(tried: FramingTrial, better: FramingTrial) -> bool:
    ours, theirs = tried.cut.places, better.cut.places
    if ours == theirs:
        return False
    starts, known = {start for start, _ in ours}, {start for start, _ in theirs}
    both = len(starts & known)
    is_coarser = len(ours) < LEAST_SHARE_OF_FRAMES * len(theirs) and both >= 0.9 * len(ours)
    is_shifted = 2 * both < len(ours) and abs(len(ours) - len(theirs)) <= 1 + len(theirs) // 8
    return is_coarser or is_shifted


def _is_chance(tried: FramingTrial, others: Sequence[FramingTrial]) -> bool:
    """Return whether a suffix is only a better trial's suffix, after bytes that are there by chance."""
    suffix, frames = tried.guess.framing.suffix, len(tried.cut.good)
    return frames < FEW_FRAMES and any(
        other.guess.framing.suffix != suffix
        and suffix.endswith(other.guess.framing.suffix or b"-")
        and len(other.cut.good) >= FEW_FRAMES * frames
        for other in others
        if other.guess.kind is CutKind.SUFFIX
    )


def _ranks(tried: Sequence[FramingTrial]) -> list[int]:
    groups = list(dict.fromkeys(_group_key(each) for each in tried))
    return [groups.index(_group_key(each)) + 1 for each in tried]


def _preference(tried: FramingTrial) -> tuple[int, int, int, int]:
    kind, framing = tried.guess.kind, tried.guess.framing
    order = list(CutKind).index(kind) + 3
    width = USUAL_WIDTHS.index(tried.guess.field.width) if tried.guess.field else 0
    if kind is CutKind.PREFIX_SUFFIX:
        is_both = framing.prefix == framing.suffix
        is_mark = is_both or framing.prefix in KNOWN_STARTS or not set(framing.prefix) & TEXT
        order = 0 if is_mark else 2
    elif kind is CutKind.SUFFIX:
        order = 1
    return order, width, -len(framing.suffix), -len(framing.prefix)


def _proposal(
    rank: int, tried: FramingTrial, made: Cut, recording: LineRecording, best: tuple[Guess, Cut]
) -> Proposal:
    guess, good = tried.guess, made.good
    longest = max(len(frame.content) for frame in good)
    framing = guess.framing
    if guess.kind is not CutKind.SIZE and framing.size == LONGEST_FRAME:
        framing = structs.replace(framing, size=longest)
    return Proposal(
        rank=rank,
        kind=guess.kind,
        title=make_title(guess.kind, framing, guess.field),
        framing=framing if guess.field is None else None,
        field=guess.field,
        evidence=list_evidence(guess.kind, framing, guess.field, made, recording),
        doubt=(*list_doubts(guess.kind, framing, made, recording), *_describe_noise_doubt(good, *best)),
        instead=describe_workaround(guess.field),
        frames=len(good),
        of_frames=len(made.frames),
        explained=sum([len(frame.content) for frame in good]),
        total=made.total,
        noise=made.noise,
        left=made.left,
        broken=made.broken,
        longest=longest,
        preview=make_preview(made.frames),
    )


def _describe_noise_doubt(good: Sequence[LocatedFrame], best: Guess, clean: Cut) -> tuple[str, ...]:
    number = count_noisy_frames(good, clean.good) if best.kind is CutKind.PREFIX_SUFFIX and clean.noise else 0
    if not number:
        return ()
    left_out = make_title(best.kind, best.framing, None)
    return (f"{number} of {count(len(good), 'frame')} have noise in them, which {left_out} leaves out",)
