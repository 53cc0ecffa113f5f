"""What the screen knows, and what it says about it, before anything is drawn."""
