"""The waves of the instances that the screen has looked at, the newest few."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from trcvtui.rig.history.wave import Wave
    from trcvtui.rig.history.waveform_delta import WaveNews

MOST_WAVES: Final = 16  # instances that the screen remembers


class WaveShelf:
    """The waves of the instances that were looked at, the newest few."""

    def __init__(self) -> None:
        self._waves: dict[str, Wave] = {}
        self._too_late: set[str] = set()  # of what was asked for up to a scan: nothing is left of that time

    def of(self, instance: str) -> Wave:
        """Return the wave of an instance."""
        from trcvtui.rig.history.wave import (
            Wave,  # read with the first scan: the first frame does not wait for it
        )

        wave = self._waves.pop(instance, None) or Wave(instance)
        self._waves[instance] = wave
        if len(self._waves) > MOST_WAVES:
            del self._waves[next(iter(self._waves))]
        return wave

    def asked(self, instances: Iterable[str], scan: int | None = None) -> tuple[tuple[str, int], ...]:
        """Return what to ask the engine for: each instance with the last change that is known.

        With `scan` nothing behind it is wanted.
        """
        known = self._waves
        wanted = instances if scan is None else [name for name in instances if self._lacks(name, scan)]
        return tuple((name, known[name].number if name in known else 0) for name in wanted)

    def _lacks(self, name: str, scan: int) -> bool:
        wave = self._waves.get(name)
        return name not in self._too_late and (wave is None or wave.until_scan < scan)

    def take(self, news: Iterable[WaveNews], interval_ns: int) -> None:
        """Append what is new."""
        self._too_late.clear()
        for fresh in news:
            self.of(fresh.instance).take(fresh, interval_ns)

    def take_up_to(self, news: Iterable[WaveNews], interval_ns: int, scan: int, t_ns: int) -> None:
        """Append what is new and not behind a scan."""
        from trcvtui.rig.history.waveform_delta import up_to

        for fresh in news:
            then = up_to(fresh, scan, t_ns)
            if then is None:
                self._too_late.add(fresh.instance)
            else:
                self.of(fresh.instance).take(then, interval_ns)

    def is_too_late(self, instance: str) -> bool:
        """Return whether an instance's wave was asked for when that time was no longer kept."""
        return instance in self._too_late
