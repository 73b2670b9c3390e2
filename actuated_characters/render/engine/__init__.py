"""Pictures of posed characters: camera, shapes, ground and compositing."""
