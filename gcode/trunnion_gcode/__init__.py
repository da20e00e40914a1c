"""The gcode room of Trunnion."""
