"""All lines of all sites with their states, as a reader knows them. The worst lines come first.

Rule 1: a name beyond MOST_NAMES is refused with one message. The known names stay.
Rule 2: all times are by our clock. The live messages of an agent show the error of its clock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, TypeVar

from msgspec.structs import replace

from trcvtui.errors import mistake
from trcvtui.fleet.event_log import EventLog, KeptEvent
from trcvtui.fleet.topics import (
    AnyMessage,
    EventMessage,
    FiguresMessage,
    RecentMessage,
    StateMessage,
    StatusMessage,
    Topic,
)

K = TypeVar("K")
V = TypeVar("V")

MOST_NAMES: Final = 30_000  # of agents, lines and instances together
HOUR_S: Final = 3600
HOUR_BUCKETS: Final = 12  # columns of the sparkline
BUCKET_S: Final = HOUR_S // HOUR_BUCKETS
UP_STATES: Final = frozenset(("connected", "created", "up"))  # states of a line that works
STUCK_S: Final = 10  # a job with some of its bytes that got no more for so long
CLOCK_TOLERANCE_S: Final = 2.0  # a smaller error of a clock is ignored
CLOCK_BUCKET_S: Final = 300  # the least delay in this bucket and the one before gives the error of a clock
MOST_DELAY_S: Final = 3e8  # about 10 years: a message with a larger error of time gets our time
# The state of a line, the worst first. HAD: good, with ERRORs in the last hour.
OFFLINE, STALE, ERROR, FINDING, STUCK, AWAY, HAD, GOOD = range(8)
STATES: Final = ("offline", "no scan", "ERROR", "finding", "stuck", "not connected", "good", "good")


CAUSE_TEXTS: Final = {
    STALE: "the agent's engine does not scan",
    STUCK: "a job has some of its bytes and gets no more",
    AWAY: "the line is not connected",
}


class FleetInstance:
    def __init__(self, name: str) -> None:
        self.name, self.log = name, EventLog()
        self.status: StatusMessage | None = None
        self.found_at = 0.0  # the first message with its present finding, by the agent's clock


class FleetAgent:
    def __init__(self, site: str, name: str) -> None:
        self.site, self.name = site, name
        self.state: StateMessage | None = None
        self.since = 0.0  # begin of its state; of a retained last will: when the agent left the will
        self.lines: dict[str, FleetLine] = {}
        self.without_lines = FleetLine(self, "")  # its row until its first line has come
        self.has_begun = False  # all its retained events have come
        self.is_heard = True  # its state has come on this connection
        self._delays: deque[tuple[int, float]] = deque(maxlen=2)  # by bucket the least of our time minus its

    def note_delay(self, t: float, wall: float) -> None:
        """Note that a live message has come at `wall`. The agent sent it at `t` by its own clock."""
        bucket, delay = int(wall // CLOCK_BUCKET_S), wall - t
        while self._delays and not bucket - 1 <= self._delays[0][0] <= bucket:
            self._delays.popleft()
        if self._delays and self._delays[-1][0] == bucket:
            delay = min(delay, self._delays.pop()[1])
        if abs(delay) < MOST_DELAY_S:
            self._delays.append((bucket, delay))

    @property
    def skew_s(self) -> float:
        """Return how far the agent's clock is behind ours; below 0: it is ahead."""
        skew = min((delay for _, delay in self._delays), default=0.0)  # the network only adds to it
        return skew if abs(skew) > CLOCK_TOLERANCE_S else 0.0

    def to_our_time(self, t: float, wall: float) -> float:
        """Convert a time of the agent's clock to ours, never in the future."""
        return min(t + self.skew_s, wall)

    @property
    def is_offline(self) -> bool:
        return self.state is not None and self.state.state == "offline"

    def count_from_one(self) -> None:
        """Note that all retained events have come: from now on missing events are counted."""
        self.has_begun = True
        for line in self.lines.values():
            for instance in line.instances.values():
                instance.log.count_from_one()


class FleetLine:
    """One line. If lines are sorted by `rank`, the worst line is first."""

    def __init__(self, agent: FleetAgent, name: str) -> None:
        self.agent, self.name = agent, name
        self.figures: FiguresMessage | None = None
        self.instances: dict[str, FleetInstance] = {}
        self.errors: dict[int, int] = {}  # of the last hour, by the number of the bucket since 1970
        self.newest_error: KeptEvent | None = None  # of any instance
        self.errors_hour = 0  # of the last hour, at the last `judge`
        self.shows = GOOD
        self.rank: tuple[object, ...] = ()

    @property
    def worst_instance(self) -> FleetInstance | None:
        """Return the worst instance: an ERROR is worst, then a finding, an unfinished job, most errors."""
        return max(self.instances.values(), key=_badness, default=None)

    @property
    def cause(self) -> str:
        """Return the cause of the line's state; lines can be grouped by it."""
        if self.shows == OFFLINE:
            return "the agent is offline"
        if not self.name and self.shows == AWAY:
            return "the agent has sent no line"
        newest, worst = self.newest_error, self.worst_instance
        if self.shows == FINDING and worst is not None and worst.status is not None:
            return worst.status.finding
        if self.shows == ERROR or (self.errors and self.shows > AWAY):
            return newest.title if newest is not None else "an ERROR without a cause"
        return CAUSE_TEXTS.get(self.shows, "no error in the last hour")

    @property
    def missing(self) -> int:
        return sum(each.log.missing for each in self.instances.values())

    @property
    def lacks_messages(self) -> bool:
        """Return whether messages are missing that the broker should have retained for this line."""
        has_status = any(each.status is not None for each in self.instances.values())
        return self.figures is None or not has_status or self.missing > 0

    def shown_since(self, wall: float) -> float | None:
        """Return when the line's state began, in seconds of UTC since 1970, by our clock; None: unknown."""
        worst = self.worst_instance
        status = worst.status if worst is not None else None
        times = [self.agent.to_our_time(each.t, wall) for each in (self.figures, status) if each is not None]
        if self.shows in (OFFLINE, STALE):
            return min(max([self.agent.since, *times]), wall)
        if status is None or worst is None:
            return None
        if self.shows == FINDING:
            return self.agent.to_our_time(worst.found_at, wall)
        age = 0.0 if self.shows == STUCK else status.age_s
        return self.agent.to_our_time(status.t, wall) - max(0.0, age)

    def stuck_s(self, instance: FleetInstance, wall: float) -> float:
        """Return for how many seconds a partly received job has got no more bytes; 0.0: no such job."""
        status = instance.status
        if status is None or not 0 < status.here < status.wanted:
            return 0.0
        return wall - self.agent.to_our_time(status.t, wall)

    def errors_an_hour(self, wall: float) -> int:
        """Return the ERRORs of the last hour, as received or as the agent counted, whichever is more."""
        oldest = int(wall // BUCKET_S) - HOUR_BUCKETS
        for bucket in [each for each in self.errors if each <= oldest]:
            del self.errors[bucket]
        figures = self.figures
        is_new = figures is not None and self.agent.to_our_time(figures.t, wall) > wall - HOUR_S
        counted = figures.errors_an_hour if figures is not None and is_new else 0
        return max(sum(self.errors.values()), int(counted))

    def sparkline(self, wall: float) -> list[int]:
        """Return the number of ERRORs in each twelfth of the last hour, the oldest first."""
        newest = int(wall // BUCKET_S)
        return [self.errors.get(bucket, 0) for bucket in range(newest - HOUR_BUCKETS + 1, newest + 1)]

    def judge(self, wall: float) -> None:
        """Set the state and the rank of the line."""
        self.errors_hour = self.errors_an_hour(wall)
        self.shows = self._judge_state(wall)
        is_of_agent = self.shows in (OFFLINE, STALE)  # the lines of an agent stay together, sorted by name
        since = self.agent.since if is_of_agent else self.shown_since(wall) if self.shows < HAD else None
        names = self.agent.site, self.agent.name, self.name
        self.rank = (self.shows, wall if since is None else since, -self.errors_hour, *names)

    def _judge_state(self, wall: float) -> int:
        shown = [each.status for each in self.instances.values() if each.status is not None]
        if self.agent.is_offline:
            return OFFLINE
        if self.agent.state is not None and self.agent.state.state == "stale":
            return STALE
        if any(status.error for status in shown):
            return ERROR
        if any(status.finding for status in shown):
            return FINDING
        if any(self.stuck_s(each, wall) >= STUCK_S for each in self.instances.values()):
            return STUCK
        # Without a name: an agent that has sent no line yet.
        if not self.name or (self.figures is not None and self.figures.state not in UP_STATES):
            return AWAY
        return HAD if self.errors_hour else GOOD

    @property
    def filter_text(self) -> str:
        """Return the text that a filter searches, in small letters."""
        state = self.figures.state if self.figures is not None else ""
        last = self.newest_error.title if self.newest_error is not None and self.errors_hour else ""
        names = f"{self.agent.site}/{self.agent.name}/{self.name}"
        codes = [each.status.status for each in self.instances.values() if each.status is not None]
        found = [each.status.finding for each in self.instances.values() if each.status is not None]
        return " ".join((names, STATES[self.shows], state, last, *self.instances, *codes, *found)).casefold()


def _badness(instance: FleetInstance) -> tuple[bool, bool, bool, int]:
    status = instance.status
    if status is None:
        return False, False, False, -1
    return status.error, bool(status.finding), 0 < status.here < status.wanted, status.errors


class FleetModel:
    """All agents. `apply` adds a message. `sort_lines` returns the lines."""

    def __init__(self) -> None:
        self.agents: dict[tuple[str, str], FleetAgent] = {}
        self.names = 0  # of agents, lines and instances
        self.version = 0  # counts changes

    # -- messages ----------------------------------------------------------------------------------------

    def apply(self, topic: Topic, message: AnyMessage | None, wall: float, is_retained: bool = False) -> None:
        """Add a message of a topic, None: the topic was cleared; raise UserError for too many names."""
        self.version += 1
        if message is None:
            self._forget(topic)
            return
        site, name, on = topic.site, topic.agent, topic.line
        agent = self._get_or_make(self.agents, topic[:2], "agent", name, lambda: FleetAgent(site, name))
        # An agent leaves its last will when it connects: the time in it is not that of the loss.
        is_will = isinstance(message, StateMessage) and message.state == "offline"
        if not is_retained and isinstance(message, FiguresMessage | RecentMessage):
            agent.note_delay(message.t, wall)
        if abs(wall - message.t) > MOST_DELAY_S:  # a hostile or unset clock
            message = replace(message, t=wall)
        if isinstance(message, StateMessage):
            agent.state, agent.is_heard = message, True
            agent.since = wall if is_will and not is_retained else agent.to_our_time(message.t, wall)
            return
        line = self._get_or_make(agent.lines, on, "line", on, lambda: FleetLine(agent, on))
        if isinstance(message, FiguresMessage):
            line.figures = message
            return
        instance = self._get_instance(line, topic.instance)
        if isinstance(message, StatusMessage):
            if instance.status is None or instance.status.finding != message.finding:
                instance.found_at = message.t
            instance.status = message
        elif isinstance(message, RecentMessage):
            self._add_events(line, instance, message.events, wall)
        elif isinstance(message, EventMessage):
            self._add_events(line, instance, (message,), wall)

    def mark_offline_agents(self, wall: float) -> None:
        """Mark as offline agents whose state has not come again: a restarted broker loses last wills."""
        for agent in self.agents.values():
            if not agent.is_heard and not agent.is_offline and agent.state is not None:
                agent.state, agent.since = replace(agent.state, state="offline", t=wall), wall
                self.version += 1

    def _add_events(
        self, line: FleetLine, instance: FleetInstance, events: tuple[EventMessage, ...], wall: float
    ) -> None:
        for event in (each for each in instance.log.add_events(events) if each.kind == "error"):
            if line.newest_error is None or line.newest_error < event:
                line.newest_error = event
            at = line.agent.to_our_time(event.t, wall)
            if at > wall - HOUR_S:
                bucket = int(at // BUCKET_S)
                line.errors[bucket] = line.errors.get(bucket, 0) + 1

    def _get_instance(self, line: FleetLine, name: str) -> FleetInstance:
        found = self._get_or_make(line.instances, name, "instance", name, lambda: FleetInstance(name))
        if line.agent.has_begun:
            found.log.count_from_one()
        return found

    def _get_or_make(self, of: dict[K, V], key: K, what: str, name: str, make: Callable[[], V]) -> V:
        if key not in of:
            if self.names >= MOST_NAMES:  # rule 1
                raise mistake("fleet", f"one more {what}, '{name}'", f"at most {MOST_NAMES} names")
            self.names += 1
            of[key] = make()
        return of[key]

    def _forget(self, topic: Topic) -> None:
        agent = self.agents.get(topic[:2])
        line = agent.lines.get(topic.line) if agent is not None else None
        if agent is not None and topic.kind == "state":
            del self.agents[topic[:2]]
            self.names -= 1 + sum(1 + len(each.instances) for each in agent.lines.values())
        elif line is not None:
            if topic.kind == "figures":
                line.figures = None
            elif topic.kind == "status" and line.instances.pop(topic.instance, None) is not None:
                self.names -= 1
            if line.figures is None and not line.instances:  # all its topics are cleared
                del line.agent.lines[line.name]
                self.names -= 1

    # -- what is shown -----------------------------------------------------------------------------------

    @property
    def lines(self) -> list[FleetLine]:
        agents = self.agents.values()
        return [line for each in agents for line in each.lines.values() or (each.without_lines,)]

    def sort_lines(self, wall: float) -> list[FleetLine]:
        lines = self.lines
        for line in lines:
            line.judge(wall)
        return sorted(lines, key=lambda line: line.rank)
