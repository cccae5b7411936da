"""The job: every parameter of a run, one frozen record a section.

Default, unit, range, label and tooltip of a parameter are declared once, on the field of its record. The
command line, the job file (TOML) and the filters derive their parameters from these fields. Lengths are mm,
feeds mm/min; angles are degrees in names that end in `_deg`, radians otherwise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
