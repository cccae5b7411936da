"""Signals as a terminal leaves them."""

import signal

import pytest


@pytest.fixture(autouse=True)
def signals_of_a_terminal():
    """SIGINT raises and SIGHUP ends, though a job in the background or under nohup begins with them ignored."""
    before = [(kind, signal.getsignal(kind)) for kind in (signal.SIGINT, signal.SIGHUP)]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    for kind, handler in before:
        signal.signal(kind, handler)
