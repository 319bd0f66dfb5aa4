"""``python -m auvident``."""

from auvident.cli import main

if __name__ == "__main__":
    main()
