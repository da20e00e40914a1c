"""Every tolerance with a name, a unit and a reason. Two places that need different values are two tolerances."""

WELD_DISTANCE = 1e-6
"""mm. Vertices closer than this are one vertex: far below any printable detail, above single precision at 1 m."""

ROUND_TRIP = 1e-9
"""mm and unit vectors. How exactly forward kinematics must undo inverse kinematics in double precision."""

PARALLEL_AXES = 1e-6
"""Sine of the angle under which two axes count as parallel: no printer is built that true."""

SAME_TOOL_AXIS_DEG = 1e-3
"""Degrees. A machine without rotary joints accepts tool axes this close to its own."""

GAP_CLOSING = 1e-3
"""mm. Open edges whose ends lie closer than this belong together: exporters round coordinates to three decimals."""

FLAT_HOLE = 1e-2
"""mm. A hole whose rim lies this close to one plane is capped flat whatever its size: less than any printer shows."""

PLACEMENT_SLACK = 1e-3
"""mm. How far a part may stick out of the printable space: a part as large as the bed survives a change of units."""

FLAT_BODY = 1e-6
"""mm. Corners of a body that spread less than this beyond a plane bound no volume."""
