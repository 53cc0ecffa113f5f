"""Reads, plays, judges and reports scenarios, also in several dialects. Saves sessions as scenarios."""
