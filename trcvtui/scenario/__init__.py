"""Scenarios: read, played, judged, reported; sessions kept as scenarios; one in several dialects."""
