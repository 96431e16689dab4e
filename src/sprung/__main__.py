"""The command line, as `python -m sprung`."""

from sprung.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
