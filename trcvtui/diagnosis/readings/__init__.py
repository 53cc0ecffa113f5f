"""Recorded bytes to proposals how to cut them into frames."""
