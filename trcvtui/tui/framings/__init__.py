"""The framing advice on the screen."""
