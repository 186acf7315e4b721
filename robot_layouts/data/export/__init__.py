"""Recorded episodes in the formats that training tools read: LeRobot v3.0 and robomimic."""
