"""Events of eight lines over TLS on a real broker: each comes once, and no connection ends."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.certificates import Certificates
from tests.fleet.mosquitto import Mosquitto, needs_mosquitto, tls_lines
from trcvtui import clock
from trcvtui.fleet import publisher
from trcvtui.fleet.broker import BrokerAccess, BrokerConnection, ConnAck, ConnectionLost, IncomingMessage
from trcvtui.fleet.disk_queue import DiskQueue
from trcvtui.fleet.publisher import Publisher

LINES = 8
EACH = int(os.environ.get("TRCVTUI_SOAK_AGENT", "1000")) // LINES
AHEAD = 500  # messages of a line that wait at most


class SoakLine:
    """One line with a connection of its own: the agent's way from an event to the broker, and back."""

    def __init__(self, broker: BrokerAccess, folder: Path, number: int) -> None:
        self.topic = f"soak/{number}"
        self.said: list[str] = []
        self.connection = BrokerConnection(broker, f"line{number}")
        self.publisher = Publisher(
            self.connection, DiskQueue(folder / f"{number}.sqlite", print), self.said.append
        )
        self.heard = BrokerConnection(broker, f"reader{number}", topics=(self.topic,))
        self.put = self.ended = 0
        self.came: list[int] = []
        self.is_heard = False
        for each in (self.heard, self.connection):
            each.start()

    def turn(self) -> None:
        for news in self.heard.take_events():
            match news:
                case IncomingMessage(_, payload, _):
                    self.came.append(int(payload))
                case ConnectionLost():
                    self.ended += 1
                case ConnAck():
                    self.is_heard = True
        while self.is_heard and self.put < EACH and self.publisher.queue.size < AHEAD:
            self.put += 1
            self.publisher.send_event(self.topic, b"%d" % self.put)
        self.publisher.advance(clock.now_ns())

    @property
    def is_over(self) -> bool:
        return len(set(self.came)) == EACH and not self.publisher.queue.size

    def close(self) -> None:
        self.connection.close()
        self.heard.close()
        self.publisher.queue.close()


@needs_mosquitto
@pytest.mark.live
@pytest.mark.slow
@pytest.mark.timeout(0 if EACH > 1000 else 400)
def test_a_thousand_events_of_eight_lines_over_tls_come_once_and_no_connection_ends(
    certificates: Certificates, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher, "QUEUE_DELAY_NS", 0)
    broker = Mosquitto(tmp_path, f"allow_anonymous true\nmax_queued_messages 0\n{tls_lines(certificates)}")
    place = BrokerAccess("127.0.0.1", broker.port, True, ca=certificates.pem("ca"))
    lines = [SoakLine(place, tmp_path, number) for number in range(LINES)]
    try:
        while not all(line.is_over for line in lines):
            for line in lines:
                line.turn()
            lines[0].heard.wait_for_event(0.002)
        ended = sum(line.ended + sum("ended" in said for said in line.said) for line in lines)
        out, came = sum(line.put for line in lines), sum(len(set(line.came)) for line in lines)
        print(f"\n{LINES} lines, {out} out, {came} in, {ended} disconnects, {out - came} lost")
        assert (out, ended) == (came, 0)
        assert all(line.came == [*range(1, EACH + 1)] for line in lines)
    finally:
        for line in lines:
            line.close()
        broker.kill()
