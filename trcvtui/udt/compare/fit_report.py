"""The readings of `udt fit` as text and as JSON. Rule: names from a file are printed as one plain line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.compare.fit import MOST_LENGTHS, MOST_NAMED, Fit, verdict
from trcvtui.wording import count

MOST_READINGS_SHOWN: Final = 10  # in the text; JSON has all
MOST_PRINTED: Final = 12


def fit_json(fits: Sequence[Fit], lengths: Sequence[int]) -> list[dict[str, object]]:
    """Return the rows of `udt fit --format json`, the best first.

    The first row also has the verdict and the lengths of the last messages.
    """
    rows: list[dict[str, object]] = [
        {
            "rank": found.rank,
            "layout": found.profile.layout,
            "byte_order": found.profile.byte_order,
            "text": found.profile.text or None,
            "cause": found.cause.kind,
            "n": found.cause.n,
            "member": found.cause.member or None,
            "points": found.score,
            "fits_best": found.fits_best,
            "reasons": list(reason_lines(found)),
            "doubt": found.doubt or None,
            "same": list(found.same),
        }
        for found in fits
    ]
    if rows:
        rows[0] |= {"verdict": verdict(fits), "lengths": list(lengths[-MOST_LENGTHS:])}
    return rows


def fit_text(fits: Sequence[Fit], title: str) -> str:
    """Return the verdict, the first readings and the best reading's reasons. `title` names the bytes."""
    lines = [one_line(f"{title}: {verdict(fits)}")]
    rows = [
        found
        for found, before in zip(fits, (None, *fits), strict=False)
        if found.rank != (before and before.rank)
    ]
    for found in rows[:MOST_READINGS_SHOWN]:
        lines.append(f"{found.rank:>2} {found.score:+8.1f}  {reading_title(found)}")
        if found is fits[0]:
            reasons = list(reason_lines(found))
            lines += [f"             {line}" for line in reasons[:MOST_PRINTED]]
            if len(reasons) > MOST_PRINTED:
                lines.append(f"             and {len(reasons) - MOST_PRINTED} more reasons (--format json)")
        elif found.same:
            lines.append(f"             reads the same values as {same_readings_text(found)}")
    if len(rows) > MOST_READINGS_SHOWN:
        lines.append(f"and {len(rows) - MOST_READINGS_SHOWN} more readings (--format json)")
    return "\n".join(lines)


def reading_title(found: Fit) -> str:
    """Return the first profile, the cause if there is one, and the number of equal profiles."""
    more = len(found.profiles) - 1
    return found.name + (f" (and {count(more, 'equal profile')})" if more else "")


def reason_lines(found: Fit) -> Iterator[str]:
    """Yield the reasons for and against a reading: doubt, equal readings and profiles, then points."""
    if found.doubt:
        yield one_line(f"not sure: {found.doubt}")
    if found.same:
        yield f"reads the same values as {same_readings_text(found)}"
    if len(found.profiles) > 1:
        yield "the same for these bytes: " + "; ".join(str(profile) for profile in found.profiles[1:])
    if found.profile.text:
        yield f"STRING as {found.profile.text}"
    yield f"{found.members:+.1f} for all members together"
    yield from (one_line(f"{reason.points:+.1f} {reason.text}") for reason in found.reasons)


def same_readings_text(found: Fit) -> str:
    """Return the other readings with the same values at the same places."""
    more = len(found.same) - MOST_NAMED
    return "; ".join(found.same[:MOST_NAMED]) + (f"; and {more} more" if more > 0 else "")
