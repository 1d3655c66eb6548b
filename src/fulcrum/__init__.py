"""Robots move heavy objects by leaning them on their surroundings: a closed-loop testbed."""
