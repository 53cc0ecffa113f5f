"""A connection that blocks of another priority work on: asked for again after the pause of `retry`."""

from __future__ import annotations

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.tcp.job_checks import in_use, rival_of
from trcvtui.net.connection.connection import Connection
from trcvtui.net.connection.ownership import Claim


class KeptOff:
    """What one block that wants to build a connection knows of its rivals."""

    def __init__(self, env: Environment, connection: Connection, claim: Claim) -> None:
        self.rival = ""  # the instance that was in the way at the last look; empty: nobody is
        self._env = env
        self._connection = connection
        self._claim = claim
        self._again_at = 0

    def begin(self) -> bool:
        """Look as CONT rises; return whether somebody is in the way, which the next look tells."""
        rival = rival_of(self._env, self._connection, self._claim)
        self.rival = rival.instance if rival is not None else ""
        self._again_at = self._env.now
        return rival is not None

    def look(self) -> Outcome | None:
        """Look again when it is time; return the error when somebody is in the way, else None."""
        if self._env.now < self._again_at:
            return None
        rival = rival_of(self._env, self._connection, self._claim)
        self.rival = rival.instance if rival is not None else ""
        if rival is None:
            return None
        self._again_at = self._env.now + self._env.rules.policy.retry_ns
        return Outcome(Condition.CONNECT_IN_USE, in_use(rival, self._claim))
