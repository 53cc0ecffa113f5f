"""trcvtui: a soft PLC on a test bench, in a terminal.

docs/architecture.md lists the folders in their order.
"""

__version__ = "0.3.0.dev3"
