"""The UDT lab on the screen."""
