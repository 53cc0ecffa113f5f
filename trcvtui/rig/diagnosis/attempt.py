"""What the last failed attempt of a connection proves, while the next one is waited for.

Rule: its code and the advice of that code come first, as if it still showed. A block that showed no code of
its own for it (another block did, or its dialect is silent) has none to tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.diagnosis.link import lost_before
from trcvtui.rig.history.records import NOT_BUILT

Rule = Callable[[Evidence], str]
# What shows while a connection is built; RUNNING of the block that builds one.
BUILDING: Final = frozenset({Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING})


def is_building(e: Evidence) -> bool:
    """Return whether this is shown while a connection is built."""
    is_run = e.condition == Condition.RUNNING and block_row(e.block).runs_as in BUILDING
    return e.condition in BUILDING or is_run


def code(e: Evidence) -> int | None:
    """Return the code of the last failed attempt, None where none is waited behind or none was shown."""
    attempt = e.facts.attempt
    return attempt.status if attempt is not None and attempt.condition and is_building(e) else None


def told(e: Evidence, rules: Callable[[Evidence], tuple[Rule, ...]], words: str) -> tuple[str, ...]:
    """Return what is told of it: `rules` are asked as in the scan that showed it, `words` are its cause."""
    attempt = e.facts.attempt
    if attempt is None or code(e) is None:
        return ()
    then = replace(e, condition=attempt.condition, cause=attempt.cause)
    asked = (rule(then) for rule in rules(then) if rule is not lost_before)
    first, *rest = [sentence for sentence in asked if sentence] or [words]
    said = f" ({attempt.said})" if attempt.said and attempt.said not in first else ""
    head = f"the last attempt ended in {attempt.status:04X} in scan {attempt.at.scan}"
    return (f"{head}: {first}{said}", *rest)


def is_repeated(sentence: str, told: tuple[str, ...]) -> bool:
    """Return whether what was told of the attempt says this, too."""
    return any(sentence in one for one in told)


def stops_it(e: Evidence) -> bool:
    """Return whether it never came to a socket: ports and partners have no part in it."""
    attempt = e.facts.attempt
    return attempt is not None and attempt.cause.call in NOT_BUILT
