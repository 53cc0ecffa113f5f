"""`python -m trcvtui`: the command line."""

from trcvtui.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
