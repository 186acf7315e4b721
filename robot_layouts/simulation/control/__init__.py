"""Control modes other than joint positions: velocities, targets that are remembered, TCP poses."""
