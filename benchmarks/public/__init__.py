"""The public benchmark set: instances, the best motions known, and a checker on numpy alone."""
