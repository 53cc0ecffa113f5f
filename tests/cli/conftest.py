"""Run a command line inside the test process."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from trcvtui.cli.main import main

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Return what gives exit code, stdout and stderr of a command line, its words one by one."""

    def of(*argv: str) -> tuple[int, str, str]:
        code = main(argv)
        return code, *capsys.readouterr()

    return of
