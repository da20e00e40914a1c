"""Rules of execution, one firmware a file."""
