"""Where prefix and suffix lie in a frame, and what ended the frames so far: what readers ask of a framer."""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.blocks.framing.frame import Ending, Frame, Framing


class FrameMarks(NamedTuple):
    """A delivered frame: its bytes, how many of them are prefix and suffix, and what ended it."""

    size: int
    prefix: int
    suffix: int
    ending: Ending

    @property
    def is_good(self) -> bool:
        """Return whether it ended as it should."""
        return self.ending in (Ending.SUFFIX, Ending.SIZE)


class Tally(NamedTuple):
    """How many frames ended well, by a gap, without the suffix; how many parts were thrown away, and why."""

    good: int = 0
    gaps: int = 0
    overruns: int = 0
    parts: int = 0
    reason: str = ""

    def ended(self, ending: Ending) -> Tally:
        """Return the tally with a frame more."""
        if ending is Ending.GAP:
            return self._replace(gaps=self.gaps + 1)
        if ending is Ending.OVERRUN:
            return self._replace(overruns=self.overruns + 1)
        return self._replace(good=self.good + 1)

    def dropped(self, reason: str) -> Tally:
        """Return the tally with a part more that was thrown away."""
        return self._replace(parts=self.parts + 1, reason=reason)


NO_FRAMES = Tally()


def marks_of(frame: Frame, framing: Framing) -> FrameMarks:
    """Return where the marks of a frame lie; a frame that a gap ended may have but half a prefix."""
    size = len(frame.content)
    suffix = len(framing.suffix) if frame.ending is Ending.SUFFIX else 0
    return FrameMarks(size, min(size, len(framing.prefix)), suffix, frame.ending)
