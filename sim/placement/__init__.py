"""Where to stand and where to hold: a search over bases, contacts and postures."""
