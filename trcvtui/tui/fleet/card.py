"""The card of one line: its state, its instances, its last findings and events."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Final

from trcvtui.fleet.event_log import KeptEvent
from trcvtui.fleet.seen_fleet import OFFLINE, STALE, STUCK_S, FleetInstance, FleetLine
from trcvtui.tui.fleet.table import age_since_text, spark_parts
from trcvtui.tui.formatting import SECOND, lamp, plain, wrap_text
from trcvtui.tui.widgets.dialogs import LABEL_WIDTH, LabelledText, ViewDialog
from trcvtui.tui.widgets.line_view import Part, Row, row, rule
from trcvtui.wording import age_text, count, last_part, size_text

CODE_WIDTH: Final = 9  # columns
EVENT_STYLES: Final = {"error": "error", "finding": "warn"}  # of events by their kinds
DAY_FORMAT: Final = "%Y-%m-%d"


def time_text(t: float, wall: float) -> str:
    """Return the local time of day, with the date if that is not today, or "?" if `t` is no valid time."""
    try:
        then, now = datetime.fromtimestamp(t), datetime.fromtimestamp(wall)
    except (OverflowError, OSError, ValueError):
        return "?"
    return f"{then:%H:%M:%S}" if f"{then:{DAY_FORMAT}}" == f"{now:{DAY_FORMAT}}" else f"{then:%d %b %H:%M}"


class FleetCard(LabelledText):
    def __init__(self, line: FleetLine, wall: Callable[[], float]) -> None:
        super().__init__(id="fleet-card")
        self._line = line
        self._wall = wall

    def make_rows(self) -> list[Row]:
        rows = [*self._line_rows()]
        for instance in self._line.instances.values():
            rows += self._instance_rows(instance)
        for title, is_wanted in (("findings", True), ("events", False)):
            listed = [each for each in self._list_events() if (each[1].kind == "finding") == is_wanted]
            missing = self._line.missing if title == "events" else 0
            if listed or missing or title == "events":
                rows.append(rule(self._width, (f"── {title} ", "dim"), *_missing(missing)))
                rows += self._event_rows(listed)
            if not listed and title == "events":
                rows.append(row(("none known", "dim")))
        return rows

    def _line_rows(self) -> Iterator[Row]:
        line, wall = self._line, self._wall()
        figures, agent = line.figures, line.agent.state
        state = figures.state if figures is not None else "?"
        since = line.shown_since(wall) if line.shows == OFFLINE else line.agent.since
        shown = f"{agent.state} since {time_text(since or 0, wall)}" if agent is not None else "unknown"
        version = f", trcvtui {plain(agent.version)}" if agent is not None else ""
        yield from self._labelled_rows("line", [plain(state)], "" if line.shows != OFFLINE else "faint")
        yield from self._labelled_rows(
            "agent", [shown + version], "error" if line.shows in (OFFLINE, STALE) else ""
        )
        if skew := line.agent.skew_s:
            behind = "behind" if skew > 0 else "ahead of"
            shown = f"{age_text(int(abs(skew) * SECOND))} {behind} our clock; all times are of our clock"
            yield from self._labelled_rows("clock", [shown], "warn")
        recorded = next((event for _, event in self._list_events() if event.file), None)
        if recorded is not None:
            host = f" on {plain(agent.host)}" if agent is not None else ""
            yield from self._labelled_rows("recorded", [f"{plain(recorded.file)}{host}"], "strong")
        if figures is not None:
            parts = [
                f"{size_text(figures.received)}/s in",
                f"{size_text(figures.sent)}/s out",
                f"{figures.done_a_minute:g} DONE a minute",
                f"sent {age_since_text(line.agent.to_our_time(figures.t, wall), wall)} ago",
            ]
            yield from self._labelled_rows("figures", [" · ".join(parts)], "")
        hour = f" {count(line.errors_hour, 'error')} in the last hour"
        yield row(("errors".ljust(LABEL_WIDTH), "label"), *spark_parts(line.sparkline(wall)), (hour, ""))

    def _instance_rows(self, instance: FleetInstance) -> list[Row]:
        rows = [rule(self._width, (f"── {plain(instance.name)} ", "dim"), *_missing(instance.log.missing))]
        status = instance.status
        if status is None:
            return [*rows, row(("no STATUS received yet", "dim"))]
        style = "error" if status.error else "done" if status.done else "busy" if status.busy else "strong"
        lamps: list[Part] = [
            (f"{name}{lamp(on)} ", lit if on else "faint")
            for name, on, lit in (
                ("BUSY", status.busy, "busy"),
                ("DONE", status.done, "done"),
                ("ERROR", status.error, "error"),
            )
        ]
        have = f"{status.here}/{status.wanted} B · " if status.wanted else ""
        wall = self._wall()
        since = age_since_text(self._line.agent.to_our_time(status.t, wall) - status.age_s, wall)
        if (stuck := self._line.stuck_s(instance, wall)) >= STUCK_S:
            since += f" · stuck for {age_text(int(stuck * SECOND))}"
        counted = f"{have}{status.jobs_done} DONE, {count(status.errors, 'ERROR', 'ERRORs')} · for {since}"
        rows.append(row((f"16#{status.status}  ", style), *lamps, (f" {counted}", "")))
        found = self._labelled_rows("finding", [plain(status.finding)], "warn") if status.finding else []
        return [*rows, *self._labelled_rows("", [plain(status.text)], style), *found]

    def _list_events(self) -> list[tuple[str, KeptEvent]]:
        instances = self._line.instances.values()
        kept = [(event, each.name) for each in instances for event in each.log.kept]
        return [(name, event) for event, name in sorted(kept, reverse=True)]

    def _event_rows(self, listed: list[tuple[str, KeptEvent]]) -> Iterator[Row]:
        wall = self._wall()
        times = [time_text(self._line.agent.to_our_time(event.t, wall), wall) for _, event in listed]
        wide = max(map(len, times), default=0) + 2
        for when, (name, event) in zip(times, listed, strict=True):
            whose = f"{plain(name)}: " if len(self._line.instances) > 1 else ""
            what = f"{event.title}: {event.text}" if event.kind == "finding" else event.text
            what += f" · scan {event.scan}" if event.scan else ""
            what += f" of {plain(last_part(event.file))}" if event.file else ""
            first, *rest = wrap_text(f"{whose}{what}", self._width - wide - CODE_WIDTH)
            code = f"16#{event.status}" if event.status else event.kind
            style = EVENT_STYLES.get(event.kind, "dim")
            yield row((when.ljust(wide), "dim"), (code.ljust(CODE_WIDTH), style), (first, ""))
            yield from (row((" " * (wide + CODE_WIDTH), ""), (text, "")) for text in rest)


def _missing(events: int) -> list[Part]:
    return [(f"{count(events, 'event is', 'events are')} missing ", "warn")] if events else []


class FleetCardScreen(ViewDialog[None]):
    DEFAULT_CSS = "FleetCardScreen FleetCard { width: 104; height: auto; max-height: 100%; }"

    def __init__(self, line: FleetLine, wall: Callable[[], float]) -> None:
        self.card = FleetCard(line, wall)
        name = plain(f"{line.agent.site}/{line.agent.name}/{line.name}")
        self.card.set_title(None, name, "esc closes")
        super().__init__(self.card, None)

    def on_mount(self) -> None:
        self.card.draw()
