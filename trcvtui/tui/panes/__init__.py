"""The panes of the bench: one file for each pane, and files for the parts of panes."""
