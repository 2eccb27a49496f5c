"""The command line: it parses, calls and prints; there is no mathematics here."""
