"""Siemens S7-1500 and S7-1200: their rules and their STATUS tables."""
