"""The screen of the fleet: the list, its filter and groups, a card, the broker away, hostile texts."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace
from textual.pilot import Pilot

from tests.fleet.fakes import NOW, OFF, ONLINE, SECOND, FakeBroker, event, figures, recent, status
from tests.tui.looking import SMALL, WIDE, same_screen, screen_text, typed
from trcvtui import clock
from trcvtui.fleet.broker import BrokerAccess, ConnAck, ConnectionLost, IncomingMessage
from trcvtui.fleet.topics import StatusMessage
from trcvtui.tui.fleet import app as fleet_app
from trcvtui.tui.fleet.app import FleetApp

MIDDLE = (100, 30)
SIZES = pytest.mark.parametrize("size", [SMALL, MIDDLE, WIDE], ids=lambda size: f"{size[0]}x{size[1]}")


@pytest.fixture(autouse=True)
def frames_and_times_of_the_test(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(fleet_app, "FRAME_S", 3600.0)
    monkeypatch.setattr(fleet_app, "ORDER_INTERVAL_NS", 0)
    monkeypatch.setattr(clock, "utc_ns", lambda: int(NOW) * SECOND)
    monkeypatch.setenv("TZ", "UTC")
    if hasattr(time, "tzset"):
        time.tzset()
    yield
    monkeypatch.undo()
    if hasattr(time, "tzset"):
        time.tzset()


class OnFleet:
    def __init__(self, app: FleetApp, broker: FakeBroker, pilot: Pilot[None]) -> None:
        self.app, self.broker, self.pilot = app, broker, pilot

    async def tell(self, *news: ConnAck | ConnectionLost | IncomingMessage) -> None:
        self.broker.tell(*news)
        self.app.read_broker(1 << 62)
        await self.pilot.pause()

    async def press(self, *keys: str) -> None:
        for key in keys:
            await self.pilot.press(key)
        self.app.read_broker(1 << 62)
        await self.pilot.pause()

    async def type(self, text: str) -> None:
        for key in typed(text):
            self.app.post_message(key)
        await self.pilot.pause()

    @property
    def text(self) -> str:
        return screen_text(self.app)

    @property
    def names(self) -> list[str]:
        rows = [line[2:].split() for line in self.text.splitlines() if line[:1] in "┃│"]
        return [next(word for word in words if word[0].isalpha()) for words in rows[1:] if len(words) > 2]

    @property
    def chosen(self) -> str:
        return next(line for line in self.text.splitlines() if "▸" in line)


@asynccontextmanager
async def on_fleet(size: tuple[int, int] = WIDE, is_filled: bool = True) -> AsyncIterator[OnFleet]:
    broker = FakeBroker()
    app = FleetApp(BrokerAccess("broker.example", 8883, True), "*", broker.reader)
    async with app.run_test(size=size) as pilot:
        screen = OnFleet(app, broker, pilot)
        await screen.tell(ConnAck(), *(plant(broker) if is_filled else ()))
        yield screen


def plant(broker: FakeBroker) -> list[IncomingMessage]:
    bad = replace(status("80A6", True, 3), text="the partner has reset the connection")
    message = broker.message
    return [
        message("plant1/press/state", ONLINE),
        message("plant1/press/C1/figures", figures()),
        message("plant1/press/C1/TRCV_C_1/status", status()),
        message("plant1/press/C2/figures", figures(errors=3)),
        message("plant1/press/C2/TRCV_C_2/status", bad),
        message("plant1/press/C2/TSEND_C_2/status", replace(status("7009"), text="sending", busy=True)),
        message("plant1/press/C2/TRCV_C_2/event", replace(event(4), t=NOW - 1900)),
        message("plant1/press/C2/TRCV_C_2/event", replace(event(7), t=NOW - 20)),
        message("plant2/oven/state", OFF),
        message("plant2/oven/C1/figures", figures()),
        message("plant2/oven/C1/TRCV_C_1/status", status()),
        message("plant2/saw/state", ONLINE),
        message("plant2/saw/C1/figures", figures("listening")),
        message("plant2/saw/C1/TRCV_C_1/status", status("7002")),
    ]


WORST_FIRST = ["plant2/oven/C1", "plant1/press/C2", "plant2/saw/C1", "plant1/press/C1"]


@SIZES
async def test_the_list_and_a_card_stand_as_drawn(size: tuple[int, int], tmp_path: Path) -> None:
    name = f"{size[0]}x{size[1]}"
    async with on_fleet(size) as screen:
        assert screen.names == WORST_FIRST
        same_screen(screen.app, f"fleet-{name}", tmp_path)
        await screen.press("g")
        same_screen(screen.app, f"fleet-groups-{name}", tmp_path)
        await screen.press("escape", "down", "enter")
        same_screen(screen.app, f"fleet-card-{name}", tmp_path)


async def test_the_cursor_stays_on_the_worst_until_it_is_moved_then_on_its_line() -> None:
    async with on_fleet() as screen:
        assert "oven" in screen.chosen
        await screen.tell(screen.broker.message("plant2/oven/state", ONLINE))
        assert "press/C2" in screen.chosen
        await screen.press("end", "up")
        assert "press/C1" in screen.chosen
        older = replace(status("80A6", True), age_s=90.0)
        await screen.tell(screen.broker.message("plant1/press/C1/TRCV_C_1/status", older))
        assert screen.names[0] == "plant1/press/C1" and "press/C1" in screen.chosen
        await screen.press("home")
        await screen.tell(screen.broker.message("plant2/saw/state", OFF))
        assert "saw" in screen.chosen


async def test_an_error_that_is_over_stands_beside_what_is_shown_now() -> None:
    async with on_fleet() as screen:
        await screen.tell(screen.broker.message("plant1/press/C2/TRCV_C_2/status", status("7002")))
        row = next(line for line in screen.text.splitlines() if "press/C2" in line)
        assert "7002 receiving" in row and "was 80A6 +1" in row


async def test_a_finding_a_stuck_job_a_hung_engine_and_a_wrong_clock_stand_in_rows_and_card() -> None:
    async with on_fleet() as screen:
        message = screen.broker.message
        place = "plant1/press/C1/TRCV_C_1/status"
        await screen.tell(message(place, replace(status(), finding="byte order swapped")))
        row = next(line for line in screen.text.splitlines() if "press/C1" in line)
        assert "finding" in row and "byte order swapped" in row and "1 finding" in screen.text
        await screen.tell(message(place, replace(status(), t=NOW - 21)))
        row = next(line for line in screen.text.splitlines() if "press/C1" in line)
        assert "stuck" in row and "12 of 24 bytes" in row and "21 s" in row
        await screen.tell(message("plant2/saw/state", replace(ONLINE, state="stale", t=NOW)))
        assert next(line for line in screen.text.splitlines() if "saw" in line).count("no scan") == 1
        late = IncomingMessage("trcvtui/v1/plant1/press/C1/figures", figures(t=NOW - 7200).to_json(), False)
        await screen.tell(late)
        assert "clock?" in next(line for line in screen.text.splitlines() if "press/C1" in line)
        await screen.press("end", "enter")
        assert "clock    2 h behind our clock" in screen.text


async def test_a_filter_lists_what_has_its_words_while_it_is_typed() -> None:
    async with on_fleet() as screen:
        await screen.press("slash")
        await screen.type("plant1 80a6")
        assert screen.names == ["plant1/press/C2"] and "1 of 4 with plant1 80a6" in screen.text
        await screen.press("enter", "q")
    async with on_fleet() as screen:
        await screen.press("slash")
        await screen.type("econnreset")
        assert screen.names == ["plant1/press/C2"]
        await screen.press("escape", "slash")
        await screen.type("offline")
        await screen.press("enter")
        assert screen.names == ["plant2/oven/C1"]
        await screen.press("escape")
        assert screen.names == WORST_FIRST
        await screen.press("slash")
        await screen.type("nobody")
        assert "no line has these words" in screen.text


async def test_groups_by_site_and_by_cause_open_and_close() -> None:
    async with on_fleet() as screen:
        await screen.press("g")
        assert "plant2  2 lines · 1 offline" in screen.text and "plant1  2 lines · 1 ERROR" in screen.text
        await screen.press("enter")
        assert "oven" in screen.text and "press" not in screen.text
        await screen.press("down", "left", "enter")
        assert "oven" not in screen.text
        await screen.press("g")
        assert (
            "the agent is offline  1 line" in screen.text and "16#80A6 recv ECONNRESET  1 line" in screen.text
        )
        await screen.press("g")
        assert screen.names == WORST_FIRST


async def test_a_card_shows_what_comes_meanwhile_and_what_is_missing() -> None:
    async with on_fleet() as screen:
        await screen.press("down", "enter")
        assert "2 events are missing" in screen.text and "TSEND_C_2" in screen.text
        await screen.tell(screen.broker.message("plant1/press/C2/TRCV_C_2/recent", recent(*range(1, 9))))
        assert "missing" not in screen.text
        assert screen.text.count("recv gave ECONNRESET") == 8
        await screen.press("escape")
        assert screen.names == WORST_FIRST


async def test_a_card_tells_on_which_machine_in_which_file_and_at_which_scan_to_look() -> None:
    async with on_fleet() as screen:
        place: dict[str, object] = {"text": "reset", "scan": 812, "file": "/var/runs/line/line-0003.pcapng"}
        came = replace(event(9), t=NOW, cause=place)
        await screen.tell(screen.broker.message("plant1/press/C2/TRCV_C_2/event", came))
        await screen.press("down", "enter")
        assert "recorded /var/runs/line/line-0003.pcapng on pc-7" in screen.text
        assert "reset · scan 812 of line-0003.pcapng" in screen.text


async def test_a_broker_that_is_away_stands_in_the_head_and_the_lines_stay() -> None:
    async with on_fleet(SMALL) as screen:
        assert "4 lines" in screen.text and "BROKER AWAY" not in screen.text
        await screen.tell(
            ConnectionLost("mqtts://broker.example:8883: wrong certificate: self-signed certificate")
        )
        assert "BROKER AWAY" in screen.text.splitlines()[0]
        assert "wrong certificate" in screen.text and screen.names == WORST_FIRST
        await screen.tell(ConnAck())
        assert "BROKER AWAY" not in screen.text


async def test_an_empty_broker_says_what_to_do() -> None:
    async with on_fleet(SMALL, is_filled=False) as screen:
        assert "no line yet" in screen.text and "trcvtui agent PROJECT.toml --mqtt" in screen.text


async def test_hostile_texts_reach_the_terminal_as_plain_characters() -> None:
    async with on_fleet(is_filled=False) as screen:
        message = screen.broker.message
        loud = StatusMessage(1e15, "80A6", "\x1b[31m[bold]loud", False, False, True, 1, 1, 0, 0, 1e15)
        place = "s%1B[2J/a/[red]/T"
        await screen.tell(
            message("s%1B[2J/a/state", ONLINE),
            message(f"{place}/status", loud),
            message(f"{place}/event", replace(event(1), t=-1e15, cause={"text": "\x9b31m[/]\u202e" * 9})),
            IncomingMessage("trcvtui/v1/\x1b[2J/x", b"\x1b", False),
        )
        assert "[red]" in screen.text and "1 message refused" in screen.text
        await screen.press("enter")
        assert "[bold]loud" in screen.text
        await screen.press("escape", "g", "g", "enter")
        shown = screen.text.replace("\n", "")
        assert shown.isprintable()


async def test_help_names_the_keys_and_q_ends() -> None:
    async with on_fleet(SMALL) as screen:
        await screen.press("question_mark")
        assert "group by site, by cause" in screen.text
        await screen.press("escape", "q")
        assert not screen.app.is_running or screen.app._exit


async def test_the_mouse_chooses_a_line_and_opens_the_chosen_one() -> None:
    async with on_fleet() as screen:
        await screen.pilot.click("#fleet-table", offset=(5, 1))
        assert "press/C2" in screen.chosen
        await screen.pilot.click("#fleet-table", offset=(5, 1))
        await screen.press("down")
        assert "recv gave ECONNRESET" in screen.text
