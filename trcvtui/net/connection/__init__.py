"""Connections of every kind: their descriptions, how they come up, work, end, and who owns them."""
