"""Each file has one pane or line of the screen. Everything that changes fast draws its own lines."""
