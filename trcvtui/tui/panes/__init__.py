"""The panes of the bench, one file a pane, its parts beside it."""
