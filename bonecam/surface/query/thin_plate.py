"""The thin-plate energy of a surface as a matrix over its control points.

    int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2 = P' M P        (Gan et al. 2014, section 4.2)

over the parameters. The energy of a fit (`fitting.fairness`) is another one: it is taken in lengths, and
weighs what is along the normal and what is in the tangent plane apart.
"""

import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.tmesh.surface import Surface


def thin_plate_matrix(
    surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"], weights: Float[ndarray, " n"]
) -> sp.csc_array:
    """M by quadrature at (s, t): the sum of weights (R_ss'R_ss + 2 R_st'R_st + R_tt'R_tt)."""
    *_, R_ss, R_st, R_tt = surface.basis(s, t, 2)
    W = sp.diags_array(weights)
    return sp.csc_array(R_ss.T @ W @ R_ss + 2 * (R_st.T @ W @ R_st) + R_tt.T @ W @ R_tt)
