"""The motion room of Trunnion."""
