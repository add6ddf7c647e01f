"""Planners of other projects on the set, in an environment without kerfpath.

The environment is `requirements/planners.txt`; nothing else is needed.
"""
