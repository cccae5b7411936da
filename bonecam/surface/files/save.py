"""One surface into a file of any kind: the ending decides.

| ending | what is written |
|---|---|
| .tspline | bonecam's own text form of row-structured T-splines, bit for bit (`surface.rows_file`) |
| .tsm | general T-meshes as Rhino writes them (`surface.files.tsm.write`) |
| .iga | the Bezier elements of any T-spline, bit for bit (`surface.iga`) |
| .step, .stp, .iges, .igs | one exact B-spline face, or Bezier faces (`surface.cad`; extra `cad`) |
"""

from pathlib import Path

from bonecam.errors import FileError
from bonecam.mesh.files.opencascade import IGES, STEP, occ
from bonecam.surface.files.iga import write_iga
from bonecam.surface.files.tspline_text import ENDINGS, write_tsm
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

TEXTS = (*ENDINGS, ".iga")


def check_target(path: str | Path) -> None:
    """FileError, before any work is done for it, where a surface cannot be saved under this name."""
    ending = Path(path).suffix.lower()
    if ending in (*STEP, *IGES):
        occ(f"{path}: writing {'STEP' if ending in STEP else 'IGES'}")
    elif ending not in TEXTS:
        endings = ", ".join((*TEXTS, *STEP, *IGES))
        raise FileError(f"{path}: has the unknown ending {ending!r}: end the name in one of {endings}", file=str(path))


def save_surface(surface: TSpline, path: str | Path) -> None:
    """Write the surface, whole or not at all. FileError where the ending is unknown, unfit for the T-mesh, or
    its writer is missing."""
    check_target(path)
    ending = Path(path).suffix.lower()
    if ending == ".iga":
        write_iga(surface, path)
    elif ending in TEXTS:
        rows = isinstance(surface.tmesh, RowTMesh)
        if rows != (ending == ".tspline"):
            what = "rows of control points have no .tsm form" if rows else "a general T-mesh has no .tspline form"
            raise FileError(f"{path}: {what}: end the name in {'.tspline' if rows else '.tsm'}", file=str(path))
        write_tsm(surface, path)
    else:
        from bonecam.surface.files.cad.write import write_iges, write_step

        (write_step if ending in STEP else write_iges)(surface, path)
