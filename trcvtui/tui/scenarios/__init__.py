"""The screen of the scenarios."""
