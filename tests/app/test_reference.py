"""The reference pages are what the models say."""

from pathlib import Path

import pytest

from trunnion.reference import pages, profile_schema
from trunnion_core.profile_file import JointTable, ProfileFile
from trunnion_core.settings import PrintSettings

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", sorted(pages()))
def test_the_page_in_docs_is_the_generated_one(name):
    text = (DOCS / name).read_text(encoding="utf-8")
    assert text == pages()[name], f"out of date; run: python -m trunnion.reference docs ({name})"


def test_every_key_has_its_row():
    assert all(f"| `{key}` |" in pages()["settings.md"] for key in PrintSettings.model_fields)
    assert all(f"| `{key}` |" in pages()["profiles.md"] for key in JointTable.model_fields)


def test_the_schema_knows_all_tables_and_forbids_others():
    schema = profile_schema()
    assert set(schema["properties"]) == set(ProfileFile.model_fields)
    assert schema["additionalProperties"] is False
