"""The processes for parallel computations: a Dask cluster, on this machine or a given one."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass

import dask
from distributed import Client, LocalCluster
from distributed.comm.core import CommClosedError

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import whole

# Time limit for a scheduler to answer, and for its first worker to appear [s].
_PATIENCE_S = 10
_SETTINGS = {
    # Workers do not log: the driver reports problems or writes them into rows.
    "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": "critical",
    # Dask would profile every process a hundred times per second; the result is not used.
    "distributed.worker.profile.enabled": False,
}


@dataclass(frozen=True)
class Workers:
    """The choice of processes that compute.

    Attributes:
        count: Number of processes on this machine; by default one for each of its processors.
        scheduler: Address of a running Dask cluster to use instead; fulcrum must be installed on
            its workers.
    """

    count: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.count is not None:
            whole("--workers", self.count, least=1)
        if self.count is not None and self.scheduler is not None:
            valid = "none beside --scheduler, whose cluster has its own"
            raise InvalidInputError("--workers", self.count, valid)


# One process for each of this machine's processors.
LOCAL = Workers()


@contextlib.contextmanager
def cluster(workers: Workers) -> Iterator[Client]:
    """Yield a client of the cluster; a cluster on this machine is closed at the end.

    Raises:
        InvalidInputError: No cluster answers at the address.
    """
    with contextlib.ExitStack() as stack:
        if workers.scheduler is None:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)
            stack.enter_context(dask.config.set(_SETTINGS))
            address = stack.enter_context(
                LocalCluster(
                    n_workers=workers.count or os.cpu_count() or 1,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # for Dask itself; there is no dashboard
                    silence_logs=logging.CRITICAL,
                    preload="fulcrum.sim.run.quiet",
                )
            )
        else:
            address = workers.scheduler
        valid = "the address of a running Dask scheduler with workers, like tcp://host:8786"
        try:
            client = stack.enter_context(Client(address, timeout=_PATIENCE_S))
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except (OSError, ValueError, CommClosedError) as error:
            raise InvalidInputError(
                "--scheduler", f"{workers.scheduler} ({error})", valid
            ) from None
        yield client
