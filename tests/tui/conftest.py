"""The screen's tests run on the loop that the real screen has."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable

import pytest


def _eager_loop() -> asyncio.AbstractEventLoop:
    """Return a loop with eager tasks from Python 3.12 on: `App.run()` has them, `run_test()` has not."""
    loop = asyncio.new_event_loop()
    if sys.version_info >= (3, 12):
        loop.set_task_factory(asyncio.eager_task_factory)
    return loop


@pytest.hookimpl(optionalhook=True)
def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> dict[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Give every test of the screen the eager loop."""
    return {"eager": _eager_loop}
