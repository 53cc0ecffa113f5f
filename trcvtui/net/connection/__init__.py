"""Connections of every kind: their descriptions, set-up, data, end, and the claims of instances on them."""
