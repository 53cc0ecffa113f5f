"""The promises of design section 3 hold for blocks of all kinds that share CONNECTs, DATA and tasks."""

from __future__ import annotations

import os

import pytest

from tests.properties.shared_machine import SharedMachine, run_machine

LEAST_SCANS = int(os.environ.get("TRCVTUI_SHARED_SCANS", "12000"))
SCANS_AN_EXAMPLE = 250  # what one example runs through on average, cautiously


@pytest.mark.timeout(300)
def test_one_owner_a_direction_and_every_byte_once() -> None:
    run_machine(SharedMachine, LEAST_SCANS // SCANS_AN_EXAMPLE)
    assert SharedMachine.scans >= LEAST_SCANS
