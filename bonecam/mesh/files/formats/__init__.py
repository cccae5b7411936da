"""The formats of mesh files: STL, PLY, OBJ, OFF, VTK, VTP, VTU, GLB and 3MF, from bytes to vertices and polygons.

The bytes never meet C++: MeshLab's own readers, which read them before, end the process on damaged files (a PLY
whose lists have odd counts or types, an OBJ with a vertical tab) or hang (an ASCII STL with CR line ends), and
no check of the bytes ahead of such a reader can be complete. Here numpy, Python's own numbers and plyfile read,
which raise an exception at worst. A child process with limits would keep MeshLab's readers, at 0.5 s a file
for its start, and would not say which line is wrong.

Of the other readers in Python, trimesh takes a word for the end of the numbers without a message, opens the
files that an OBJ names and orders its vertices anew, and meshio reads no polygons of mixed size from OFF.
Only PLY has a structure (typed elements, lists) that is worth a library: plyfile.
"""
