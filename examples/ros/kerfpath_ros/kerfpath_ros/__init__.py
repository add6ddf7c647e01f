"""A node that plans with kerfpath."""
