"""The partners of the PLC: what they send, answer and have received."""
