"""Each file has one pane or line of the screen. Widgets that change fast draw their own lines."""
