"""Files that hold a part: meshes, CAD bodies, point clouds."""
