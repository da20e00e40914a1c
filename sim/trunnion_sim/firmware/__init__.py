"""A Marlin in software: bytes and time in, bytes and a trace out."""
