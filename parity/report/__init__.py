"""The report: what a sweep found, as one HTML page that needs nothing else."""
