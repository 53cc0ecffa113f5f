"""What stands around the PLC: the peer, the clock, the engine process, the scenario runner."""

from pathlib import Path


def demo_path() -> Path:
    """Return the project file of the built-in demo."""
    return Path(__file__).with_name("demo.toml")
