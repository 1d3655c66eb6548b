"""What a scenario file may say: tables, keys, units, ranges and their documentation."""
