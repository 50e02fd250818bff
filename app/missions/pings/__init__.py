"""Pings of swath sonars: ``gate`` judges, ``store`` keeps them, as ``codec`` and ``chunk_file`` say."""
