"""Files on disk: whole, hashed, locked; where results lie, their statuses, which code decides them; the machine."""
