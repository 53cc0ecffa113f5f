"""What stands around the PLC: the peer, the clock, the engine process, the scenario runner."""

from pathlib import Path


def demo_path() -> Path:
    """Return the project file of the built-in demo."""
    return Path(__file__).with_name("demo.toml")


def configs_path() -> Path:
    """Return the folder of the examples that came with the program: beside the source, in a wheel inside."""
    inside = Path(__file__).parents[1] / "configs"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "configs"
