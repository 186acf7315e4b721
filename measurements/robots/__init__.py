"""A survey of robots that this library has not seen: what becomes of other packages' URDFs."""
