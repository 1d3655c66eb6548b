"""Preload of each Dask worker of a local cluster: only the driver handles Ctrl-C."""

from __future__ import annotations

import signal

from distributed import Worker


def dask_setup(worker: Worker) -> None:
    """Ignore interrupts, which a terminal sends to all processes; the driver handles them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
