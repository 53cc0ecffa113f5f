"""The real network of this machine, and its serial ports."""
