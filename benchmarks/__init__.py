"""Benchmarks of kerfpath beside its peers and a plain yardstick, in one run.

``make bench`` runs them all and prints the tables; see `benchmarks.__main__` for the arguments.
"""
