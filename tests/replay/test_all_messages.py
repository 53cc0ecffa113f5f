"""A replay knows the messages of the whole recording, wherever it stands."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from tests.history.test_sent_messages import played
from tests.recording.test_record_command import PROJECT as TALKING
from tests.replay.journals import InMemory, recorded
from tests.replay.test_time_line import Stood
from trcvtui.cli.main import main
from trcvtui.history.messages import MessageRow
from trcvtui.recording.journal import SIM_WALL_NS, STEP
from trcvtui.replay.driver import open_time_line
from trcvtui.replay.time_line import ReplayNavigator
from trcvtui.tui.view_model.view_model import ViewModel


def scenario_of_many(folder: Path) -> Path:
    """Return one with 500 messages."""
    many = TALKING.replace("1..1000", "1..12").replace("random 1000", "random 12").replace("T#1s", "T#20ms")
    path = folder / "many.toml"
    path.write_text(f'{many}[scenario]\nname = "many"\nsteps = "run 1005"\n')
    return path


class Shown(Stood):
    """A replay, and what the screen knows of its messages."""

    def __init__(self, line: ReplayNavigator) -> None:
        super().__init__(line=line)
        self.screen = ViewModel(line.controller.bench.project)
        self.rows()

    def rows(self) -> list[MessageRow]:
        """Let the screen ask until nothing is new."""
        for _ in range(8):
            self.screen.accept_picture(self.line.make_picture(self.screen.make_request()))
            self.settle()
        assert self.screen.known_messages.share == 1
        return [*self.screen.known_messages.rows]


def test_at_its_first_scan_a_replay_has_the_rows_of_the_run_and_keeps_them(tmp_path: Path) -> None:
    many = scenario_of_many(tmp_path)
    _, messages = played(many)
    rows = [row for _, row in messages.taken]
    stood = Shown(ReplayNavigator(InMemory(recorded(many)[1]), "R"))
    assert (stood.scan, len(rows), stood.rows()) == (1, 500, rows)
    assert stood.screen.message_type is not None
    assert stood.screen.live is not None and stood.screen.live.begun_ns == SIM_WALL_NS
    known = stood.screen.known_messages
    for line in (f"at {rows[299].scan}", "at 1", "at end", "if instance.TRCV_C_1.LEN=2", "at 5", "if off"):
        stood.go(line)
        assert stood.rows() == rows
    assert stood.screen.known_messages is known, "nothing has crossed twice"


def test_where_the_journal_lies_the_rows_end_and_the_replay_too(tmp_path: Path) -> None:
    entries = recorded(scenario_of_many(tmp_path))[1]
    steps = [place for place, one in enumerate(entries) if getattr(one, "call", "") == STEP]
    entries[steps[200]] = entries[steps[100]]  # time would go back
    stood = Shown(ReplayNavigator(InMemory(entries), "R"))
    position = stood.update().position
    assert stood.rows()[-1].scan <= 200
    assert position is not None and (position.scan, position.last_scan) == (1, 200)
    assert "a time that does not go back" in position.note


def test_a_file_of_a_split_run_has_the_numbers_of_its_jobs(tmp_path: Path) -> None:
    (tmp_path / "P.toml").write_text(TALKING.replace("T#1s", "T#3ms"))
    asked = ["--kernel", "sim", "--split", "64KiB", "--duration", "T#3s", "--out", str(tmp_path / "out")]
    assert main(["record", str(tmp_path / "P.toml"), *asked]) == 0
    numbers, files = list[int](), sorted((tmp_path / "out").iterdir())
    for file in files:
        with closing(open_time_line(file, "end")) as line:
            numbers += [row.number for row in Shown(line).rows()]
    assert len(files) > 3 and numbers == [*range(1, len(numbers) + 1)]
