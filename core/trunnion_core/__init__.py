"""The nouns that the rooms of Trunnion pass to each other; no algorithms."""
