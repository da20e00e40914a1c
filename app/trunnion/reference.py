"""The models of profiles and settings into their reference pages (Markdown) and the JSON schema of profiles.

The pages in `docs/` are what these functions return; a test holds the two together. To write them anew:
`python -m trunnion.reference docs`.
"""

import sys
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from trunnion_core.profile_file import ProfileFile
from trunnion_core.settings import PrintSettings

SIGNS = {Gt: ("above", "gt"), Ge: ("at least", "ge"), Lt: ("below", "lt"), Le: ("at most", "le")}


def pages() -> dict[str, str]:
    """File name to text of every generated page."""
    return {"profiles.md": profiles_page(), "settings.md": settings_page()}


def profile_schema() -> dict[str, Any]:
    """JSON schema (2020-12) of a machine profile, for editors that check TOML."""
    return ProfileFile.model_json_schema()


def settings_page() -> str:
    """Every print setting: default, bounds, meaning."""
    return "\n".join(
        [
            "# Print settings",
            "",
            _text(PrintSettings),
            "",
            "They come from a TOML file (`-s FILE`), from `--set key=value`, or both; the word wins over the file. An",
            "unknown setting, or one out of bounds, is an error that names what would be right.",
            "",
            *_table(PrintSettings),
            "",
        ]
    )


def profiles_page() -> str:
    """Every table and key of a machine profile: default, bounds, meaning."""
    lines = [
        "# Machine profiles",
        "",
        "A profile is a TOML file. `-m` takes the name of a shipped machine or the path of a file. A machine is two",
        "ordered chains of joints from the frame outwards: one ends in the nozzle (`tool`), one in the part (`work`).",
        "A growing value moves the carried body along +axis, or turns it right-handed about axis, so a bed that moves",
        "under a fixed nozzle to print at larger Y has `axis = [0, -1, 0]` on the `work` side. Units: mm, s, degrees,",
        "°C. All problems of a file are reported together; unknown keys suggest the nearest known one.",
    ]
    for name, model in _tables(ProfileFile, ""):
        lines += ["", f"## {name}", "", _text(model), "", *_table(model)]
    return "\n".join([*lines, ""])


def _tables(model: type[BaseModel], path: str) -> list[tuple[str, type[BaseModel]]]:
    """The model and those inside it, each under the heading that TOML gives it."""
    found = [(f"`[{path}]`" if path else "The file", model)]
    for key, field in model.model_fields.items():
        inside = _models_in(field.annotation)
        inner = f"{path}.{key}" if path else key
        for one in inside:
            many = _is_many(field.annotation)
            name = f"{inner}, shape {_shape_of(one)}" if len(inside) > 1 else inner
            if many and len(inside) == 1:
                found += [(f"`[[{inner}]]`", one), *_tables(one, inner)[1:]]
            elif len(inside) > 1:
                found.append((f"`{inner}`, {_shape_of(one)}", one))
            else:
                found += _tables(one, name)
    return found


def _table(model: type[BaseModel]) -> list[str]:
    rows = ["| key | type | default | bounds | meaning |", "|---|---|---|---|---|"]
    return rows + [
        f"| `{key}` | {_kind(field)} | {_default(field)} | {_bounds(field)} | {_meaning(field)} |"
        for key, field in model.model_fields.items()
    ]


def _kind(field: FieldInfo) -> str:
    return _kind_of(field.annotation)


def _kind_of(annotation: Any) -> str:
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _kind_of(inner[0])
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_kind_of(one) for one in inner if one is not NoneType))
    if origin is Literal:
        return " or ".join(f'`"{one}"`' for one in inner)
    if origin is tuple:
        if inner[-1] is Ellipsis:
            return f"list of {_kind_of(inner[0])}"
        return f"{len(inner)} numbers"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    return {bool: "true or false", int: "whole number", float: "number", str: "text"}[annotation]


def _default(field: FieldInfo) -> str:
    value = field.default
    if field.is_required() or value is PydanticUndefined:
        return "required"
    if value in (None, (), "") or isinstance(value, BaseModel):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"`{value:g}`"
    if isinstance(value, tuple):
        return f"`{[f'{one:g}' if isinstance(one, float) else one for one in value]}`".replace("'", "")
    return f"`{value}`"


def _bounds(field: FieldInfo) -> str:
    said = []
    for bound in field.metadata:
        for kind, (word, attribute) in SIGNS.items():
            if isinstance(bound, kind):
                said.append(f"{word} {getattr(bound, attribute):g}")
    return ", ".join(said)


def _meaning(field: FieldInfo) -> str:
    inside = _models_in(field.annotation)
    if field.description is None and len(inside) == 1:
        return _text(inside[0])
    return (field.description or "").replace("|", "\\|")


def _text(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split())


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models_in(inner)]


def _is_many(annotation: Any) -> bool:
    return get_origin(annotation) is tuple


def _shape_of(model: type[BaseModel]) -> str:
    return str(get_args(model.model_fields["shape"].annotation)[0])


if __name__ == "__main__":
    for file_name, text in pages().items():
        (Path(sys.argv[1]) / file_name).write_text(text, encoding="utf-8")
