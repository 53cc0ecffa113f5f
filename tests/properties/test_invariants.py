"""The promises of design section 3 hold under random commands, peer moves and faults."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.properties.bench_machine import BenchMachine

LEAST_SCANS = int(os.environ.get("TRCVTUI_RANDOM_SCANS", "9000"))
SCANS_AN_EXAMPLE = 320  # what one example runs through on average, cautiously


@pytest.mark.timeout(300)
def test_the_invariants_hold_over_random_scans() -> None:
    BenchMachine.scans = 0
    many = settings(
        max_examples=LEAST_SCANS // SCANS_AN_EXAMPLE,
        stateful_step_count=60,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    run_state_machine_as_test(BenchMachine, settings=many)
    assert BenchMachine.scans >= LEAST_SCANS
