"""What things cost, how robots, planners and experts do, and the pages that say so.

A tool for developers: ``python -m benchmarks COMMAND`` in a checkout.
"""
