"""What the screen knows about the bench, and the texts that explain it, before anything is drawn."""
