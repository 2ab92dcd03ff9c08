"""Plain data of a scene: meshes, materials, targets, lanes, headings, trajectories. Imports itself only."""
