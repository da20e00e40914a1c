"""Trunnion: a mesh becomes a verified program for a 5-axis printer, and the printer runs it."""
