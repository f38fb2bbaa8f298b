"""The robot: its kinematics, the space around its skin, and a controller that avoids obstacles."""

from hicp_lib.core.extras import require

require("robot", "pinocchio", "qpsolvers", "daqp", "scipy")
