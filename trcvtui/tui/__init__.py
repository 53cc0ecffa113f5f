"""What is shown: the only floor that knows Textual."""
