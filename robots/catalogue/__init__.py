"""The robots that come with this library: one small module of data each."""
