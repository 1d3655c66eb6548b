"""What is planned before anything moves: problems along the path, robust grip, fast tilts."""
