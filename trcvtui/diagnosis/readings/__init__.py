"""From recorded bytes to proposals for cutting them into frames."""
