"""Benches for the waves: a random run on the simulated network, and what every pin was after each scan."""

from __future__ import annotations

import random

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller
from trcvtui.history.pin_waveform import PinWaveform, Waveform, WaveformCache
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import EngineTiming

RECEIVER, SENDER = "TRCV_C_1", "TSEND_C_1"
LINES = (
    "peer P1 send random 8 seed=1",
    "peer P1 send random 3 seed=2",
    "pulse TSEND_C_1 REQ",
    "pulse TRCV_C_1 COM_RST",
    "set TRCV_C_1 EN_R=0",
    "set TRCV_C_1 EN_R=1",
    "set TRCV_C_1 EN_R=blink",
    "set TRCV_C_1 LEN=70000",
    "set TRCV_C_1 LEN=0",
    "set TRCV_C_1 CONT=0 EN_R=0",
    "set TRCV_C_1 CONT=1 EN_R=1",
    "peer P1 rst",
    "peer P1 connect",
    "plc stop",
    "plc run",
    "download TRCV_C_1",
    "fault recv EIO on C1",
)
MENDED = ("plc run", "fault clear", "set TRCV_C_1 CONT=1 EN_R=1 LEN=0", "set TSEND_C_1 CONT=1") + (
    "peer P1 connect",
) * 8
PinsSeen = dict[str, list[int | None]]  # by pin: the value after scan 1, 2, 3 ...


class Run:
    """One console, driven by lines; `seen` is what a reader of every scan has noted."""

    def __init__(self) -> None:
        self.console = Controller(Bench(load_project(CONFIGS / "duplex.toml"), "sim"))
        self.seen: dict[str, PinsSeen] = {RECEIVER: {}, SENDER: {}}
        self.scenario_folder = WaveformCache()
        self._number = 0

    def say(self, line: str) -> None:
        self._number += 1
        self.console.handle_line(self._number, line)

    def scan(self, scans: int = 1) -> None:
        runtime = self.console.bench.runtime
        for _ in range(scans):
            self.console.scan()
            for name, seen in self.seen.items():
                out = runtime.outputs(name)
                pins: dict[str, int | None] = {pin: int(v) for pin, v in runtime.inputs(name).items()}
                pins |= {"STATUS": out.status, "BUSY": out.busy, "DONE": out.done, "ERROR": out.error}
                if out.rcvd_len is not None:
                    pins["RCVD_LEN"] = out.rcvd_len
                for pin, value in pins.items():
                    seen.setdefault(pin, []).append(None if value is None else int(value))

    def play(self, line: str, scans: int) -> None:
        """Give one bench command and let scans pass, all of which the screen sees."""
        self.say(line)
        self.scan(scans)
        self.catch_up()

    def look(self, *instances: str) -> None:
        asked = self.scenario_folder.make_requests(instances or (RECEIVER, SENDER))
        request = UpdateRequest(self.console.bench.runtime.ledger.last_seq, waves=asked)
        picture = self.console.picture(request, EngineTiming(), request.most_lines)
        self.scenario_folder.add_deltas(picture.waves, picture.snapshot.interval_ns)

    def catch_up(self) -> None:
        while True:
            before = [self.wave(name).number for name in self.seen]
            self.look()
            if [self.wave(name).number for name in self.seen] == before:
                return

    def wave(self, instance: str = RECEIVER) -> Waveform:
        return self.scenario_folder.get_wave(instance)

    def lane(self, pin: str, instance: str = RECEIVER) -> PinWaveform:
        return self.wave(instance).lanes[pin]


def connected() -> Run:
    """Return a run whose receiver waits for bytes, whose sender may send."""
    run = Run()
    run.say("set TRCV_C_1 CONT=1")
    run.say("set TSEND_C_1 CONT=1")
    run.scan(6)
    run.say("peer P1 connect")
    run.scan(4)
    run.say("set TRCV_C_1 EN_R=1")
    run.scan(4)
    return run


def random_run(seed: int, scans: int, look_every: int = 7) -> Run:
    """Return a run of so many scans with a command in every fifth or so, looked at as a screen does."""
    chance, run = random.Random(seed), Run()
    run.say("set TSEND_C_1 CONT=1")
    run.say("set TRCV_C_1 CONT=1 EN_R=1")
    for scan in range(scans):
        if scan % 300 < len(MENDED):
            run.say(MENDED[scan % 300])
        elif chance.random() < 0.2:
            run.say(chance.choice(LINES[:3] if chance.random() < 0.9 else LINES))
        run.scan()
        if scan % look_every == 0:
            run.look()
    run.catch_up()
    return run
