"""The elastic energy of a field of tool axes on the facets of the contacts (Xu et al. 2013, Eq. 22).

With the angle theta of a rotary axis of speed w and the feed v, the energy of that axis is

    v^2 / (w^2 area) (alpha int |grad theta|^2 + beta (1 mm)^2 int (laplacian theta)^2)

so that the first integral is the mean square of the axis's rate over moves in two directions at right angles. It is a
square form of the field's control values, x K x + 2 g x: with K = R^T R its residuals are R x + R^-T g. Differs from
the paper in:

1. The angles of the machine are smoothed, which cost time, not components of the axes.
2. The azimuth is that of the field, which may wind round the part: g is of this winding.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse import csr_array

from bonecam.planning.axes.facets.contact_facets import ContactFacets
from bonecam.planning.axes.field.axis_field import FieldDomain, basis

LEAST = 1e-9
"""Of K's mean diagonal, added to it: control values far from all contacts have none."""


@dataclass(frozen=True, eq=False)
class FacetEnergy:
    """Residuals `matrix` x + `wound` of an angle's control values x (c), radians a mm: `wound` is that of an azimuth
    that winds once round. `feed` is the cutter's, mm/min."""

    matrix: csr_array
    wound: Float[ndarray, " c"]
    feed: float

    @classmethod
    def of(cls, facets: ContactFacets, domain: FieldDomain, alpha: float, beta: float) -> "FacetEnergy":
        """The energy with weights alpha and beta of membrane and thin plate."""
        parameters = facets.path.parameters[facets.contact_of]
        values_at = basis(parameters, domain)
        form = facets.energy.matrix(alpha, beta) / facets.mesh.area
        K = (values_at.T @ form @ values_at).toarray()
        K[np.diag_indices_from(K)] += LEAST * np.trace(K) / len(K)
        R = cholesky(K)
        round_ = domain.round(parameters[:, 0])
        # the rows of the form sum to zero: of each pair of vertices the difference counts, the short way round
        pairs = form.tocoo()
        apart = np.mod(round_[pairs.col] - round_[pairs.row] + 0.5, 1.0) - 0.5
        pull = np.bincount(pairs.row, pairs.data * 2 * np.pi * apart, len(round_))
        wound = solve_triangular(R, values_at.T @ pull, trans="T")
        return cls(csr_array(R), wound, facets.path.cutter.feed)
