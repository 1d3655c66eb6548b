"""Timing, forces and torques along a whole path as one second-order cone program."""
