"""One file a firmware; each exposes DIALECT. The name of the file is the name in the profile."""
