"""Turn what pydantic found into sentences: every problem of a file at once, with the nearest known key."""

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError


def sentences(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One sentence a problem: key, value, and what would be right."""
    return [_sentence(problem, model) for problem in error.errors(include_url=False)]


def dotted(location: Iterable[str | int]) -> str:
    """('joint', 2, 'axis') as `joint[2].axis`."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def nearest(word: str, known: Iterable[str]) -> str:
    """Suggest what was probably meant by an unknown `word`."""
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    return f"did you mean '{close[0]}'?" if close else "known are: " + ", ".join(names)


def _sentence(problem: Mapping[str, Any], model: type[BaseModel]) -> str:
    location = tuple(part for part in problem["loc"] if not _is_tag(part))
    key = dotted(location) or "file"
    kind = problem["type"]
    if kind == "missing":
        return f"{key}: is missing"
    if kind == "extra_forbidden":
        return f"{key}: unknown key, {nearest(str(location[-1]), _fields_at(model, location[:-1]))}"
    message = problem["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if kind == "value_error":
        return f"{key}: {message}" if location else message
    return f"{key}: {problem['input']!r} is wrong, should be {message}"


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and ("[" in part or "-" in part)


def _fields_at(model: type[BaseModel], location: tuple[str | int, ...]) -> list[str]:
    """Keys known at a place of the model, found by walking the annotations; those of the model where that fails."""
    here: Any = model
    for part in location:
        if isinstance(part, int):
            continue
        field = here.model_fields.get(part) if isinstance(here, type) and issubclass(here, BaseModel) else None
        if field is None:
            field_by_alias = [f for f in here.model_fields.values() if f.alias == part]
            if not field_by_alias:
                return []
            field = field_by_alias[0]
        here = _model_inside(field.annotation)
        if here is None:
            return []
    return [field.alias or name for name, field in here.model_fields.items()]


def _model_inside(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        found = _model_inside(inner)
        if found is not None:
            return found
    return None
