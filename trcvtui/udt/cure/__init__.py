"""The cures of a mismatch: a padded type, or swap code."""
