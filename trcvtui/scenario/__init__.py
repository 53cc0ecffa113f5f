"""Scenarios: read, played, judged, reported; sessions kept as scenarios; the dialect race."""
