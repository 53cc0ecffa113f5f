"""The bench itself, and help."""
