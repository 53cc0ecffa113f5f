"""The bench commands: a line of text is read as a frozen command, which can be written as a line again."""
