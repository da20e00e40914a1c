"""`python -m trunnion` is the command `trunnion`."""

from trunnion.cli import main

if __name__ == "__main__":
    main()
