"""What a row of a toolpath is for, and how G-code viewers spell it."""

from enum import IntEnum


class Role(IntEnum):
    """The purpose of one motion. Values are stored in arrays and files; add at the end only."""

    TRAVEL = 0
    """Moves without extruding, with the filament retracted if the run is long enough."""
    LINK = 1
    """Moves without extruding and without retracting: a short hop inside one region."""
    SKIRT = 2
    OUTER_WALL = 3
    INNER_WALL = 4
    INFILL = 5
    SOLID_INFILL = 6
    TOP_SOLID_INFILL = 7
    NONPLANAR_OUTER_WALL = 8
    NONPLANAR_INNER_WALL = 9
    NONPLANAR_INFILL = 10
    RETRACT = 11
    """Filament only, backwards. Appears in machine programs, never in a toolpath."""
    PRIME = 12
    """Filament only, forwards, undoing a retraction. Appears in machine programs, never in a toolpath."""

    @property
    def extrudes(self) -> bool:
        """Whether a bead is laid on such a row."""
        return Role.SKIRT <= self <= Role.NONPLANAR_INFILL

    @property
    def nonplanar(self) -> bool:
        """Whether the bead follows a curved surface."""
        return Role.NONPLANAR_OUTER_WALL <= self <= Role.NONPLANAR_INFILL

    @property
    def text(self) -> str:
        """Lower-case name, as files and messages spell it."""
        return self.name.lower()


VIEWER_TYPE = {
    Role.SKIRT: "Skirt/Brim",
    Role.OUTER_WALL: "External perimeter",
    Role.INNER_WALL: "Perimeter",
    Role.INFILL: "Internal infill",
    Role.SOLID_INFILL: "Solid infill",
    Role.TOP_SOLID_INFILL: "Top solid infill",
    Role.NONPLANAR_OUTER_WALL: "External perimeter",
    Role.NONPLANAR_INNER_WALL: "Perimeter",
    Role.NONPLANAR_INFILL: "Top solid infill",
}
"""`;TYPE:` texts in the spelling of PrusaSlicer, which existing viewers colour by."""
