"""The addresses of this machine: how they are asked for, and what is known when the system cannot answer."""

from __future__ import annotations

import subprocess

import pytest

from trcvtui.net import os_addresses
from trcvtui.net.os_addresses import interface_addresses


def test_asking_for_the_addresses_starts_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a process was started in the middle of a scan")

    os_addresses._library.cache_clear()
    monkeypatch.setattr(subprocess, "Popen", refuse)
    assert "127.0.0.1" in [own.address for own in interface_addresses()]
