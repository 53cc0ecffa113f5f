"""Which vendor's rules: STATUS words, switches, limits, layout. Tables, hardly any code."""
