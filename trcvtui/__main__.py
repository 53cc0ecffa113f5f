"""`python -m trcvtui`."""

from __future__ import annotations

from trcvtui.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
