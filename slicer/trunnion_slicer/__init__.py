"""The slicer room of Trunnion."""
