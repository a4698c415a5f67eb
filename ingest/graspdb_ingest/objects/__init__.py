"""Objects: surfaces from files, point clouds, their descriptors, and the pose over time."""
