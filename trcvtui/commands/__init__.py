"""The bench commands: one line of text to a frozen command and back."""
