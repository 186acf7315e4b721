"""Where arms can reach, by SAPIEN's Pinocchio on what was built."""
