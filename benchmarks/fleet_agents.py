"""Simulated agents for F1, a process of its own: `agents PORT AGENTS LINES`, or `publish PORT LINES SECONDS`.

`agents`: each has a connection and a last will; all that an agent retains is there when `ready` is printed.
Then lines tell their figures each 10 to 60 s, and a few of them fail each second, until stdin ends.
`publish`: an agent's own code for these lines; prints the processor time that it took a second.
"""

from __future__ import annotations

import heapq
import json
import random
import select
import socket
import sys
import time
from collections.abc import Iterator
from typing import Final

from paho.mqtt.client import Client, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion

from trcvtui.fleet.broker import BrokerAccess, BrokerConnection
from trcvtui.fleet.disk_queue import DiskQueue
from trcvtui.fleet.lines import AgentInstance, AgentLine
from trcvtui.fleet.publisher import Publisher
from trcvtui.fleet.topics import FiguresMessage, FleetMessage, StateMessage, StatusMessage, Topic

SITES: Final = 10
OFFLINE: Final = 0  # the first agent: its rows are the list's first ones, and stay
FAILING_S: Final = 5  # ERROR edges a second, of all lines together
TURN_S: Final = 0.115  # between two turns of an agent
CAUSE: Final[dict[str, object]] = {
    "text": "recv gave ECONNRESET", "call": "recv", "errno": "ECONNRESET", "peer": "10.0.0.7:2000",
    "injected": False,
}  # fmt: skip


def place_of(agent: int, line: str = "", instance: str = "") -> tuple[str, str, str, str]:
    """Return the names in a topic."""
    return f"site{agent % SITES}", f"agent{agent:03}", line, instance


def status_of(seen: AgentInstance, now: float, is_error: bool = False) -> StatusMessage:
    """Return what an instance shows."""
    code, text = ("80A6", "the partner has reset the connection") if is_error else ("7006", "receiving")
    return StatusMessage(now, code, text, not is_error, False, is_error, 70, seen.count, 0, 24, 0.5)


class SimulatedAgent:
    """One connection with its lines."""

    def __init__(self, port: int, number: int, lines: int) -> None:
        self.number = number
        self.seen = [AgentInstance(f"L{line:02}", "TRCV_C_1") for line in range(lines)]
        self.client = Client(CallbackAPIVersion.VERSION2, f"agent{number}", protocol=MQTTv5)
        self.client.max_inflight_messages_set(1000)
        self.client.will_set(self.topic("state"), self.state("offline"), qos=1, retain=True)
        self.client.connect("127.0.0.1", port)
        self.is_begun = False
        self.client.on_connect = self._on_connect

    def topic(self, kind: str, line: str = "", instance: str = "") -> str:
        """Return a topic of this agent."""
        return str(Topic(*place_of(self.number, line, instance), kind))

    def state(self, state: str) -> bytes:
        """Return what it retains of itself."""
        return StateMessage(state, time.time(), "0", "pc-7").to_json()

    def _on_connect(self, *told: object) -> None:
        self.is_begun = True
        self.client.publish(
            self.topic("state"), self.state("offline" if self.number == OFFLINE else "online"), 1, True
        )
        for each in self.seen:
            self.figures(each)
            self.retain(each, status_of(each, time.time()))
            if self.number != OFFLINE and random.random() < 0.2:
                self.fail(each, random.randint(1, 6))

    def retain(self, seen: AgentInstance, message: FleetMessage) -> None:
        """Publish a retained message of an instance."""
        topic = self.topic(message.KIND, seen.line, seen.name)
        self.client.publish(topic, message.to_json(), 1, True)

    def figures(self, seen: AgentInstance) -> None:
        """Tell how a line runs."""
        rate = random.randrange(1000)
        message = FiguresMessage(time.time(), "connected", rate, 0, 60, 0)
        self.client.publish(self.topic("figures", seen.line), message.to_json(), 1, True)

    def fail(self, seen: AgentInstance, times: int = 1) -> None:
        """Have ERROR edges; the STATUS is good again after them."""
        now = time.time()
        for _ in range(times):
            event = seen.add_event("b00", now, "error", "80A6", CAUSE)
            self.client.publish(self.topic("event", seen.line, seen.name), event.to_json(), 1)
        self.retain(seen, seen.recent_message(now))
        self.retain(seen, status_of(seen, now))


def agents(port: int, count: int, lines: int) -> None:
    """Be all agents until stdin ends."""
    random.seed(1)
    poll, by_file = select.poll(), dict[int, SimulatedAgent]()
    poll.register(sys.stdin, select.POLLIN)
    for number in range(count):
        agent = SimulatedAgent(port, number, lines)
        held = agent.client.socket()
        assert held is not None
        by_file[held.fileno()] = agent
        poll.register(held, select.POLLIN)
    due = [(random.uniform(0, 60), n, line) for n in range(count) for line in range(lines)]
    heapq.heapify(due)
    every = list(by_file.values())
    told, began, fails_at = False, 0.0, 0.0
    while True:
        for number, _ in poll.poll(20):
            if number == sys.stdin.fileno():
                return
            by_file[number].client.loop_read()
        for agent in every:
            while agent.client.want_write():
                agent.client.loop_write()
        now = time.monotonic()
        if not told and all(agent.is_begun and not agent.client._out_messages for agent in every):
            told, began = True, now
            print("ready", flush=True)
        while told and due[0][0] <= now - began:
            _, n, line = due[0]
            every[n].figures(every[n].seen[line])
            heapq.heapreplace(due, (now - began + random.uniform(10, 60), n, line))
        if told and now >= fails_at:
            fails_at = now + 1 / FAILING_S
            failing = random.choice(every[1:])
            failing.fail(random.choice(failing.seen))


def publish(port: int, lines: int, seconds: float) -> float:
    """Return the share of a core that an agent's publishing takes: each line has a DONE a second."""
    connection = BrokerConnection(BrokerAccess("127.0.0.1", port, False), "publisher")
    publisher = Publisher(connection, DiskQueue(None, print), lambda said: None)
    connection.start()
    names = [f"L{line:02}" for line in range(lines)]
    seen = [(AgentLine(name), AgentInstance(name, "TRCV_C_1")) for name in names]
    while not publisher.is_up:
        publisher.advance(time.perf_counter_ns())
        connection.wait_for_event(0.1)
    used, began = time.process_time(), time.perf_counter()
    for turn in _turns(seconds):
        at = time.time()
        for number, (line, instance) in enumerate(seen):
            if turn % 9 == number % 9:  # once a second
                publisher.retain(_topic("status", instance), status_of(instance, at).to_json())
            if turn % 90 == number:  # figures of a line on which bytes move: each 10 s
                publisher.send_figures(
                    str(Topic("s", "a", line.name, "", "figures")), line.take_figures(at).to_json()
                )
        if turn % 9 == 0:  # an ERROR edge a second
            instance = seen[turn % lines][1]
            event = instance.add_event("b00", at, "error", "80A6", CAUSE)
            publisher.send_event(_topic("event", instance), event.to_json())
            publisher.retain(_topic("recent", instance), instance.recent_message(at).to_json())
        publisher.advance(time.perf_counter_ns())
    share = (time.process_time() - used) / (time.perf_counter() - began)
    connection.close()
    return share


def _topic(kind: str, instance: AgentInstance) -> str:
    return str(Topic("s", "a", instance.line, instance.name, kind))


def _turns(seconds: float) -> Iterator[int]:
    """Yield the number of each turn until the time is over."""
    for turn in range(int(seconds / TURN_S)):
        yield turn
        time.sleep(TURN_S)


if __name__ == "__main__":
    socket.setdefaulttimeout(10)
    if sys.argv[1] == "agents":
        agents(*map(int, sys.argv[2:5]))
    else:
        print(json.dumps(publish(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))))
