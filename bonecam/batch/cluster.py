"""A cluster of Dask as an executor (optional extra `cluster`): a worker that dies is another try of its parts, on
another one, as Dask's `distributed.scheduler.allowed-failures` has it (3)."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from bonecam.errors import JobError

LOCAL = "local"
"""The address that stands for a scheduler and workers on this computer."""
CONNECT = 10.0
"""How long a scheduler may take to answer, s."""


@contextmanager
def cluster_executor(address: str, workers: int = 2) -> Iterator[Executor]:
    """The executor of the scheduler at an address, or of one with so many `workers` on this computer (`local`).
    JobError where Dask is not installed or no scheduler answers."""
    try:
        import distributed
    except ImportError as error:
        remedy = "pip install 'bonecam[cluster]'"
        raise JobError(f"--scheduler {address}: needs Dask distributed: {remedy}") from error
    if address != LOCAL:
        try:
            connected = distributed.Client(address, timeout=CONNECT)
        except (OSError, ValueError) as error:
            why = " ".join(str(error).split())
            remedy = "start one with `dask scheduler` and give the address it prints, or give local"
            raise JobError(f"--scheduler {address}: no scheduler answers ({why}): {remedy}") from error
        with connected as client:
            yield client.get_executor(pure=False)
        return
    if workers < 1:
        raise JobError(f"--jobs {workers}: give 1 or more")
    size = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**size) as cluster, distributed.Client(cluster) as client:
        yield client.get_executor(pure=False)
