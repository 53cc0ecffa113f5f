"""Frozen states of everything around the PLC, for the screen; the PLC's state is in `plc/snapshot.py`."""
