"""The door to OpenCASCADE, which reads and writes STEP and IGES (the wheel `cadquery-ocp-novtk`, optional extra
`cad`)."""

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from bonecam.errors import FileError

STEP = (".step", ".stp")
"""Endings of STEP files."""
IGES = (".iges", ".igs")
"""Endings of IGES files."""


def occ(task: str = "this") -> Any:
    """A name space of OpenCASCADE's packages, `occ().gp.gp_Pnt`; FileError names the extra where `task`
    cannot be done without it."""
    try:
        return _packages()
    except ModuleNotFoundError as error:
        raise missing(task) from error
    except ImportError as error:
        raise FileError(
            f"{task} needs OpenCASCADE, which cannot be loaded ({error}): install the system package libgl1"
        ) from error


def missing(task: str) -> FileError:
    """What is raised where OpenCASCADE is not installed."""
    return FileError(f"{task} needs OpenCASCADE: pip install 'bonecam[cad]'")


@cache
def _packages() -> Any:
    import OCP

    return _Packages(OCP.__name__)


class _Packages:
    """Imports OCP.X when X is asked for, and keeps OpenCASCADE's own messages off the terminal."""

    def __init__(self, name: str) -> None:
        self._name = name
        messenger = self.Message.Message.DefaultMessenger_s()
        for printer in list(messenger.Printers()):
            messenger.RemovePrinter(printer)

    def __getattr__(self, package: str) -> Any:
        module = import_module(f"{self._name}.{package}")
        setattr(self, package, module)
        return module


def is_failure(error: Exception) -> bool:
    """Whether OpenCASCADE raised an error: in Python its exceptions have no base of their own."""
    return type(error).__module__.partition(".")[0] == "OCP"


def kind_of(file: Path) -> str:
    """STEP or IGES, by the file's ending."""
    return "STEP" if file.suffix.lower() in STEP else "IGES"
