"""The promises of design section 3 hold for blocks of all kinds that share CONNECTs, DATA and tasks."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.properties.shared_machine import SharedMachine

LEAST_SCANS = int(os.environ.get("TRCVTUI_SHARED_SCANS", "12000"))
SCANS_AN_EXAMPLE = 250  # what one example runs through on average, cautiously


@pytest.mark.timeout(300)
def test_one_owner_a_direction_and_every_byte_once() -> None:
    SharedMachine.scans = 0
    many = settings(
        max_examples=LEAST_SCANS // SCANS_AN_EXAMPLE,
        stateful_step_count=50,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    run_state_machine_as_test(SharedMachine, settings=many)
    assert SharedMachine.scans >= LEAST_SCANS
