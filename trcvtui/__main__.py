"""`python -m trcvtui`: the command line."""

from trcvtui.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
