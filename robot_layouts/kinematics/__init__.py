"""Where links are and how to bring them somewhere: rotations, trees of links, solvers.

Mathematics on plain numbers and NumPy's arrays; no files, no simulator. Importing the package loads
nothing: `quaternions` needs the standard library alone, the other modules NumPy.

Lengths are m, angles rad; quaternions are wxyz and of unit length unless a function says otherwise.
"""
