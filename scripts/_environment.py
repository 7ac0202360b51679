"""Where dexplan is not installed for the Python that runs a script, start the script again with the Python of ``.venv``.

Imported first by every script, and written for any Python 3, because it may be the system's.
"""

import importlib.util
import os
import sys

MARK = "DEXPLAN_RESTARTED"
NEEDED = ("dexplan", "mujoco", "numpy")

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def enter():
    """Return where all that is needed can be imported; else start again with the environment's Python, or say how to make it."""
    if all(importlib.util.find_spec(name) for name in NEEDED):
        return
    folder = os.environ.get("DEXPLAN_VENV", os.path.join(ROOT, ".venv"))
    python = os.path.join(folder, "bin", "python")
    if os.access(python, os.X_OK) and MARK not in os.environ:
        os.environ[MARK] = "1"
        sys.stdout.flush()
        os.execv(python, [python, *sys.argv])
    name = os.path.basename(sys.argv[0])
    fact = f"{name}: dexplan is not installed for {sys.executable}"
    sys.stderr.write(f"{fact}; run scripts/setup once, which installs it in {folder}\n")
    sys.exit(2)


def prepare():
    """Set what libraries read while they load.  Here, because scripts import them before they do anything."""
    from dexplan.errors import DexplanError
    from dexplan.terminal import make_printable, prepare_environment

    make_printable()
    try:
        prepare_environment()
    except DexplanError as error:
        sys.stderr.write(f"{os.path.basename(sys.argv[0])}: {error}\n")
        sys.exit(2)


enter()
prepare()
