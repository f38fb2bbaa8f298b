"""The robot: its kinematics, the space around its skin, and a controller that gives way."""
