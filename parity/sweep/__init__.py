"""The sweep: every task beside native, with rollouts, agreement and clips."""
