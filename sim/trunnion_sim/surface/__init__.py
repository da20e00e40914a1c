"""What beads leave behind: laid down in order on a height field, then compared with the model."""
