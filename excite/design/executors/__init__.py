"""Where units of work run: in this process, in processes of this machine, or on workers of Dask."""
