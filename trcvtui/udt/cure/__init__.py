"""What mends a mismatch: a padded type, swap code, conversion code."""
