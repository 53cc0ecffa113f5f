"""The scenarios on the screen."""
