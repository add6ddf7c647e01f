"""The public benchmark set: instances, best known motions, and a checker that needs only numpy."""
