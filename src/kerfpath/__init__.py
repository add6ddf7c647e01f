"""kerfpath."""
