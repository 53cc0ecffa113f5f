"""The screens: the only layer that uses Textual."""
