"""Print settings from a TOML file, from `key=value` words, or both; the later wins."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from trunnion_core.errors import SettingsError
from trunnion_core.settings import PrintSettings
from trunnion_core.validation import sentences


def load_settings(file: Path | None = None, words: Iterable[str] = ()) -> PrintSettings:
    """Validated settings. Raises SettingsError with every problem of file and words at once."""
    values: dict[str, Any] = {}
    source = "settings"
    if file is not None:
        source = str(file)
        try:
            values.update(tomllib.loads(file.read_text(encoding="utf-8")))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SettingsError(source, [f"is not TOML: {error}"]) from None
        except OSError as error:
            raise SettingsError(source, [f"cannot be read: {error.strerror}"]) from None
    for word in words:
        key, equals, text = word.partition("=")
        if not equals or not key.strip():
            raise SettingsError("--set", [f"'{word}' should be key=value"])
        values[key.strip()] = _value(text.strip())
    try:
        return PrintSettings.model_validate(values)
    except ValidationError as error:
        raise SettingsError(source, sentences(error, PrintSettings)) from None


def _value(text: str) -> Any:
    """A word in TOML's spelling, or the bare text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
