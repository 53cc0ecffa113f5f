"""What stands around the PLC: the peer, the clock, the engine process, the scenario runner."""
