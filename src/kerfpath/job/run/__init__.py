"""The run of a job: plan every contour, audit every plan, find the order of cutting."""
