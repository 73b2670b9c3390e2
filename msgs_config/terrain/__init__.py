"""The ground as a YAML file says it: stairs, slopes, boxes, squares of other heights, meshes."""
