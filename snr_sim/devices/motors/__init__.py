"""Motor controllers on serial lines, which drive the wheels of a vehicle."""
