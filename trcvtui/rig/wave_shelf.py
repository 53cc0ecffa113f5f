"""The waves of the instances that the screen has looked at, the newest few."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from trcvtui.rig.wave import Wave
    from trcvtui.rig.wave_news import WaveNews

MOST_WAVES: Final = 16  # instances that the screen remembers


class WaveShelf:
    """The waves of the instances that were looked at, the newest few."""

    def __init__(self) -> None:
        self._waves: dict[str, Wave] = {}

    def of(self, instance: str) -> Wave:
        """Return the wave of an instance."""
        from trcvtui.rig.wave import Wave  # read with the first scan: the first frame does not wait for it

        wave = self._waves.pop(instance, None) or Wave(instance)
        self._waves[instance] = wave
        if len(self._waves) > MOST_WAVES:
            del self._waves[next(iter(self._waves))]
        return wave

    def asked(self, instances: Iterable[str]) -> tuple[tuple[str, int], ...]:
        """Return what to ask the engine for: each instance with the last change that is known."""
        known = self._waves
        return tuple((name, known[name].number if name in known else 0) for name in instances)

    def take(self, news: Iterable[WaveNews], interval_ns: int) -> None:
        """Append what is new."""
        for fresh in news:
            self.of(fresh.instance).take(fresh, interval_ns)
