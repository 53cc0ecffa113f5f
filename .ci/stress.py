"""Run tests many times beside two busy loops: what holds on a quiet machine has to hold on a busy one.

`python .ci/stress.py ROUNDS TEST...` prints a line a round and last `20 of 20 rounds green, N tests a round`;
it answers 1 where a test failed, with the names of those and the file that has the output of their round.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

LOOPS: Final = 2
FAILED: Final = re.compile(r"^(?:FAILED|ERROR) tests/.*", re.MULTILINE)
PASSED: Final = re.compile(r"\b(\d+) passed")
NOTHING_RAN: Final = "no test was run to its end"


def _loop(parent: int) -> None:
    """Take a processor, until the process that asked for it has ended."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    while os.getppid() == parent:
        sum(range(1_000_000))


def _round(number: int, tests: list[str], output: Path) -> tuple[int, list[str]]:
    """Run the tests once; return how many have passed, and what failed."""
    began = time.monotonic()
    pytest = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "worksteal", "-rfE", *tests]
    with output.open("wb") as file:
        # In a session of its own: ctrl+c comes to us alone, and from us once.
        tested = subprocess.Popen(pytest, stdout=file, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            code = tested.wait()
        except KeyboardInterrupt:
            tested.send_signal(signal.SIGINT)
            tested.wait()
            raise
    text = output.read_text(errors="replace")
    failed = FAILED.findall(text) or ([f"pytest answered {code}: {NOTHING_RAN}"] if code else [])
    passed = sum(map(int, PASSED.findall(text)[-1:]))
    took = time.monotonic() - began
    print(f"round {number}: {passed} passed in {took:.0f} s", *failed, sep="\n  ", flush=True)
    if failed:
        print(f"  its output: {output}", flush=True)
    else:
        output.unlink()
    return passed, failed


def main(rounds: int, tests: list[str]) -> int:
    """Run all rounds; return 1 where one was not green."""
    folder = Path(tempfile.mkdtemp(prefix="trcvtui-stress-"))
    for _ in range(LOOPS):
        multiprocessing.Process(target=_loop, args=(os.getpid(),), daemon=True).start()
    played = [_round(number, tests, folder / f"round-{number}.txt") for number in range(1, rounds + 1)]
    green = sum(not failed for _, failed in played)
    with contextlib.suppress(OSError):
        folder.rmdir()  # which keeps the output of what failed
    counts = {passed for passed, _ in played}
    print(f"{green} of {rounds} rounds green, {max(counts, default=0)} tests a round")
    return green < rounds


if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM):  # both end the tests of a round, too
        signal.signal(number, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
    sys.exit(130)
