"""What the UDT lab knows and does, without a screen."""
