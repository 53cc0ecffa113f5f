"""The messages of a whole recording. The recording runs again, in slices, from the first to the last scan.

Rule: a row that was read keeps its values and its number, whichever scan the replay shows.
"""

from __future__ import annotations

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.errors import UserError
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRows, MessagesDelta, NewestRows
from trcvtui.history.received_streams import ReceivedStreams
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.packet_times import PacketTimes
from trcvtui.replay.survey import Survey


class AllMessagesReader:
    """Runs a recording up to the last scan that the survey knows, and keeps keyframes for the replay."""

    def __init__(self, keyframes: Keyframes, survey: Survey, path: str = "") -> None:
        self._keyframes, self._survey = keyframes, survey
        self._run = keyframes.start_run()
        self._reader = reader = LedgerReader(self._run.bench)
        if path:
            begun_ns, bench = self._run.begins.wall_ns, self._run.bench
            reader.index.packet_times = PacketTimes(path, begun_ns, lambda: begun_ns + bench.now).find_time
        streams = ReceivedStreams(self._run.bench, reader)
        self._rows = MessageRows(self._run.bench, reader, streams, keyframes.offset)

    @property
    def _current_scan(self) -> int:
        return self._run.bench.runtime.scans

    @property
    def is_over(self) -> bool:
        return self._survey.is_over and self._current_scan >= self._survey.last_scan

    def advance(self, deadline_ns: int) -> None:
        """Read until `deadline_ns`. If the run cannot continue, end the replay at this scan."""
        run, survey = self._run, self._survey
        run.limit = survey.last_scan
        while not self.is_over and clock.now_ns() < deadline_ns:
            before = self._current_scan
            try:
                run.scan()
                if self._current_scan == before:  # the survey counts scans that the run does not reach
                    raise run.make_end_error()
            except UserError as wrong:
                survey.end_after(before, str(wrong))
                return
            self._reader.catch_up()
            self._keyframes.keep_if_due(run)

    def make_delta(self, instance: str, since: int) -> MessagesDelta:
        """Return the next rows of an instance, out of the whole recording."""
        first, last = self._survey.first, self._survey.last_scan
        share = 1.0 if self.is_over else min(0.99, (self._current_scan - first) / max(1, last - first))
        return replace(self._rows.make_delta(instance, since), share=share)


class RowsWithScans:
    """Rows that are known already; the replay finds the scan number of a row by the time of the row."""

    def __init__(self, rows: NewestRows, survey: Survey) -> None:
        self._rows, self._survey = rows, survey

    def make_delta(self, instance: str, since: int) -> MessagesDelta:
        survey = self._survey
        if not survey.is_over:  # the scans of rows are not known yet
            return MessagesDelta(instance, 0, 0, (), share=0.0)
        news = self._rows.make_delta(instance, since)
        rows = [row._replace(scan=min(survey.last_scan, survey.scan_at(row.t_ns))) for row in news.rows]
        return replace(news, rows=tuple(rows))
