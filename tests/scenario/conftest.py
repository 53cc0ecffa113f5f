"""A bench with one passive connection."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.local_driver import LocalDriver
from tests.scenario.scenarios import PASSIVE
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project


@pytest.fixture
def driver() -> Iterator[LocalDriver]:
    driver = LocalDriver(fresh_bench(load_project(PASSIVE), "sim"))
    yield driver
    driver.close()
