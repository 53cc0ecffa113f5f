"""Reads a project file into a Project, and writes it: every key is read, checked, written."""
