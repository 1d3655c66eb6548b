"""The controller's belief as models: scene, robot, contacts, object path, statics, inertia."""
