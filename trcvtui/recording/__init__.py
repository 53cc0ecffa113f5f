"""The recording of a run: its first entry, its writers, and its replay."""
