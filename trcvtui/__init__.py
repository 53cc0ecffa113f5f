"""trcvtui: a soft PLC on a test bench, in a terminal.

The folders and their order: docs/architecture.md.
"""

__version__ = "0.3.0.dev2"
