"""What an object is made of: poses, geoms, shapes, meshes, mass and inertia."""
