"""CONT as the connection sees it: the pin itself, or held from a request to the end of its job (one-shot).

One-shot is what a vendor's older page describes: REQ or EN_R connects, CONT = 0 closes behind the job. An
EN_R that is still 1 behind that finds no connection, and connects again.
"""

from __future__ import annotations


class ContLevel:
    """CONT of one instance."""

    def __init__(self, is_one_shot: bool, asks_by_level: bool = False) -> None:
        self._is_one_shot = is_one_shot
        self._asks_by_level = asks_by_level  # EN_R: still 1 behind its job, it is no new request
        self._is_held = False
        self._was_busy = False

    def level(self, cont: bool, asks: bool, is_busy: bool, is_closing: bool) -> bool:
        """Return whether the connection is wanted.

        `asks`: a request waits; `is_busy`: its job runs; `is_closing`: what a close shows is not over.
        """
        if not self._is_one_shot:
            return cont
        has_ended, self._was_busy = self._was_busy and not is_busy, is_busy
        is_old = has_ended and self._asks_by_level and not cont
        asks = asks and not is_closing and not is_old
        self._is_held = asks or is_busy or (self._is_held and cont)
        return self._is_held
