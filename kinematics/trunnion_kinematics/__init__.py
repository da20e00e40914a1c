"""The kinematics room of Trunnion."""
