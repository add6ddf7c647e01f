"""Planners of other projects on the set, each in an environment without kerfpath.

The environment is `requirements/planners.txt`; only what is imported here and numpy is needed.
"""
