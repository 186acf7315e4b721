"""MJCFs of other packages, and what `RobotDescriptor.from_mjcf` makes of them."""
