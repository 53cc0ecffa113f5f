"""One pane or line of the screen a file; everything that changes fast draws its own lines."""
