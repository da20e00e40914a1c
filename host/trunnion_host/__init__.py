"""The host room of Trunnion."""
