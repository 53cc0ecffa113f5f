"""What surrounds the PLC, frozen for the screen; the PLC itself is in `plc/snapshot.py`."""
