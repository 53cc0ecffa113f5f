"""Reads, plays, judges and reports scenarios, also in several dialects. Keeps sessions as scenarios."""
