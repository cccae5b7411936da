"""bonecam: from a bone mesh to a verified five-axis NC program.

    import bonecam
    result = bonecam.convert("bone.stl", bonecam.Job())
    print(result.report["levels_lower_bound"], result.program.text[:80])

`machine`, `tool`, `mesh`, `surface`, `workholding`, `setup`, `levels`, `material`, `mechanics`, `planning`, `nc`,
`verify` and `report` are the stages, in the order of the flow; `study` compares strategies. Names load when first
used; `__init__.pyi` lists them.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
