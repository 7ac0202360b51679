"""A controller by its name, ``module:name`` or ``file.py:name``, as the command line is given it."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from dexplan.control.foreign import ForeignController, check_controller
from dexplan.errors import ControllerError, UnknownNameError

ACCEPTED = (
    "accepted: MODULE:NAME or FILE.py:NAME, with a function step(observation) -> ctrl or a class that has one"
)

Made = TypeVar("Made")


def load_controller(name: str) -> ForeignController:
    """Return the function ``name`` stands for, or an object of the class it stands for, made without arguments.

    Modules are also looked for in the current folder.  Raises ControllerError where there is no such thing, and where importing
    or making it fails; UnknownNameError where the module has no such name.
    """
    source, colon, attribute = name.rpartition(":")
    if not (colon and source.strip() and attribute.isidentifier()):
        raise ControllerError(repr(name), "it is no name of a controller", ACCEPTED)
    module = _import(name, source)
    if attribute not in vars(module):
        known = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        raise UnknownNameError(f"controller in {source}", attribute, known or ["nothing that can be called"])
    found = getattr(module, attribute)
    controller: ForeignController = _try(name, f"{attribute}()", found) if isinstance(found, type) else found
    check_controller(controller)
    return controller


def _import(name: str, source: str) -> ModuleType:
    if source.endswith(".py"):
        path = Path(source)
        if not path.is_file():
            raise ControllerError(repr(name), f"there is no file {source}", ACCEPTED)
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None
        assert spec.loader is not None
        sys.path.append(str(path.parent.resolve()))
        module = importlib.util.module_from_spec(spec)
        # Dataclasses and pickles look their module up by name.
        sys.modules.setdefault(path.stem, module)
        loader = spec.loader
        _try(name, f"importing {source}", lambda: loader.exec_module(module))
        return module
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    return _try(name, f"importing {source}", lambda: importlib.import_module(source))


def _try(name: str, what: str, make: Callable[[], Made]) -> Made:
    """Return what ``make`` returns; ControllerError for whatever it raises."""
    try:
        return make()
    except (Exception, SystemExit) as error:
        said = (
            f"{what} raised {type(error).__name__}: {error}"
            if str(error)
            else f"{what} raised {type(error).__name__}"
        )
        raise ControllerError(repr(name), said, ACCEPTED) from error
