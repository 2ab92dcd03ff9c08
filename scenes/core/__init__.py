"""Plain data of a scene: meshes, materials, targets, lanes, trajectories. Imports no package but itself."""
