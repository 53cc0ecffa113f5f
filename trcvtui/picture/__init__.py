"""What engine and screen say to each other: lines and requests, and pictures of the bench."""
