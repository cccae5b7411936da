"""The error of the first move of a text that a control would not run, or would run otherwise than meant."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.nc.reading.motions import Motions


def refuse_first(motions: Motions, wrong: Bool[ndarray, "n"], why: Callable[[int], str]) -> None:
    """VerifyError at the first `wrong` move, if there is one; `why` tells of a move what is wrong and the remedy."""
    if not wrong.any():
        return
    move = int(np.argmax(wrong))
    line = int(motions.lines[move])
    raise VerifyError(f"line {line}: {why(move)}", line=line, place=tuple(motions.tips[move].tolist()), error=np.inf)
