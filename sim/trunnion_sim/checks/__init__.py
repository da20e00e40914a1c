"""One check a file; each exposes CODES (code to severity and meaning) and check(context)."""
