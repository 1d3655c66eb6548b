"""From measured state to torques: synthesis, drives, reaction, observer, and the guard."""
