"""Frozen states of everything around the PLC, for the screen. The PLC's state is in `plc/snapshot.py`."""
