"""CONT as the connection sees it: the pin itself, or held from a request to the end of its job (one-shot).

One-shot is what a vendor's older page describes: REQ or EN_R connects, CONT = 0 closes behind the job.
"""

from __future__ import annotations


class ContLevel:
    """CONT of one instance."""

    def __init__(self, is_one_shot: bool) -> None:
        self._is_one_shot = is_one_shot
        self._is_held = False

    def level(self, cont: bool, asks: bool, is_busy: bool) -> bool:
        """Return whether the connection is wanted; `asks`: a request waits, `is_busy`: its job runs."""
        if not self._is_one_shot:
            return cont
        self._is_held = asks or is_busy or (self._is_held and cont)
        return self._is_held
