"""The plant and the loop: scene, inverse kinematics, controller, monitor, verdict, recording."""
