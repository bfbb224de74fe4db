"""Files on disk: whole, hashed, locked; statuses; the machine."""
