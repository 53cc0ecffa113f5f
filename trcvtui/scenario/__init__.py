"""Scenarios: read, played, judged, reported; sessions kept as scenarios; a scenario in several dialects."""
