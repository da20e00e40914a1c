"""The sim room of Trunnion."""
