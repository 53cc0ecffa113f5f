"""Evidence: capture files, conversations, recordings."""
