"""What misuse and impossible work raise. Each message says where, what, and what would have been right."""

from collections.abc import Sequence

from trunnion_core.arrays import FloatArray


class TrunnionError(Exception):
    """Base of every error a user can cause; the command line prints it as one sentence and exits with 2."""


class FileProblem(TrunnionError):
    """A file of the user's is not what it should be; `problems` holds every one found, not just the first."""

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{source}: {problem}" for problem in problems))


class ProfileError(FileProblem):
    """A machine profile does not describe a machine."""


class SettingsError(FileProblem):
    """A print setting is unknown or out of bounds."""


class MeshError(TrunnionError):
    """A mesh file cannot be read, or what it holds cannot be made into a solid."""


class PlacementError(TrunnionError):
    """The part does not fit on the machine as placed."""


class GcodeError(TrunnionError):
    """A program cannot be written or read; the message names the line."""


class StreamError(TrunnionError):
    """Talking to the printer failed; the message says at which line and why."""


class UnreachableError(TrunnionError):
    """A pose that the machine cannot take: which row, where, and the joint that gave up."""

    def __init__(
        self,
        row: int,
        point: FloatArray,
        tool_axis: FloatArray,
        joint: str,
        reason: str,
        *,
        layer: int | None = None,
    ) -> None:
        self.row = row
        self.point = point
        self.tool_axis = tool_axis
        self.joint = joint
        self.reason = reason
        self.layer = layer
        where = ", ".join(f"{value:.3f}" for value in point)
        axis = ", ".join(f"{value:.4f}" for value in tool_axis)
        at_layer = "" if layer is None else f" of layer {layer}"
        super().__init__(
            f"row {row}{at_layer}: point ({where}) mm with tool axis ({axis}) is out of reach: joint {joint} {reason}"
        )
