"""A project file to a Project and back: every key read, checked, written."""
