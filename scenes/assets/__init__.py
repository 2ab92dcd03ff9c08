"""Objects of a scene: buildings, vehicles, people, vegetation, street furniture, walls and fences."""
