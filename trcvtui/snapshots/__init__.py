"""Frozen states of everything around the PLC, for the screen; that of the PLC is in `plc/snapshot.py`."""
