"""trcvtui: a soft PLC on a test bench, in a terminal.

The folders and their order: docs/architecture.md.
"""

__version__ = "0.2.0"
LANE = "TRCVTUI_LANE"  # of the environment; "slow": the PLC has no fast lanes (plc/fast_lane.py)


def lane_note() -> str:
    """Return ", slow lane" where the environment asks for it, else ""."""
    import os

    return ", slow lane" if os.environ.get(LANE) == "slow" else ""
