"""The promises of the house that a static graph cannot see."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "trcvtui"


def modules_after(statement: str) -> set[str]:
    """Return the names of the modules that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport sys\nprint('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_headless_half_loads_no_screen_library() -> None:
    loaded = modules_after(
        "import trcvtui.rig.scenario.command, trcvtui.rig.engine.driver, trcvtui.rig.engine.engine"
    )
    assert not {name for name in loaded if name.split(".")[0] in ("textual", "rich")}
    assert not {name for name in loaded if name.startswith("trcvtui.tui")}


def test_every_file_opens_with_its_duty() -> None:
    bare = [
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if not path.read_text(encoding="utf-8").startswith('"""')
    ]
    assert bare == []


def test_no_status_number_stands_outside_the_dialects() -> None:
    number = re.compile(r"\b0x[78]0[0-9A-Fa-f]{2}\b")
    strangers = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in PACKAGE.rglob("*.py")
        if "dialects" not in path.parts
        for line in path.read_text(encoding="utf-8").splitlines()
        if number.search(line) and "help=" not in line
    ]
    assert strangers == []


def test_every_file_that_the_pages_for_contributors_name_is_there() -> None:
    named = re.compile(
        r"`((?:trcvtui/)?(?:net|udt|blocks|plc|project|rig|tui|dialects|tests|docs)/[\w./-]+)`"
    )
    missing = [
        f"{page}: {name}"
        for page in ("docs/architecture.md", "CONTRIBUTING.md")
        for name in named.findall((PACKAGE.parent / page).read_text(encoding="utf-8"))
        if not any(
            (root / (name + end)).exists() for root in (PACKAGE, PACKAGE.parent) for end in ("", ".py")
        )
        if "NAME" not in name
    ]
    assert missing == []
