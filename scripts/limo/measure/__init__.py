"""What one solved case says: stress, strain, fatigue, buckling, contact, efficiency."""
