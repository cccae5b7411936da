"""The kind of a T-spline, measured from its blending functions.

standard: the blending functions sum to one; semi-standard: they do with some positive weights; non-
standard: with none, so only the division by W = sum w B makes the surface follow its control points
(Sederberg et al. 2004, section 3). All are looked for in Bernstein coefficients: sum_i x_i C_i = 1 on every
element is a linear system, and its rank tells whether the functions are independent.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface.basis import Elements
from bonecam.surface.tmesh import Surface, TMesh, junctions, meetings

ONE = 1e-10
"""How near a sum must come to one."""

RANK = 1e-12
"""Share of the largest eigenvalue: below this a combination of functions is zero."""

GRID = 17
"""Places along an element at which the sum is measured."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """`kind`, the evidence for it, and how T-junction extensions meet.

    sum_error is the largest |sum B - 1|; sums_to_one counts the faces (elements, where rows have no faces) on
    which it is below 1e-10; unit_weights make the sum one where there are such weights. crossing and touching
    hold pairs of T-junctions.
    """

    kind: str
    sum_error: float
    sums_to_one: int
    faces: int
    unit_weights: Float[ndarray, " n"] | None
    nullity: int
    junctions: int
    crossing: Int64[ndarray, "c 2"]
    touching: Int64[ndarray, "d 2"]

    @property
    def standard(self) -> bool:
        """The functions sum to one."""
        return self.kind == "standard"

    @property
    def semi_standard(self) -> bool:
        """The functions sum to one with some positive weights (a standard T-spline is semi-standard, too)."""
        return self.kind != "non-standard"

    @property
    def meeting(self) -> int:
        """Pairs of closed extensions that meet, crossing or touching."""
        return len(self.crossing) + len(self.touching)

    @property
    def analysis_suitable(self) -> bool:
        """No extension meets another, not even at an end (Li & Scott's closed extensions)."""
        return self.meeting == 0

    @property
    def linearly_independent(self) -> bool:
        """No blending function is a combination of the others."""
        return self.nullity == 0


def diagnose(surface: Surface) -> Diagnosis:
    """Measure what kind of T-spline the surface is; weights and control points play no part."""
    elements = surface.elements()
    tmesh = surface.tmesh

    # Row 16 e + c (cubic elements): the c-th Bernstein coefficients on element e of all functions
    element = np.repeat(np.arange(len(elements.boxes)), np.diff(elements.starts))
    count = elements.coefficients.shape[1]
    rows = (count * element[:, None] + np.arange(count)).ravel()
    columns = np.repeat(elements.functions, count)
    matrix = sp.csr_array(
        (elements.coefficients.ravel(), (rows, columns)), shape=(count * len(elements.boxes), tmesh.size)
    )

    # Largest |sum - 1| on each element, on a grid of places
    sums = matrix @ np.ones(tmesh.size)
    x = np.linspace(0, 1, GRID)
    d = elements.degree
    bernstein = np.array([math.comb(d, k) * x**k * (1 - x) ** (d - k) for k in range(d + 1)])
    values = np.einsum("eji,jn,im->enm", sums.reshape(-1, d + 1, d + 1), bernstein, bernstein)
    errors: ndarray = np.abs(values - 1).max(axis=(1, 2))

    gram = (matrix.T @ matrix).toarray()

    # Positive weights that make the functions sum to one; None where there are none
    one = np.ones(matrix.shape[0])
    solved: ndarray = np.linalg.lstsq(gram, matrix.T @ one, rcond=None)[0]
    weights = solved if np.abs(matrix @ solved - one).max() <= ONE and solved.min() > 0 else None

    values = np.linalg.eigvalsh(gram)
    nullity = int((values <= RANK * values[-1]).sum())
    kind = "standard" if errors.max() <= ONE else "non-standard" if weights is None else "semi-standard"
    general = isinstance(tmesh, TMesh)
    face = _face_of(elements, tmesh.face_boxes) if general else np.arange(len(elements.boxes))
    worst = np.zeros(int(face.max()) + 1)
    np.maximum.at(worst, face, errors)
    none = np.zeros((0, 2), dtype=np.int64)
    crossing, touching = meetings(tmesh) if general else (none, none)
    count = len(junctions(tmesh).vertices) if general else 0
    return Diagnosis(
        kind=kind,
        sum_error=float(errors.max()),
        sums_to_one=int((worst <= ONE).sum()),
        faces=len(worst),
        unit_weights=weights,
        nullity=nullity,
        junctions=count,
        crossing=crossing,
        touching=touching,
    )


def _face_of(elements: Elements, faces: ndarray) -> Int64[ndarray, " e"]:
    """The face each element lies in."""
    s, t = elements.boxes[:, :2].mean(axis=1), elements.boxes[:, 2:].mean(axis=1)
    face_of_element = np.empty(len(s), dtype=np.int64)
    for k, (s_low, s_high, t_low, t_high) in enumerate(faces):
        face_of_element[(s_low < s) & (s < s_high) & (t_low < t) & (t < t_high)] = k
    return face_of_element
