"""Layers that follow the skin of a part where planar layers would make stairs (Shahid 2024, arXiv 2411.07225)."""
