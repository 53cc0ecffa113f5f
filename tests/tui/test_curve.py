"""A member over time: the sparkline in pane 6, and the curve with its keys, its words and its marks."""

from __future__ import annotations

import re
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.recording.test_record_command import PROJECT as TALKING
from tests.replay.journals import InMemory, recorded
from tests.replay.test_time_line import Stood
from tests.tui.looking import SMALL, WIDE
from tests.tui.test_replay_screen import on_a_recording
from tests.tui.view_model.test_explain import UP, Desk, at_the_desk
from trcvtui.history.messages import HOLE_REASON, MessageRow
from trcvtui.replay.time_line import ReplayNavigator
from trcvtui.tui.curve import CurveScreen, CurveView
from trcvtui.tui.view_model import member_numbers
from trcvtui.tui.view_model.member_numbers import Number
from trcvtui.tui.widgets.curves import SPARK_BLOCKS
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf

SPEEDS = (0.0, 1.0, 2.0, 80.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
SPARKS = re.compile(f"([{SPARK_BLOCKS}×]+)$")


def sent(*speeds: float) -> list[str]:
    """Return the lines of telegrams of these speeds, each a DONE of its own."""
    lines = list[str]()
    for number, speed in enumerate(speeds):
        content = struct.pack("<ihBxf", number, 1, 1, speed) + bytes(12)
        lines += [f"peer P1 send hex {content.hex(' ')}", "run 6"]
    return lines


@asynccontextmanager
async def at_the_curve(*lines: str, member: int = 3, size: tuple[int, int] = WIDE) -> AsyncIterator[Desk]:
    async with at_the_desk(size, *UP, *lines) as desk:
        await desk.press("6", *["down"] * (member + 1), "enter")
        assert isinstance(desk.app.screen, CurveScreen)
        yield desk


def view(desk: Desk) -> CurveView:
    assert isinstance(desk.app.card, CurveScreen)
    return desk.app.card.view


def title(desk: Desk) -> str:
    return str(view(desk).border_title)


def sparks(desk: Desk, member: str) -> str:
    found = SPARKS.search(desk.line(f" {member} ", "udt"))
    return found[1] if found else ""


@pytest.mark.parametrize("size", [SMALL, WIDE], ids=["80x24", "140x45"])
async def test_numbers_have_a_sparkline_up_to_the_bytes_that_are_shown_and_texts_have_none(
    size: tuple[int, int],
) -> None:
    async with at_the_desk(size, *UP, *sent(*SPEEDS)) as desk:
        await desk.press("6")
        assert sparks(desk, "speed") == "▁▁▁█▁▁▁▂▂▂"
        assert sparks(desk, "alarm") == ("█" * 10 if size == SMALL else ""), "its padding takes the room"
        assert sparks(desk, "id") and sparks(desk, "state") and not sparks(desk, "tag")
        table = desk.app.main.table
        rows = desk.app.view_model.known_messages.rows
        table.past = 3, rows[2].content or b""
        table.show()
        assert sparks(desk, "speed") == "▁▅█"
        rows[9] = rows[9]._replace(number=3)  # of the instance that was added again
        table.show()
        assert sparks(desk, "speed") == "▁▅█"
        table.past = None
        await desk.press("v")
        assert not sparks(desk, "speed"), "the bytes of the running job"
        await desk.press("v")
        await desk.do("resize rx DINT")
        assert sparks(desk, "")[:3] == "▁▂▃"


async def test_where_fewer_than_eight_columns_are_free_there_is_no_sparkline() -> None:
    async with at_the_desk((128, 45), *UP, *sent(*SPEEDS)) as desk:
        assert (len(sparks(desk, "speed")), sparks(desk, "state")) == (8, "")


async def test_a_picture_decodes_new_messages_only(monkeypatch: pytest.MonkeyPatch) -> None:
    decoded, true = list[int](), member_numbers.number_in

    def number_in(layout: Layout, leaf: Leaf, row: MessageRow) -> Number | None:
        decoded.append(row.number)
        return true(layout, leaf, row)

    monkeypatch.setattr(member_numbers, "number_in", number_in)
    async with at_the_desk(SMALL, *UP, *sent(*SPEEDS)) as desk:
        await desk.press("6")
        decoded.clear()
        await desk.do("run 1")
        assert not decoded
        await desk.do(*sent(9.0))
        assert decoded == [11] * 4, "once for each member with a number"


async def test_a_click_on_a_sparkline_opens_the_curve() -> None:
    async with at_the_desk(SMALL, *UP, *sent(*SPEEDS)) as desk:
        await desk.press("6")
        await desk.pilot.click("#udt", offset=(30, 4))
        assert desk.app.screen is desk.app.main, "a click on the type chooses the member"
        await desk.pilot.click("#udt", offset=(76, 4))
        await desk.pilot.pause()
        assert view(desk).path == "speed"
        await desk.press("escape")
        assert desk.app.screen is desk.app.main and desk.app.card is None


async def test_the_curve_has_its_figures_moves_with_new_messages_and_stands_where_it_is_told_to() -> None:
    async with at_the_curve(*sent(*SPEEDS)) as desk:
        assert "speed now 8.0 · min 0.0 · max 80.5 · 10 messages in view" in desk.text
        assert desk.line("80.5 ┤") and desk.line("0 ┤")
        await desk.do(*sent(100.0))
        assert "now 100.0 · min 0.0 · max 100.0 · 11 messages" in desk.text
        await desk.press("plus", "plus")
        assert "min 6.0 · max 100.0 · 3 messages" in desk.text, "6.0 is what DATA held at its beginning"
        await desk.press("left")
        assert "paused: press end to follow" in title(desk)
        before = desk.text
        await desk.do(*sent(200.0))
        assert "now 200.0 · min 6.0 · max 8.0 · 2 m" in desk.text and "200.0" not in before
        await desk.press("end")
        assert "max 200.0" in desk.text and "stands" not in title(desk)
        await desk.press("left", "minus", "minus", "minus", "left")
        assert "stands" not in title(desk), "the whole time goes on with each message"
        await desk.do(*sent(300.0))
        assert "min 0.0 · max 300.0 · 13 messages" in desk.text
        await desk.press("F")  # is no key of the curve
        assert not desk.app.view_model.is_frozen


async def test_p_draws_each_other_number_on_the_same_time_axis_and_then_none() -> None:
    async with at_the_curve(*sent(*SPEEDS)) as desk:
        shown = []
        for _ in range(4):
            await desk.press("p")
            shown.append(view(desk).other)
        assert shown == ["id", "state", "alarm", None]
        await desk.press("p")
        assert "id now 9 · min 0 · max 9" in desk.text
        assert re.search(r"80\.5 ┤.* 9 +│", desk.text), "each has an axis of its own"


async def test_keys_of_the_curve_come_before_those_of_a_replay() -> None:
    async with on_a_recording() as looker:
        await looker.go("end")
        await looker.go("6", "down", "enter")
        asked = len(looker.lines)
        await looker.go("home", "end", "g", "plus", "minus", "left", "right", "p")
        assert isinstance(looker.app.screen, CurveScreen)
        assert looker.lines[asked:] == []


@pytest.mark.parametrize(
    ("lines", "member", "said"),
    [
        ([], 3, "no message has ended yet"),
        (sent(1.0), 4, "tag is not a number: it has no curve"),
        (sent(float("nan"), float("inf")), 3, "speed now Infinity · no number in view"),
        (sent(-3.4e38, 3.4e38), 3, "min -3.4e+38 · max 3.4e+38 · 2 messages"),
        (["peer P1 send hex 01 02", "run 3", "peer P1 rst", "run 3"], 3, "speed now - · no number in view"),
    ],
)
async def test_it_says_in_words_why_there_is_no_curve(lines: list[str], member: int, said: str) -> None:
    async with at_the_curve(*lines, member=member) as desk:
        assert said in desk.text
        await desk.press("plus", "left", "p", "minus", "home", "end")


async def test_a_type_that_changes_and_an_instance_that_goes_are_said_while_the_curve_is_open() -> None:
    async with at_the_curve(*sent(*SPEEDS)) as desk:
        await desk.press("p")
        await desk.do("resize rx ARRAY[0..5] OF DINT")
        assert "has no member speed any more" in desk.text
        await desk.do("delete TRCV_C_1")
        assert "TRCV_C_1 does not exist any more" in desk.text


async def test_a_lost_connection_is_a_gap_with_marks_below_it() -> None:
    lost = ["peer P1 send hex 01 02", "run 3", "peer P1 rst", "run 90", "peer P1 connect", "run 3"]
    async with at_the_curve(*sent(*SPEEDS), *lost, *sent(*SPEEDS)) as desk:
        rows = view(desk)._rows
        signs = "".join(text for text, _ in rows[-3].parts)
        curve = ["".join(text for text, _ in each.parts[2:]) for each in rows[:-4]]
        gaps = [x for x in range(len(curve[0])) if all(line[x] == " " for line in curve)]
        assert len(gaps) > 20 and gaps == [*range(gaps[0], gaps[-1] + 1)]
        mark = signs.index("▲") - 11
        assert gaps[0] - 3 <= mark <= gaps[0], "the ERROR of the RST stands where the gap begins"


async def test_what_a_hole_has_taken_is_not_said_to_be_a_nan() -> None:
    async with at_the_desk(WIDE, *UP, *sent(*SPEEDS)) as desk:
        rows = desk.app.view_model.known_messages.rows
        rows[9] = rows[9]._replace(reason=HOLE_REASON, have=9, content=bytes(9))
        await desk.press("6", *["down"] * 4, "enter")
        assert "speed now ? · min" in desk.text


async def test_the_curve_of_a_replay_has_the_gaps_and_marks_of_the_whole_recording(tmp_path: Path) -> None:
    lost = TALKING.replace("random 1000", "random 12").replace("T#1s", "T#20ms").replace("1..1000", "1..12")
    steps = "run 300\npeer P1 rst\nrun 200"
    path = tmp_path / "lost.toml"
    path.write_text(f"{lost}[scenario]\nname = 'lost'\nsteps = '''\n{steps}\n'''\n")
    entries = recorded(path)[1]
    async with on_a_recording(stood=Stood(line=ReplayNavigator(InMemory(entries), "R"))) as looker:
        pictures, known = list[str](), looker.app.view_model.known_messages
        for key in ("home", "end"):
            await looker.go("9", key)
            await looker.go("6", "home", "enter")
            pictures.append("".join(looker.text.splitlines()[1:-1]))
            await looker.go("escape")
        assert pictures[0] == pictures[1] and known.gaps and known.errors


async def test_a_frozen_view_says_so_and_shows_no_later_message() -> None:
    async with at_the_desk(WIDE, *UP, *sent(*SPEEDS)) as desk:
        await desk.press("F")
        scan = desk.scan
        await desk.press("6", *["down"] * 4, "enter")
        await desk.do(*sent(99.0))
        assert f"frozen in scan {scan}" in title(desk)
        assert "now 8.0 · min 0.0 · max 80.5 · 10 messages" in desk.text
