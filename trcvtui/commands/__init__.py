"""The bench commands. A line of text is read as a frozen command, which can be written as a line."""
