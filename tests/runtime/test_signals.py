"""A signal that comes while files take their places waits until they are there."""

import signal

import pytest

from bonecam.runtime.staging import STOPPING, undisturbed


def test_a_signal_takes_effect_after_the_block() -> None:
    before = [signal.getsignal(kind) for kind in STOPPING]
    steps = []

    def block() -> None:
        with undisturbed():
            with undisturbed():
                signal.raise_signal(signal.SIGINT)
                steps.append("inner")
            steps.append("outer")
        steps.append("never")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert steps == ["inner", "outer"]
    assert [signal.getsignal(kind) for kind in STOPPING] == before


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with undisturbed():
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
