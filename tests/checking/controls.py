"""A machine and the dialect of its control, for every dialect that ships."""

from bonecam.machine import read_machine
from bonecam.nc import dialect_names, read_dialect

PAIRS = {
    name: (read_machine("linuxcnc-xyzbc" if name == "linuxcnc" else "mikron-ucp600"), read_dialect(name))
    for name in dialect_names()
}
KINDS = ("heidenhain", "linuxcnc", "siemens-840d", "fanuc-30i")
"""Dialects that the code tells apart."""
