"""``python -m dexplan``: the command line."""

from dexplan.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
