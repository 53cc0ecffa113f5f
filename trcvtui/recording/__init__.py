"""A run on record: what it begins with, and what writes it."""
