"""Report: everything a person looks at: figures, summary, tables, pictures, the page, the setup sheet, the kept folder.

Notation:

    keep folder   levels, paths, tables and pictures of a run (`--keep`)
    page          one HTML file that shows part, levels and program, without a network
    setup sheet   what the operator needs at the machine, printable
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
