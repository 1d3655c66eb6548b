"""What Dask loads first into each worker of a cluster of our own: Ctrl-C is the driver's alone."""

from __future__ import annotations

import signal

from distributed import Worker


def dask_setup(worker: Worker) -> None:
    """Leaves interrupts, which a terminal sends to all processes, to the driver."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
