"""Plain data of a scene: meshes, materials, lanes, trajectories, targets. Imports nothing else of the project."""
