"""Workers of a dask.distributed cluster: of a scheduler that runs somewhere, or of one that is started here."""

import logging
import os
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path

from hil.errors import HilError, InputError
from hil.workers.pool import Workers

CONNECT_S = 10.0  # within which a scheduler answers over a network
LIFETIME_S = 3600.0  # after which a worker that was started here is replaced: what leaks is bounded
TLS_FILES = ("ca.pem", "cert.pem", "key.pem")
# a worker does one task at a time on one core
_ENVIRONMENT = {"HIL_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


@contextmanager
def cluster(address: str, tls: Path | None = None) -> Iterator[Workers]:
    """Connect to the scheduler of a dask.distributed cluster, whose workers may come and go.

    A case whose worker is lost goes to another one. tls: folder with ca.pem, cert.pem and key.pem, for an address
    tls://. Raises InputError if no scheduler answers, HilError if dask.distributed is not installed, if the scheduler
    is lost, if a worker has no room for a case, or if a case ended several workers.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.security import Security
    except ImportError:
        raise HilError(
            "--scheduler: dask.distributed is not installed; pip install 'hil-servo[cluster]', or give --workers"
        ) from None
    security = None
    if tls is not None:
        files = [tls / name for name in TLS_FILES]
        if missing := [str(path) for path in files if not path.is_file()]:
            raise InputError(f"--tls: {', '.join(missing)} missing; allowed a folder with {', '.join(TLS_FILES)}")
        keys = ("tls_ca_file", "tls_client_cert", "tls_client_key")
        security = Security(**dict(zip(keys, map(str, files), strict=True)), require_encryption=True)
    try:
        client = Client(address, timeout=CONNECT_S, security=security)
    except (OSError, ValueError, TypeError) as error:  # TypeError: tls:// without its files
        raise InputError(
            f"--scheduler: given {address}, allowed the address that dask scheduler prints, as tcp://10.0.0.1:8786; "
            f"no scheduler answers there ({error})"
        ) from None
    with client:
        try:
            yield Workers(client.get_executor(pure=False), lambda: len(client.nthreads()), KilledWorker)
        except KilledWorker as error:
            raise HilError(f"a case ended several workers, perhaps for want of memory: {error}") from None
        except (OSError, CancelledError) as error:
            raise HilError(
                f"{address}: the scheduler is lost, or a worker cannot write ({type(error).__name__}: {error}); "
                "mend that and run the same again to go on"
            ) from None


@contextmanager
def own_cluster(count: int, lifetime_s: float = LIFETIME_S) -> Iterator[Workers]:
    """Start a scheduler and `count` workers on this machine; they end with the block, or with this process.

    A worker that is lost is replaced, and so is each one after about `lifetime_s`; their tasks go to others. Raises
    HilError if dask.distributed is not installed.
    """
    try:
        from distributed import LocalCluster
    except ImportError:
        raise HilError("dask.distributed is not installed; pip install 'hil-servo[fleet]'") from None
    os.environ.update({name: value for name, value in _ENVIRONMENT.items() if name not in os.environ})
    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",  # any port: others may have the usual one
            silence_logs=logging.CRITICAL,  # a lost worker is no news: its task goes on elsewhere
            env=_ENVIRONMENT,
            lifetime=f"{lifetime_s:g} s",
            lifetime_stagger=f"{0.2 * lifetime_s:g} s",
            lifetime_restart=True,
        ) as local,
        cluster(local.scheduler_address) as workers,
    ):
        yield workers
