"""The engine in its process: the loop, the lines that come in, the pictures that go out."""
