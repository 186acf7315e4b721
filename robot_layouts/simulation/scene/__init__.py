"""What worlds are made of: shapes, parts, looks, the table, how worlds differ."""
