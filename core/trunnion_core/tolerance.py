"""Every tolerance with a name, a unit and a reason. Two places that need different values are two tolerances."""

WELD_DISTANCE = 1e-6
"""mm. Vertices closer than this are one vertex: far below any printable detail, above single precision at 1 m."""

ROUND_TRIP = 1e-9
"""mm and unit vectors. How exactly forward kinematics must undo inverse kinematics in double precision."""

PARALLEL_AXES = 1e-6
"""Sine of the angle under which two axes count as parallel: no printer is built that true."""

SAME_TOOL_AXIS_DEG = 1e-3
"""Degrees. A machine without rotary joints accepts tool axes this close to its own."""
