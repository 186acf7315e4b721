"""A page for every task and every robot, written from the code and from what was measured."""
