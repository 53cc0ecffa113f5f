"""The contract of the seam: the facts that every kernel shares, in one list."""

from __future__ import annotations

from importlib import import_module

import pytest

from tests.net.net_facts import FACTS, NEEDS_RDHUP, OF_THE_WIRE, Fact

PARTS = ("facts_connect", "facts_ports", "facts_poll", "facts_data", "facts_datagrams", "facts_links")

# Importing the parts fills the list; rewritten, a failing fact shows both sides of its comparison.
pytest.register_assert_rewrite(*PARTS)
for part in PARTS:
    import_module(f"tests.net.{part}")

__all__ = ["FACTS", "NEEDS_RDHUP", "OF_THE_WIRE", "Fact"]
