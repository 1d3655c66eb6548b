"""The closed loop and all around it: scene, models, plant, control, judgement, recording."""
