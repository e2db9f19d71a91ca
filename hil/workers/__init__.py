"""Many tasks side by side: in processes of this machine, or on a dask.distributed cluster."""
