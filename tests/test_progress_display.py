"""The bar tells the stage, the time left, and that kernels are compiled."""

import io

import numba
import numpy as np

import bonecam
from bonecam.cli.stopping import COMPILING, ProgressBar


def test_it_tells_share_stage_and_time_left_and_goes_away() -> None:
    stream = io.StringIO()
    with ProgressBar(stream) as bar:
        bar(0.25, "level 3: passes")
        assert " 25%" in stream.getvalue()
        assert "<" in stream.getvalue()
        assert "level 3: passes" in stream.getvalue()
    assert stream.getvalue().endswith("\r")


def test_it_tells_a_compilation_while_it_lasts() -> None:
    stream = io.StringIO()

    @numba.njit
    def doubled(values: np.ndarray) -> np.ndarray:
        return values * 2

    with ProgressBar(stream) as bar:
        bar(0.1, "first")
        listened = numba.core.event.Listener

        class During(listened):  # looks at the bar while numba compiles
            def on_start(self, event: object) -> None:
                bar(0.2, "second")

            def on_end(self, event: object) -> None:
                pass

        numba.core.event.register("numba:compile", During())
        doubled(np.ones(3))
        bar(0.3, "third")
    told = stream.getvalue()
    assert f"{COMPILING}second" in told
    assert f"{COMPILING}third" not in told


def test_it_is_a_public_name() -> None:
    assert bonecam.ProgressBar is ProgressBar
