"""A run on record: what it begins with, and who writes it."""
