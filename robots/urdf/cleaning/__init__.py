"""Repairs of URDFs, before anything else reads them."""
