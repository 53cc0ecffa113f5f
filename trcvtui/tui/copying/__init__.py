"""From the screen into the user's hands: what is copied, and into what."""
