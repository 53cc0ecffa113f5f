"""All lines of all sites as a reader knows them: who is there, what each shows, the worst first.

Rule: what has no room is refused with one line, and the lines that are there go on.
"""

from __future__ import annotations

from typing import Final

from trcvtui.errors import mistake
from trcvtui.fleet.event_log import EventLog, KeptEvent
from trcvtui.fleet.topics import (
    EventMessage,
    FiguresMessage,
    FleetMessage,
    RecentMessage,
    StateMessage,
    StatusMessage,
    Topic,
)

MOST_NAMES: Final = 30_000  # of agents, lines and instances together
HOUR_S: Final = 3600
BUCKETS: Final = 12  # of the hour, in the sparkline
BUCKET_S: Final = HOUR_S // BUCKETS
UP: Final = frozenset(("connected", "created", "up"))  # states of a line
OFFLINE, ERROR, AWAY, GOOD = range(4)  # what a line shows, the worst first
SHOWN: Final = ("offline", "ERROR", "not connected", "good")


class FleetInstance:
    """One instance of a line: what it shows, its events."""

    def __init__(self, name: str) -> None:
        self.name, self.log = name, EventLog()
        self.status: StatusMessage | None = None

    @property
    def has_error(self) -> bool:
        return self.status is not None and self.status.error


class FleetAgent:
    def __init__(self, site: str, name: str) -> None:
        self.site, self.name = site, name
        self.state: StateMessage | None = None
        self.since = 0.0  # a last will tells the time when it was left
        self.lines: dict[str, FleetLine] = {}
        self.has_begun = False  # all that the broker has retained of its events has come
        self.is_heard = True  # its state has come on this connection

    @property
    def is_offline(self) -> bool:
        return self.state is not None and self.state.state == "offline"

    def begin(self) -> None:
        """Take that what came before we looked has come."""
        self.has_begun = True
        for line in self.lines.values():
            for instance in line.instances.values():
                instance.log.begin()


class FleetLine:
    """One line. `rank`: lines in its order have the worst first."""

    def __init__(self, agent: FleetAgent, name: str) -> None:
        self.agent, self.name = agent, name
        self.figures: FiguresMessage | None = None
        self.instances: dict[str, FleetInstance] = {}
        self.errors: dict[int, int] = {}  # of the hour: the bucket by its number since 1970
        self.newest_error: KeptEvent | None = None  # of any instance
        self.errors_hour = 0  # of the last hour, when it was judged
        self.shows = GOOD
        self.rank: tuple[object, ...] = ()

    @property
    def worst(self) -> FleetInstance | None:
        """Return the instance to be told of: with ERROR, else with the most errors."""
        return max(self.instances.values(), key=_badness, default=None)

    @property
    def cause(self) -> str:
        """Return what to group by: why it shows what it shows."""
        if self.shows == OFFLINE:
            return "the agent is offline"
        newest = self.newest_error
        if self.shows == ERROR or self.errors:
            return newest.title if newest is not None else "an ERROR without a cause"
        return "the line is not connected" if self.shows == AWAY else "no error in the last hour"

    @property
    def missing(self) -> int:
        """Return how many events there were that have not come."""
        return sum(each.log.missing for each in self.instances.values())

    @property
    def is_lacking(self) -> bool:
        """Return whether something is known to be on the broker that has not come."""
        has_status = any(each.status is not None for each in self.instances.values())
        return self.figures is None or not has_status or self.missing > 0

    @property
    def since(self) -> float | None:
        """Return since when it shows what it shows: seconds of UTC since 1970."""
        worst = self.worst
        status = worst.status if worst is not None else None
        if self.shows == OFFLINE:
            return max([self.agent.since, *(each.t for each in (self.figures, status) if each is not None)])
        return status.t - status.age_s if status is not None else None

    def errors_an_hour(self, wall: float) -> int:
        """Return the ERRORs of the last hour: those that came, or as many as its agent counts."""
        oldest = int(wall // BUCKET_S) - BUCKETS
        for bucket in [each for each in self.errors if each <= oldest]:
            del self.errors[bucket]
        figures = self.figures
        told = figures.errors_an_hour if figures is not None and figures.t > wall - HOUR_S else 0
        return max(sum(self.errors.values()), int(told))

    def sparkline(self, wall: float) -> list[int]:
        """Return the ERRORs of each twelfth of the last hour, the oldest first."""
        newest = int(wall // BUCKET_S)
        return [self.errors.get(bucket, 0) for bucket in range(newest - BUCKETS + 1, newest + 1)]

    def judge(self, wall: float) -> None:
        """Find out what it shows, and its rank."""
        if self.agent.is_offline:
            self.shows = OFFLINE
        elif any(each.has_error for each in self.instances.values()):
            self.shows = ERROR
        else:
            self.shows = AWAY if self.figures is not None and self.figures.state not in UP else GOOD
        at = self.shows if self.shows < AWAY else AWAY
        names = self.agent.site, self.agent.name, self.name
        self.errors_hour = self.errors_an_hour(wall)
        self.rank = (at, -self.errors_hour, self.shows, *names)

    @property
    def words(self) -> str:
        """Return what a filter looks in, small letters."""
        state = self.figures.state if self.figures is not None else ""
        last = self.newest_error.title if self.newest_error is not None and self.errors_hour else ""
        names = f"{self.agent.site}/{self.agent.name}/{self.name}"
        codes = [each.status.status for each in self.instances.values() if each.status is not None]
        return " ".join((names, SHOWN[self.shows], state, last, *self.instances, *codes)).casefold()


def _badness(instance: FleetInstance) -> tuple[bool, int]:
    return instance.has_error, instance.status.errors if instance.status is not None else -1


class SeenFleet:
    """Takes message by message; `ordered` gives the lines."""

    def __init__(self) -> None:
        self.agents: dict[tuple[str, str], FleetAgent] = {}
        self.names = 0  # of agents, lines and instances
        self.version = 0  # another number: something is shown otherwise

    # -- messages ----------------------------------------------------------------------------------------

    def take(
        self, topic: Topic, message: FleetMessage | None, wall: float, is_retained: bool = False
    ) -> None:
        """Take what came on a topic, None: it was cleared; raise UserError for what has no room."""
        self.version += 1
        if message is None:
            self._forget(topic)
            return
        agent = self._agent(topic)
        if isinstance(message, StateMessage):
            agent.state, agent.is_heard = message, True
            agent.since = message.t if is_retained or message.state == "online" else wall
            return
        line = self._line(agent, topic.line)
        if isinstance(message, FiguresMessage):
            line.figures = message
            return
        instance = self._instance(line, topic.instance)
        if isinstance(message, StatusMessage):
            instance.status = message
        elif isinstance(message, RecentMessage):
            self._take_events(line, instance, message.events, wall)
        elif isinstance(message, EventMessage):
            self._take_events(line, instance, (message,), wall)

    def begin_connection(self) -> None:
        """Take that the broker is there again: what it knows of the agents comes now."""
        for agent in self.agents.values():
            agent.is_heard = False

    def miss(self, wall: float) -> None:
        """Take each agent for offline that has not come back with the broker: its last will is forgotten."""
        for agent in self.agents.values():
            if not agent.is_heard and not agent.is_offline and agent.state is not None:
                agent.state, agent.since = agent.state.offline(wall), wall
                self.version += 1

    def _take_events(
        self, line: FleetLine, instance: FleetInstance, events: tuple[EventMessage, ...], wall: float
    ) -> None:
        for event in (each for each in instance.log.take(events) if each.kind == "error"):
            if line.newest_error is None or line.newest_error < event:
                line.newest_error = event
            if event.t > wall - HOUR_S:
                bucket = int(min(event.t, wall) // BUCKET_S)
                line.errors[bucket] = line.errors.get(bucket, 0) + 1

    def _agent(self, topic: Topic) -> FleetAgent:
        found = self.agents.get(topic[:2])
        if found is None:
            self._make_room("agent", topic.agent)
            found = self.agents[topic[:2]] = FleetAgent(topic.site, topic.agent)
        return found

    def _line(self, agent: FleetAgent, name: str) -> FleetLine:
        found = agent.lines.get(name)
        if found is None:
            self._make_room("line", name)
            found = agent.lines[name] = FleetLine(agent, name)
        return found

    def _instance(self, line: FleetLine, name: str) -> FleetInstance:
        found = line.instances.get(name)
        if found is None:
            self._make_room("instance", name)
            found = line.instances[name] = FleetInstance(name)
            if line.agent.has_begun:
                found.log.begin()
        return found

    def _make_room(self, what: str, name: str) -> None:
        if self.names >= MOST_NAMES:
            raise mistake("fleet", f"one more {what}, '{name}'", f"{MOST_NAMES} names at most")
        self.names += 1

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
            if line.figures is None and not line.instances:
                del line.agent.lines[line.name]
                self.names -= 1

    # -- what is shown -----------------------------------------------------------------------------------

    @property
    def lines(self) -> list[FleetLine]:
        return [line for agent in self.agents.values() for line in agent.lines.values()]

    def ordered(self, wall: float) -> list[FleetLine]:
        """Return the lines, the worst first."""
        lines = self.lines
        for line in lines:
            line.judge(wall)
        return sorted(lines, key=lambda line: line.rank)
