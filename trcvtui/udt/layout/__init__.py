"""A type laid out in memory, and the bytes of such a layout to values and back."""
