"""Baosky (Tianxing) PLC: its rules and its STATUS tables."""
